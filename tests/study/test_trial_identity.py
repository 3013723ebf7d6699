"""The identity of a trial: a change of any code that it runs makes it run again, and nothing else does."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support import FONT_CACHE, ROOT, scenario

from zwerm.scenario.tables import Scenario
from zwerm.scenario.user_modules import find_user_modules, spec_of
from zwerm.study import trial_identity
from zwerm.study.rows import read_rows
from zwerm.study.trial_identity import Identities, LoadedModules, still_same, zwerm_identity

CONTROLLER = """
from zwerm import Command, Controller, WheelSpeeds
{imports}
class C(Controller):
    def step(self, observation):
        {body}
        return Command(drive=WheelSpeeds(speed(), 0.05))
"""
HELPER = "def speed():\n    return {speed}\n"
STUDY = """
scenario = "s.toml"
seeds = 2
metrics = ["cell_coverage_fraction"]
"""
SCENARIO = """
time = {{ duration_s = 1.0 }}
arena = {{ size_m = [1.0, 1.0] }}
robots = {{ count = 2, controller = "ident_robot:C" }}
metrics = {{ cells = [2, 2] }}
{more}
"""


def write(folder: Path, imports: str = "from ident_helper import speed", body: str = "", more: str = "") -> None:
    (folder / "study.toml").write_text(STUDY)
    (folder / "s.toml").write_text(SCENARIO.format(more=more))
    (folder / "ident_robot.py").write_text(CONTROLLER.format(imports=imports, body=body or "pass"))
    (folder / "ident_helper.py").write_text(HELPER.format(speed=0.02))


def run_study(folder: Path, *options: str) -> str:
    """Run the study in a process of its own, and return the line that counts trials and those after it."""
    command = "import sys; sys.path.insert(0, '.'); from zwerm.cli.app import main; main()"
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "COLUMNS": "120", "MPLCONFIGDIR": FONT_CACHE}
    done = subprocess.run(
        [sys.executable, "-c", command, "study", "study.toml", "--jobs", "1", *options],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


def ran(text: str) -> int:
    return int(text.partition(" of them run now")[0].rpartition(" ")[2])


def test_a_study_runs_again_what_an_edited_helper_of_a_controller_decides(tmp_path: Path) -> None:
    write(tmp_path)
    assert ran(run_study(tmp_path)) == 2
    before = {row["seed"]: row["trace"] for row in read_rows(tmp_path / "runs" / "study.parquet")}
    assert ran(run_study(tmp_path)) == 0
    (tmp_path / "ident_helper.py").write_text(HELPER.format(speed=0.077))
    assert ran(run_study(tmp_path)) == 2
    after = {row["seed"]: row["trace"] for row in read_rows(tmp_path / "runs" / "study.parquet")}
    assert before.keys() == after.keys()
    assert all(before[seed] != after[seed] for seed in before)


def test_a_module_that_is_imported_by_a_computed_name_is_recorded_and_checked(tmp_path: Path) -> None:
    write(tmp_path, "import importlib", "speed = importlib.import_module('ident_' + 'helper').speed")
    assert ran(run_study(tmp_path)) == 2
    rows = read_rows(tmp_path / "runs" / "study.parquet")
    assert all('"ident_helper"' in row["modules"] for row in rows)
    assert ran(run_study(tmp_path)) == 0
    (tmp_path / "ident_helper.py").write_text(HELPER.format(speed=0.077))
    assert ran(run_study(tmp_path)) == 2


def test_code_that_cannot_be_known_is_named_and_runs_again(tmp_path: Path) -> None:
    write(tmp_path, "exec(open('ident_helper.py').read())")
    for _ in range(2):
        text = run_study(tmp_path)
        assert ran(text) == 2
        assert "its rows are not used again: module 'ident_robot' runs code by exec, line 3" in text


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.syspath_prepend(tmp_path)
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        del sys.modules[name]


def named(found: object) -> list[str]:
    return [each.module for each in found.files]  # type: ignore[attr-defined]


def test_imports_are_followed_without_importing(folder: Path) -> None:
    (folder / "deep_package").mkdir()
    (folder / "deep_package" / "__init__.py").write_text("raise AssertionError")
    (folder / "deep_package" / "part.py").write_text(
        "from . import other\nfrom .other import THING\nimport numpy.linalg"
    )
    (folder / "deep_package" / "other.py").write_text("import json, tomllib\nimport no_such_module\nTHING = 1")
    (folder / "deep_robot.py").write_text("def f():\n    import deep_package.part\n")
    (folder / "deep_stranger.py").write_text("")
    found = find_user_modules(["deep_robot"])
    assert named(found) == ["deep_package", "deep_package.other", "deep_package.part", "deep_robot"]
    assert [each.partition(" ")[0] for each in found.versions] == ["numpy"]
    assert (found.unknown, found.dynamic) == ((), ())
    assert not {"deep_package", "deep_robot"} & set(sys.modules)
    assert spec_of("deep_package.nothing") is None
    assert spec_of("no_such_module.nothing") is None


def test_a_scenario_names_modules_in_values_and_in_keys(folder: Path) -> None:
    for name in ("key_robot", "key_fault", "key_model"):
        (folder / f"{name}.py").write_text("")
    tables = scenario(
        robots={"count": 1, "controller": "key_robot:C", "parameters": {"note": "key robot: no module"}},
        radio={"models": [{"kind": "key_model:M"}]},
        random_faults={"key_fault:F_per_h": 1.0},
    )
    assert named(Identities().modules(tables, "inline")) == ["key_fault", "key_model", "key_robot"]


def test_a_computed_import_in_robot_processes_cannot_be_known(folder: Path) -> None:
    (folder / "far_robot.py").write_text("name = 'far_helper'\n__import__(name)\n")
    tables = scenario(robots={"count": 1, "controller": "far_robot:C"})
    assert Identities().modules(tables, "inline").unknown == ()
    unknown = Identities().modules(tables, "processes").unknown
    assert unknown == ("module 'far_robot' imports by a name that it computes",)


def test_a_module_that_changes_under_a_running_study_is_noticed(folder: Path) -> None:
    file = folder / "live_robot.py"
    file.write_text("A = 1")
    planned = Identities().modules(scenario(robots={"count": 1, "controller": "live_robot:C"}), "inline")
    trial = LoadedModules(planned)
    assert trial.changed() == ""
    file.write_text("A = 22")
    assert trial.changed() == str(file)
    assert LoadedModules(planned).changed() == str(file)


def test_a_module_that_was_imported_before_its_file_changed_is_unknown(folder: Path) -> None:
    file = folder / "old_robot.py"
    file.write_text("A = 1")
    __import__("old_robot")
    tables = scenario(robots={"count": 1, "controller": "old_robot:C"})
    assert Identities().modules(tables, "inline").unknown == ()
    file.write_text("A = 22")
    assert Identities().modules(tables, "inline").unknown == (f"{file} changed after it was imported",)


def fingerprint(tables: Scenario) -> str:
    found = Identities()
    return found.fingerprint(tables, b"", found.modules(tables, "inline"))


def test_versions_of_libraries_and_the_code_of_zwerm_are_part_of_the_identity(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = scenario()
    before = fingerprint(tables)
    assert before == fingerprint(tables)
    with monkeypatch.context() as patch:
        patch.setattr(trial_identity, "library_versions", lambda: ("numpy 0.1",))
        assert fingerprint(tables) != before
    with monkeypatch.context() as patch:
        patch.setattr(trial_identity, "__version__", "9.9.9")
        assert fingerprint(tables) != before
    with monkeypatch.context() as patch:
        patch.setattr(trial_identity, "_code_digest", lambda rows: "other")
        assert fingerprint(tables) != before
    assert fingerprint(tables) == before


def test_the_code_of_another_algorithm_is_not_part_of_the_identity() -> None:
    other = scenario(robots={"controller": "gossip-max"}, radio={})
    assert zwerm_identity(scenario()) == zwerm_identity(scenario(time={"duration_s": 9.0})) != zwerm_identity(other)


def test_recorded_modules_are_the_same_only_while_their_files_are(folder: Path) -> None:
    (folder / "row_helper.py").write_text("A = 1")
    (source,) = find_user_modules(["row_helper"]).files
    recorded = f'{{"row_helper": "{source.digest}"}}'
    assert still_same("")
    assert still_same(recorded)
    (folder / "row_helper.py").write_text("A = 2")
    assert not still_same(recorded)
    (folder / "row_helper.py").unlink()
    assert not still_same(recorded)
