"""The rooms of the project: which names generic code may use, how folders and imports are shaped."""

import ast
import re
import subprocess
from collections import Counter
from functools import cache
from importlib import import_module
from pathlib import Path

from support import ROOT

from zwerm.catalogue import ALGORITHMS, controller_classes, plugins, row_of

PARTS = ("agents", "world", "coordinator", "deploy")
FILES_MAX = 15
DEPTH_MAX = 6


def modules() -> dict[str, Path]:
    """Return every module of the package by its dotted name."""
    listing = ["git", "-c", "safe.directory=*", "ls-files", "-co", "--exclude-standard", "*.py"]
    if (ROOT / ".git").exists():
        files = subprocess.run(listing, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    else:  # a source archive
        files = sorted(
            str(path.relative_to(ROOT)) for part in ("zwerm", *PARTS) for path in (ROOT / part).rglob("*.py")
        )
    found: dict[str, Path] = {}
    for name in files:
        parts = Path(name).with_suffix("").parts
        if parts[0] not in ("zwerm", *PARTS) or not (ROOT / name).is_file():
            continue
        dotted = parts if parts[0] == "zwerm" else ("zwerm", *parts)
        found[".".join(dotted[:-1] if dotted[-1] == "__init__" else dotted)] = Path(name)
    return found


MODULES = modules()


def imports_of(source: str, known: dict[str, Path]) -> set[str]:
    """Return the modules among `known` that a file imports, also under TYPE_CHECKING and inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in known else node.module)
    return found & known.keys()


GRAPH = {
    # `import zwerm` offers names that are imported when they are first used.
    name: set() if name == "zwerm" else imports_of((ROOT / path).read_text(encoding="utf-8"), MODULES) - {name}
    for name, path in MODULES.items()
}


def cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected components of more than one module (Tarjan)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            component: list[str] = []
            while not component or component[-1] != node:
                component.append(stack.pop())
            if len(component) > 1:
                found.append(sorted(component))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def room_of(module: str) -> str:
    """Return the room of a module: a folder of `zwerm/`, or of one of the parts."""
    parts = module.split(".")
    return ".".join(parts[:3]) if len(parts) > 2 and parts[1] in PARTS else ".".join(parts[:2])


def algorithm_names() -> list[str]:
    """Return the names by which algorithms are known: of their rows and of their controllers."""
    found: set[str] = set()
    for row in ALGORITHMS:
        for name in (row.name, *(name for group in row.controllers.values() for name in group)):
            found |= {name, name.replace("_", "-"), name.replace("-", "_")}
    return sorted(found, key=len, reverse=True)


# (file, name): the name means something else there.
OTHER_MEANINGS = {
    ("zwerm/link/session.py", "gossip"): "Zenoh's own name of a discovery protocol",
    ("world/faults/sensing/dead_beacon.py", "beacon"): "the light by which a robot is seen",
    ("world/sensors/__init__.py", "beacon"): "the light by which a robot is seen",
}


def named_algorithms(path: Path, text: str) -> list[str]:
    """Return the algorithm names in the text of a generic file."""
    pattern = re.compile(r"(?<![\w-])(" + "|".join(map(re.escape, algorithm_names())) + r")(?![\w-])")
    # An example in a command's help names a scenario that ships.
    found = set(pattern.findall("\n".join(line for line in text.splitlines() if "zwerm " not in line)))
    return sorted(name for name in found if (str(path), name) not in OTHER_MEANINGS)


def is_generic(path: Path) -> bool:
    """Return whether a file belongs to no algorithm: every file but those that bear a row's name, and the catalogue."""
    own = {row.name for row in ALGORITHMS}
    return path != Path("zwerm/catalogue.py") and not own & {part.removesuffix(".py") for part in path.parts}


def test_generic_code_names_no_algorithm() -> None:
    generic = [path for path in MODULES.values() if is_generic(path)]
    assert len(generic) > 100
    found = {str(path): named_algorithms(path, (ROOT / path).read_text(encoding="utf-8")) for path in generic}
    assert {path: names for path, names in found.items() if names} == {}


def test_a_generic_file_that_names_an_algorithm_is_found() -> None:
    assert named_algorithms(Path("zwerm/run/x.py"), "if name == 'sensor-coverage': pass") == ["sensor-coverage"]
    assert named_algorithms(Path("zwerm/run/x.py"), "from zwerm.world.metrics import voronoi_coverage") == [
        "voronoi_coverage"
    ]
    assert named_algorithms(Path("zwerm/run/x.py"), "dead_beacon, sensor_coverages, a beacons") == []
    assert is_generic(Path("world/metrics/cells.py"))
    assert not is_generic(Path("world/metrics/sensor_coverage.py"))


def foreign_imports(module: str, imported: set[str]) -> list[str]:
    """Return what a module of `world/metrics` imports of agents, but for the package that bears its name."""
    own = f"zwerm.agents.{module.rpartition('.')[2]}"
    agents = [each for each in sorted(imported) if each.startswith("zwerm.agents")]
    return [each for each in agents if each != own and not each.startswith(f"{own}.")]


def test_a_metric_imports_the_messages_of_its_own_algorithm_only() -> None:
    metrics = {name: imported for name, imported in GRAPH.items() if name.startswith("zwerm.world.metrics.")}
    assert len(metrics) > 5
    assert {name: found for name, imported in metrics.items() if (found := foreign_imports(name, imported))} == {}
    own = {"zwerm.agents.robot_teams.facts", "zwerm.world.scene"}
    assert foreign_imports("zwerm.world.metrics.robot_teams", own) == []
    assert foreign_imports("zwerm.world.metrics.sight", own) == ["zwerm.agents.robot_teams.facts"]


def classes_of(tree: ast.AST) -> list[str]:
    """Return the names of the classes of a file, those inside classes and functions too."""
    return [node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]


def test_no_two_classes_share_a_name() -> None:
    counts = Counter(
        name for path in MODULES.values() for name in classes_of(ast.parse((ROOT / path).read_text(encoding="utf-8")))
    )
    assert counts.total() > 400
    assert [name for name, count in counts.items() if count > 1] == []
    assert classes_of(ast.parse("class A:\n    class B: pass\nclass A: pass")) == ["A", "A", "B"]


def test_no_folder_has_more_than_fifteen_files() -> None:
    counts = Counter(str(path.parent) for path in MODULES.values() if path.name != "__init__.py")
    assert {folder: count for folder, count in counts.items() if count > FILES_MAX} == {}


def test_no_import_cycle_exists_also_not_for_types() -> None:
    assert cycles(GRAPH) == []
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]


def test_imports_inside_a_room_are_at_most_six_deep() -> None:
    @cache
    def depth(module: str) -> int:
        below = [each for each in GRAPH[module] if room_of(each) == room_of(module)]
        return 1 + max(map(depth, below), default=0)

    deepest: dict[str, int] = {}
    for module in MODULES:
        deepest[room_of(module)] = max(deepest.get(room_of(module), 0), depth(module))
    assert len(deepest) > 15
    assert {room: layers for room, layers in deepest.items() if layers > DEPTH_MAX} == {}


# Files that may share a name, with the reason.
SHARED_NAMES = {
    "__init__.py": "every package has one",
    "registry.py": "each kind of plug-in has one, in the kind's folder",
    "line_of_sight.py": "the file of a plug-in bears its kind: a sensor and a radio model",
}


def test_no_two_files_that_may_be_open_at_once_share_a_name() -> None:
    counts = Counter(path.name for path in MODULES.values())
    algorithms = {row.name + ".py" for row in ALGORITHMS}
    twice = {name for name, count in counts.items() if count > 1}
    assert twice - SHARED_NAMES.keys() - algorithms == set()
    assert SHARED_NAMES.keys() <= twice


def test_every_room_has_its_tests_in_the_folder_of_its_name() -> None:
    folders: set[str] = set()
    for path in MODULES.values():
        folder = path.parent.parts
        if folder[0] == "zwerm":
            folder = folder[1:]
        if folder and folder[0] not in ("world", "agents", "coordinator"):
            folders.add("/".join(folder[:2]) if folder[0] == "deploy" else folder[0])
        elif len(folder) > 1:
            folders.add("/".join(folder[:2]))
    assert len(folders) > 25
    assert [each for each in sorted(folders) if not list((ROOT / "tests" / each).glob("**/test_*.py"))] == []


def test_every_class_of_the_catalogue_exists() -> None:
    paths = [*controller_classes(), *(path for rows in plugins().values() for path in rows.values())]
    paths += [path for row in ALGORITHMS for path in (*row.metrics, *row.layers)]
    assert len(paths) > 50
    for path in paths:
        module, _, name = path.partition(":")
        assert hasattr(import_module(module), name), path


def test_every_scenario_and_study_that_ships_belongs_to_a_row() -> None:
    files = [*(ROOT / "scenarios").rglob("*.toml"), *(ROOT / "studies").rglob("*.toml")]
    assert len(files) > 30
    assert [str(path.relative_to(ROOT)) for path in files if row_of(path) is None] == []
