"""Each recipe as a part of Zwerm: its file in the room of its kind, and one row of the catalogue. No other file is edited."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from support import ROOT
from walk import Reader, blocks, part

import zwerm

RECIPES = (ROOT / "docs" / "how-to" / "recipes.md").read_text(encoding="utf-8")
FOLDERS = ("agents", "coordinator", "deploy", "docs", "scenarios", "studies", "tests", "world", "zwerm")
# Tests that go through the tables of the catalogue.
CATALOGUE_TESTS = (
    "test_rooms.py",
    "deploy/test_preload.py",
    "docs/test_docs.py",
    "world/bodies/test_drives.py",
    "world/faults/test_own_faults.py",
    "world/metrics/test_observers.py",
    "world/radio/test_ledger.py",
    "world/radio/test_radio_models.py",
    "world/radio/test_reach.py",
    "world/sensors/test_registry.py",
)
# Those of them that go through every row. An algorithm needs tests of its own, which the recipe does not write.
OF_CATALOGUE = (
    "not every_room and (catalogue or built_in or every or pair or generic or module or share or deep"
    " or same_packets or stimuli)"
)
# A metric that decodes the messages of the algorithm of the recipes.
OWN_METRIC = '''"""Headcount: the size of a report."""

from collections.abc import Mapping
from typing import ClassVar

from zwerm.agents.headcount import ID
from zwerm.world.metrics import Metric


class Headcount(Metric):
    """The size of a report [bytes]."""

    names: ClassVar[Mapping[str, str]] = {"report_bytes": "size of a report"}

    def metrics(self) -> dict[str, float]:
        """Return the size of a report."""
        return {"report_bytes": float(ID.size)}
'''


class Row(NamedTuple):
    """A recipe with the file of its plug-in, the files in rooms that it becomes, its row, and what its page says then.

    `table` is the beginning of a table of the catalogue, and `row` the text that is inserted behind it.
    """

    heading: str
    file: str
    rooms: tuple[str, ...]
    table: str
    row: str
    instead: dict[str, str]


ALGORITHM_ROW = next(
    re.sub(r"^ +layers=.*\n", "", block.text.strip()[1:-1], flags=re.MULTILINE)  # this has a recipe of its own
    for block in blocks(part(RECIPES, "A row of the catalogue"))
    if "Algorithm(" in block.text
)
ROWS = [
    Row(
        "A sensor",
        "lighthouse.py",
        ("world/sensors/lighthouse.py",),
        "SENSORS: Final = {",
        '"lighthouse": "zwerm.world.sensors.lighthouse:Lighthouse",',
        {"lighthouse:Lighthouse": "lighthouse"},
    ),
    Row(
        "A radio model",
        "rain.py",
        ("world/radio/models/rain.py",),
        "RADIO_MODELS: Final = {",
        '"rain": "zwerm.world.radio.models.rain:Rain",',
        {"rain:Rain": "rain"},
    ),
    Row(
        "A fault",
        "storm.py",
        ("world/faults/air/storm.py",),
        "FAULTS: Final = {",
        '"storm": "zwerm.world.faults.air.storm:Storm",',
        {"storm:Storm": "storm"},
    ),
    Row(
        "A field",
        "ripples.py",
        ("world/fields/ripples.py",),
        "FIELDS: Final = {",
        '"ripples": "zwerm.world.fields.ripples:Ripples",',
        {"ripples:Ripples": "ripples"},
    ),
    Row(
        "A drive",
        "tracks.py",
        ("world/bodies/tracks.py",),
        "DRIVES: Final = {",
        '"tracks": "zwerm.world.bodies.tracks:TrackedDrive",',
        {"tracks:TrackedDrive": "tracks"},
    ),
    Row(
        "A metric",
        "travel.py",
        ("world/metrics/travel.py",),
        "METRICS: Final = {",
        '"travel": "zwerm.world.metrics.travel:Travel",',
        {"'metrics.own=[\"travel:Travel\"]'": "metrics.travel=true"},
    ),
    Row(
        "A picture layer",
        "centre.py",
        ("zwerm/view/layers/centre.py",),
        'name="computation_free",',
        'layers=("zwerm.view.layers.centre:Centre",),',
        {"--set 'pictures.layers=[\"centre:Centre\"]'": ""},
    ),
    Row(
        "An algorithm with a coordinator",
        "headcount.py",
        ("agents/headcount/__init__.py", "coordinator/headcount/__init__.py"),
        "ALGORITHMS: Final[Sequence[Algorithm]] = (",
        ALGORITHM_ROW,
        {"headcount:Member": "headcount", "headcount:Counter": "headcount"},
    ),
    Row(
        "A command",
        "hurry.py",
        ("zwerm/cli/commands/hurry_command.py",),
        "COMMANDS: Final = {",
        '"fastest": "zwerm.cli.commands.hurry_command:fastest",',
        {"hurry:fastest": "fastest"},
    ),
]


# The classes of a recipe's file that go to another file.
ELSEWHERE = {
    "agents/headcount/__init__.py": ("Expected", "Counter"),
    "coordinator/headcount/__init__.py": ("Member",),
}


def without(text: str, names: Sequence[str]) -> str:
    """Return a file without the classes `names`."""
    lines = text.splitlines()
    for node in reversed(ast.parse(text).body):
        if isinstance(node, ast.ClassDef) and node.name in names:
            del lines[node.lineno - 1 : node.end_lineno]
    return "\n".join(lines) + "\n"


def for_a_room(text: str) -> str:
    """Return a file that imports public names with each name imported from the module that defines it."""
    lines = text.splitlines()
    for node in ast.parse(text).body:
        if isinstance(node, ast.ImportFrom) and node.module == "zwerm":
            found = [(getattr(zwerm, alias.name).__module__, alias.name) for alias in node.names]
            lines[node.lineno - 1 : node.end_lineno] = [
                "; ".join(f"from {module} import {name}" for module, name in found)
            ]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def tree() -> Iterator[Path]:
    """A copy of the project with the file and the row of every recipe."""
    # Not in a temporary folder of pytest: tests forget the modules that are imported from there.
    with tempfile.TemporaryDirectory(prefix="tree-") as folder:
        yield grown(Path(folder))


def grown(root: Path) -> Path:
    """Copy the project to `root`, and add the file and the row of every recipe."""
    for name in FOLDERS:
        shutil.copytree(ROOT / name, root / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("README.md", "pyproject.toml"):
        shutil.copy(ROOT / name, root)
    catalogue = root / "zwerm" / "catalogue.py"
    text = catalogue.read_text(encoding="utf-8")
    for row in ROWS:
        [source] = [block.text for block in blocks(part(RECIPES, row.heading)) if block.title == row.file]
        for name in row.rooms:
            file = root / name
            assert not file.exists()
            file.parent.mkdir(exist_ok=True)
            file.write_text(for_a_room(without(source, ELSEWHERE.get(name, ()))), encoding="utf-8")
        assert text.count(row.table) == 1
        text = text.replace(row.table, f"{row.table}\n{row.row}")
    catalogue.write_text(text, encoding="utf-8")
    (root / "world" / "metrics" / "headcount.py").write_text(OWN_METRIC, encoding="utf-8")
    [scenario] = [block.text for block in blocks(RECIPES) if block.title == "headcount.toml"]
    scenario = scenario.replace("headcount:Member", "headcount").replace("headcount:Counter", "headcount")
    (root / "scenarios" / "headcount").mkdir()
    (root / "scenarios" / "headcount" / "headcount.toml").write_text(scenario, encoding="utf-8")
    return root


def test_every_recipe_has_a_row() -> None:
    headings = re.findall(r"^## (.*)$", RECIPES, re.MULTILINE)
    assert [row.heading for row in ROWS] == [heading for heading in headings if heading != "A row of the catalogue"]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.heading)
def test_a_recipe_works_by_its_short_name_after_one_file_and_one_row(row: Row, tree: Path, tmp_path: Path) -> None:
    page = part(RECIPES, row.heading)
    for name, short in row.instead.items():
        assert name in page
        page = page.replace(name, short)
    page = page.replace(f'title="{row.file}"', "")  # the file is in its room
    reader = Reader(tmp_path, tree)
    reader.follow(page)
    assert reader.commands >= 1
    assert not (tmp_path / row.file).exists()


def test_the_layer_of_a_row_is_drawn(tree: Path, tmp_path: Path) -> None:
    pictures: list[bytes] = []
    for root in (ROOT, tree):
        folder = tmp_path / str(len(pictures))
        folder.mkdir()
        command = "zwerm run computation-free --inline --set time.duration_s=1 --picture centre.png"
        Reader(folder, root).follow(f"```console\n$ {command}\n```\n")
        pictures.append((folder / "centre.png").read_bytes())
    assert pictures[0] != pictures[1]


def python(tree: Path, *arguments: str) -> str:
    """Run Python in a tree; return what it has printed. Raises AssertionError where it fails."""
    ran = subprocess.run(
        [sys.executable, *arguments],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def test_the_tests_that_go_through_the_catalogue_pass_with_what_was_added_and_no_test_is_edited(tree: Path) -> None:
    python(tree, "docs/pages.py")  # the generated parts of the pages show what was added
    files = [f"tests/{name}" for name in CATALOGUE_TESTS]
    printed = python(tree, "-P", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-k", OF_CATALOGUE, *files)
    assert int(re.findall(r"(\d+) passed", printed)[0]) > 200


def test_the_import_contracts_hold_with_a_metric_that_decodes_its_algorithms_messages(tree: Path) -> None:
    run = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(no_cache=True))"
    assert "0 broken" in python(tree, "-P", "-c", run)


def test_the_metric_of_an_algorithm_is_measured_in_its_runs(tree: Path) -> None:
    code = "import zwerm; print(zwerm.run('headcount', runner='inline').metrics['report_bytes'])"
    assert python(tree, "-P", "-c", code) == "2.0\n"


def test_the_catalogue_and_the_reference_pages_name_what_was_added(tree: Path) -> None:
    python(tree, "docs/pages.py")
    assert "headcount" in python(tree, "-P", "-m", "zwerm", "list")
    reference = "".join(page.read_text(encoding="utf-8") for page in (tree / "docs" / "reference").glob("*.md"))
    for name in ("lighthouse", "rain", "storm", "ripples", "tracks", "travel", "fastest", "headcount"):
        assert re.search(rf"[`#] ?.*\b{name}\b", reference), name
