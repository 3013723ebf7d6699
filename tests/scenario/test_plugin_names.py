"""The search for the modules that a scenario names, and the error lines for unusable modules."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from zwerm.errors import ScenarioError
from zwerm.run.assembly import prepare
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.plugin_names import class_named

SCENARIO = """
time = {{ duration_s = 0.2 }}
arena = {{ size_m = [1.0, 1.0] }}
[robots]
count = 1
controller = "{controller}"
{more}
"""
CONTROLLER = """
from zwerm import Command, Controller
class Mine(Controller):
    sensors = {sensors}
    def step(self, observation):
        return Command(telemetry={{"place": {place}}})
"""


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working directory with a folder `project` below it; what tests import from there is forgotten after them."""
    (tmp_path / "project").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        del sys.modules[name]


def write(folder: Path, module: str, place: int = 0, sensors: tuple[str, ...] = (), more: str = "") -> str:
    (folder / f"{module}.py").write_text(CONTROLLER.format(place=place, sensors=sensors))
    path = folder / "scenario.toml"
    path.write_text(SCENARIO.format(controller=f"{module}:Mine", more=more))
    return str(path)


def mistakes_of(scenario: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        prepare(load(scenario, overrides))
    return [line.removeprefix(f"{scenario}: ") for line in caught.value.mistakes]


def test_a_module_is_looked_for_in_the_folder_of_the_scenario_first_and_then_in_the_working_directory(
    folders: Path,
) -> None:
    write(folders, "near_robot", place=1)
    scenario = write(folders / "project", "near_robot", place=2)
    assert run(scenario, runner="inline").metrics["telemetry.place"] == 2.0
    write(folders, "far_robot", place=3)
    assert (
        run(scenario, runner="inline", overrides=["robots.controller=far_robot:Mine"]).metrics["telemetry.place"] == 3
    )


def test_robot_processes_look_in_the_folder_of_the_scenario_too(folders: Path, nothing_left: None) -> None:
    scenario = write(folders / "project", "process_robot", place=4)
    assert run(scenario).metrics["telemetry.place"] == 4.0


def test_two_folders_with_modules_of_one_name_are_not_mixed_up(folders: Path) -> None:
    first = write(folders, "same_robot", place=1)
    second = write(folders / "project", "same_robot", place=2)
    assert run(first, runner="inline").metrics["telemetry.place"] == 1.0
    assert mistakes_of(second) == [
        f"robots.controller: module 'same_robot' was imported from {folders}/same_robot.py, and "
        f"{folders}/project/same_robot.py has the same name: rename one"
    ]


def test_a_missing_class_names_the_nearest_one_the_file_and_what_it_hides(folders: Path) -> None:
    write(folders, "hiding_robot")
    scenario = write(folders / "project", "hiding_robot")
    (line,) = mistakes_of(scenario, "robots.controller=hiding_robot:Mien")
    assert line == (
        "--set robots.controller=hiding_robot:Mien: robots.controller: module 'hiding_robot' has no class 'Mien'; "
        f"did you mean Mine?; it is {folders}/project/hiding_robot.py, which hides {folders}/hiding_robot.py"
    )


def test_a_folder_in_the_place_of_a_module_is_named(folders: Path) -> None:
    scenario = write(folders, "some_robot")
    (folders / "flock").mkdir()
    (line,) = mistakes_of(scenario, "robots.controller=flock:Flock")
    assert line.endswith(f"module 'flock' has no class 'Flock'; it is the folder {folders}/flock")


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("def f(:\n    pass\n", "cannot import 'bad_robot': SyntaxError: invalid syntax ({file}:1)"),
        ("\nx = 1 / 0\n", "cannot import 'bad_robot': division by zero (ZeroDivisionError, {file}:2)"),
        ("import nowhere_at_all\n", "cannot import 'bad_robot': No module named 'nowhere_at_all' ({file}:1)"),
    ],
)
def test_a_module_that_cannot_be_imported_is_one_line_with_the_place(folders: Path, text: str, rule: str) -> None:
    scenario = write(folders, "bad_robot")
    (folders / "bad_robot.py").write_text(text)
    assert mistakes_of(scenario) == [f"robots.controller: {rule.format(file=folders / 'bad_robot.py')}"]


@pytest.mark.parametrize("typed", ["good_robt", "good_robot.py", "./good_robot", "project/good_robot.py"])
def test_a_misspelt_module_is_answered_with_the_file_of_the_user(folders: Path, typed: str) -> None:
    scenario = write(folders, "good_robot")
    (folders / "good_robot.py").write_text("")
    (line,) = mistakes_of(scenario, f"robots.controller={typed}:Mine")
    assert line.startswith(f"--set robots.controller={typed}:Mine: robots.controller: cannot import '{typed}': ")
    assert line.endswith("; did you mean good_robot:Mine?")


def test_a_misspelt_built_in_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(ValueError, match=r"got 'touhc'; did you mean touch\?"):
        class_named("touhc", "sensor", ["pose", "touch"])


def test_a_controller_may_name_the_field_of_an_own_sensor(folders: Path) -> None:
    (folders / "crowd_sensor.py").write_text(
        "from zwerm import Sensor\nclass Crowd(Sensor):\n    field = 'crowd'\n"
        "    def __init__(self, parameters, surroundings): pass\n"
        "    def read(self, scene, robots): return [(1.0,) for _ in robots]\n"
    )
    scenario = write(folders, "crowd_robot", 5, ("crowd",), 'sensors = [{ kind = "crowd_sensor:Crowd" }]')
    assert run(scenario, runner="inline").metrics["telemetry.place"] == 5.0
    assert mistakes_of(scenario, "robots.sensors=[]") == [
        "--set robots.sensors=[]: robots.sensors: the controller crowd_robot:Mine needs the sensor 'crowd'"
    ]


def test_a_controller_of_the_program_itself_is_refused_in_processes_in_one_line(
    folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = write(folders, "main_robot", place=6)
    namespace: dict[str, object] = {}
    exec((folders / "main_robot.py").read_text(), namespace)
    monkeypatch.setattr(sys.modules["__main__"], "Mine", namespace["Mine"], raising=False)
    here = ["robots.controller=__main__:Mine"]
    assert run(scenario, runner="inline", overrides=here).metrics["telemetry.place"] == 6.0
    with pytest.raises(ScenarioError, match=r"^__main__:Mine: robot processes do not import the program itself: move"):
        run(scenario, overrides=here)


def test_an_unknown_runner_is_refused_in_one_line() -> None:
    with pytest.raises(ScenarioError) as caught:
        run("computation-free", runner="inlin")  # type: ignore[arg-type]
    assert caught.value.mistakes == ["runner: expected 'processes' or 'inline', got 'inlin'; did you mean inline?"]
