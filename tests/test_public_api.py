"""The public API: the names in `zwerm`, a fast import, and no other import in the documentation."""

import ast
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support import ROOT

import zwerm

HEAVY = ("pydantic", "shapely", "pymunk", "zenoh", "scipy", "PIL", "matplotlib", "pandas", "zwerm.world")

# The modules besides `zwerm` that README and documentation import, with the reason.
DOCUMENTED: dict[str, str] = {
    "zwerm.scenario.types": "the types of parameters of plug-ins: NonNegative, Rectangle",
    "zwerm.agents.landmark_exploration.mapping.map_file": "reading and writing the map files of landmark exploration",
    "zwerm.world.faults.air": "the base class of faults of the radio",
    "zwerm.world.radio.network_rules": "the rules of the network of a twin",
}


def in_a_new_interpreter(code: str) -> str:
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.strip()


@pytest.mark.parametrize("name", zwerm.__all__)
def test_every_public_name_is_there_and_has_a_docstring(name: str) -> None:
    found = getattr(zwerm, name)
    assert name == "__version__" or inspect.getdoc(found)


def test_a_name_that_is_not_public_is_refused_as_of_any_module() -> None:
    with pytest.raises(AttributeError, match=r"^module 'zwerm' has no attribute 'nix'$"):
        zwerm.nix  # noqa: B018


def test_the_table_of_public_names_is_what_type_checkers_see() -> None:
    tree = ast.parse((ROOT / "zwerm/__init__.py").read_text())
    [guarded] = [node for node in tree.body if isinstance(node, ast.If)]
    typed = {
        alias.asname or alias.name for node in guarded.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert typed | {"__version__"} == set(zwerm.__all__)
    assert set(zwerm._HOMES) | {"run", "__version__"} == set(zwerm.__all__)


def test_a_controllers_imports_load_neither_the_world_nor_its_libraries() -> None:
    names = "Body, BodyVelocity, Command, Controller, Observation, Packet, Setup, Transmission, Wake, WheelSpeeds"
    code = f"import sys; from zwerm import {names}; print(*sys.modules)"
    loaded = in_a_new_interpreter(code).split()
    assert [name for name in loaded if name.startswith(HEAVY)] == []
    sensor = in_a_new_interpreter("import sys; from zwerm import Sensor; print(*sys.modules)").split()
    assert "shapely" in sensor, "the check can fail"


def test_run_can_be_called_by_its_public_name_however_it_was_imported() -> None:
    settings = "runner='inline', overrides=['robots.count=4']"
    code = (
        f"import zwerm; a = zwerm.run('gossip-max', {settings}); b = zwerm.run('gossip-max', {settings})\n"
        f"from zwerm import run; c = run('gossip-max', {settings})\n"
        f"import zwerm.run.runner as runner, pickle; d = pickle.loads(pickle.dumps(run))('gossip-max', {settings})\n"
        "print(len({each.trace for each in (a, b, c, d)}), zwerm.run is run)"
    )
    assert in_a_new_interpreter(code) == "1 True"
    assert list(inspect.signature(zwerm.run).parameters)[:3] == ["scenario", "seed", "runner"]


def imports(text: str) -> Iterator[str]:
    for block in re.findall(r"```python[^\n]*\n(.*?)```", text, flags=re.DOTALL):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Import):
                yield from (alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                yield node.module


PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_documentation_imports_the_public_module_only(page: Path) -> None:
    ours = {name for name in imports(page.read_text()) if name.split(".")[0] == "zwerm"}
    assert sorted(ours - {"zwerm"} - set(DOCUMENTED)) == []


def test_the_search_for_imports_in_documentation_finds_them() -> None:
    assert list(imports("text\n```python title='x.py'\nfrom zwerm.world import x\nimport os\n```\n")) == [
        "zwerm.world",
        "os",
    ]
