"""Scenarios: reading, the effect of an override, and the exact line for every kind of mistake."""

import subprocess
import sys
from pathlib import Path

import pytest

from zwerm.errors import ScenarioError
from zwerm.run.validation import scenario_mistakes
from zwerm.scenario.load import built_in, load, locate
from zwerm.scenario.overrides import _short
from zwerm.study.study_tables import load_study

GOOD = """
[arena]
size_m = [3, 2.5]
[robots]
count = 5
controller = "computation-free"
[[robots.sensors]]
kind = "line_of_sight"
range_m = 2.0
"""


def written(folder: Path, text: str, name: str = "trial.toml") -> str:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def mistakes_of(path: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load(path, overrides)
    assert str(caught.value) == "\n".join(caught.value.mistakes)
    places = [f"{path}: ", *(f"--set {_short(each)}: " for each in overrides)]
    assert all(line.startswith(tuple(places)) for line in caught.value.mistakes)
    return [line.removeprefix(place) for line in caught.value.mistakes for place in places if line.startswith(place)]


def test_a_scenario_is_named_after_its_file_and_its_paths_start_there(tmp_path: Path) -> None:
    scenario = load(written(tmp_path, GOOD, "Office_2.toml"))
    assert scenario.name == "Office_2"
    assert scenario.folder == tmp_path
    assert scenario.place == str(tmp_path / "Office_2.toml")
    assert scenario.arena.size_m == (3.0, 2.5)
    assert scenario.robots.sensors[0].kind == "line_of_sight"
    assert scenario.robots.sensors[0].parameters == {"range_m": 2.0}
    assert scenario.time.dt_s == 0.1


def test_a_scenario_cannot_be_changed_once_it_is_read(tmp_path: Path) -> None:
    scenario = load(written(tmp_path, GOOD))
    with pytest.raises(ValueError, match="frozen"):
        scenario.robots.count = 6


@pytest.mark.parametrize("name", sorted(built_in()))
def test_every_built_in_scenario_is_without_mistake_and_has_a_description(name: str) -> None:
    scenario = load(name)
    assert scenario.name == name
    assert scenario.summary


# --- mistakes, each with its exact line -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("assignment", "line"),
    [
        ('robots.count="25"', 'robots.count: expected an integer, got "25"'),
        ("robots.count=many", 'robots.count: expected an integer, got "many"'),
        ("robots.count=true", "robots.count: expected an integer, got true"),
        ("robots.count=2.0", "robots.count: expected an integer, got 2.0"),
        ("robots.count=0", "robots.count: expected >= 1, got 0"),
        ("robots.count=200000", "robots.count: expected <= 100000, got 200000"),
        ("robots.cuont=3", "robots.cuont: unknown key; did you mean count?"),
        ("robots.placement.radus_m=3", "robots.placement.radus_m: unknown key; did you mean radius_m?"),
        ("uplnk.loss=0.1", "uplnk: unknown key; did you mean uplink?"),
        ("robots.on_crash=explode", 'robots.on_crash: expected "fail" or "continue", got "explode"'),
        ("robots.body.radius_m=-0.1", "robots.body.radius_m: expected > 0, got -0.1"),
        ("robots.body.collide=1", "robots.body.collide: expected true or false, got 1"),
        ("robots.body=car", 'robots.body: expected a table, got "car"'),
        ("robots.parameters=3", "robots.parameters: expected a table, got 3"),
        ("robots.sensors=3", "robots.sensors: expected an array, got 3"),
        ("robots.sensors.0.kind=3", "robots.sensors.0.kind: expected a string, got 3"),
        ("robots.sensors=[{noise_rad=1}]", "robots.sensors.0.kind: required, and missing"),
        ("robots.placement.poses=[[1, 2]]", "robots.placement.poses.0: expected 3 items, got [1, 2]"),
        ("robots.placement.poses=[[1, 2, true]]", "robots.placement.poses.0.2: expected a number, got true"),
        ("time.dt_s=fast", 'time.dt_s: expected a number, got "fast"'),
        ("time.dt_s=true", "time.dt_s: expected a number, got true"),
        ("time.dt_s=inf", "time.dt_s: expected a finite number, got Infinity"),
        ("time.dt_s=2026-01-01", 'time.dt_s: expected a number, got "2026-01-01"'),
        ("arena.size_m=[3]", "arena.size_m: expected 2 items, got [3]"),
        ("arena.size_m=[]", "arena.size_m: expected 2 items, got []"),
        ("arena.size_m=[3, 3, 3]", "arena.size_m: expected 2 items, got [3, 3, 3]"),
        ("arena.size_m=3", "arena.size_m: expected an array, got 3"),
        ("arena.size_m=[3, nan]", "arena.size_m.1: expected a finite number, got NaN"),
        ("arena.walls=[[[0, 0]]]", "arena.walls.0: expected 2 items at least, got [[0, 0]]"),
        ("metrics.cells=[5, 0]", "metrics.cells.1: expected >= 1, got 0"),
        ("folder=elsewhere", "folder: unknown key"),
        ("summary=5", "summary: expected a string, got 5"),
        ("name=a b", "name: expected letters, digits, '.', '_' and '-', and no sign first, got \"a b\""),
        (
            "robots.entrance={every_s = 1, entry_m = [1, 0, 0, 1]}",
            "robots.entrance.entry_m: expected [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax, "
            "got [1, 0, 0, 1]",
        ),
        (f"robots.controller={list(range(99))}", None),
    ],
)
def test_a_mistake_is_one_line_with_its_place_the_rule_and_the_value(
    tmp_path: Path, assignment: str, line: str | None
) -> None:
    found = mistakes_of(written(tmp_path, GOOD), assignment)
    if line is None:
        line = f"robots.controller: expected a string, got {str(list(range(99)))[:60]}..."
    assert found == [line]


def test_every_mistake_of_a_file_is_reported_at_once(tmp_path: Path) -> None:
    text = "[time]\ndt_s = 0\nspeed = 1\n[robots]\ncount = -1\n[robots.body]\nmass_kg = 'heavy'\n"
    assert mistakes_of(written(tmp_path, text)) == [
        "time.dt_s: expected > 0, got 0",
        "time.speed: unknown key",
        "arena: required, and missing",
        "robots.count: expected >= 1, got -1",
        "robots.controller: required, and missing",
        'robots.body.mass_kg: expected a number, got "heavy"',
    ]


def test_a_file_that_is_not_toml_is_one_line(tmp_path: Path) -> None:
    (line,) = mistakes_of(written(tmp_path, "[arena\n"))
    assert line.startswith("not TOML: ")
    assert "line 1" in line
    path = tmp_path / "latin.toml"
    path.write_bytes(b'summary = "\xe9"\n')
    (line,) = mistakes_of(str(path))
    assert line.startswith("not TOML: ")


def test_an_unknown_scenario_is_one_line_with_the_known_ones() -> None:
    with pytest.raises(ScenarioError) as caught:
        locate("computation-fee")
    (line,) = caught.value.mistakes
    start = "computation-fee: expected a scenario file or the name of a built-in one; nearest are computation-free, "
    assert line.startswith(start)
    assert line.endswith("; `zwerm list` names all")
    assert line.count(", ") == 2
    with pytest.raises(ScenarioError) as caught:
        locate("computation-free-comparison")
    assert caught.value.mistakes == [
        "computation-free-comparison: is a study and no scenario; run it with: zwerm study computation-free-comparison"
    ]
    with pytest.raises(ScenarioError) as caught:
        locate("gone.toml")
    assert caught.value.mistakes == ["gone.toml: expected a scenario file or the name of a built-in one"]


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("meadow", "did you mean meadow.toml?"),
        ("maedow.toml", "nearest are meadow.toml"),
        ("meadow.tom", "nearest are meadow.toml"),
        ("{folder}/meadw.toml", "nearest are {folder}/meadow.toml"),
    ],
)
def test_a_misspelt_file_is_answered_with_the_files_of_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, hint: str
) -> None:
    (tmp_path / "meadow.toml").write_text(GOOD)
    (tmp_path / "other.toml").write_text(GOOD)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScenarioError) as caught:
        locate(name.format(folder=tmp_path))
    (line,) = caught.value.mistakes
    assert line.endswith(f"; {hint.format(folder=tmp_path)}")


def test_the_file_of_a_study_in_place_of_a_scenario_is_one_line_with_the_command(tmp_path: Path) -> None:
    path = written(tmp_path, 'scenario = "computation-free"\nseeds = 2\nmetrics = ["robots_in_arena"]\n')
    assert scenario_mistakes(path, ()) == [f"{path}: is a study and no scenario; run it with: zwerm study {path}"]
    scenario = written(tmp_path, GOOD)
    with pytest.raises(ScenarioError) as caught:
        load_study(str(scenario))
    assert caught.value.mistakes == [f"{scenario}: is a scenario and no study; run it with: zwerm run {scenario}"]


def test_a_mistake_of_an_override_names_the_command_line_and_another_names_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD + "cuont = 3\n")
    with pytest.raises(ScenarioError) as caught:
        load(path, ("robots.body.radius_m=0", "robots.count=-4"))
    assert caught.value.mistakes == [
        "--set robots.count=-4: robots.count: expected >= 1, got -4",
        "--set robots.body.radius_m=0: robots.body.radius_m: expected > 0, got 0",
    ]
    assert scenario_mistakes(path, ("robots.body.radius_m=0",)) == [
        "--set robots.body.radius_m=0: robots.body.radius_m: expected > 0, got 0",
        f"{path}: robots.sensors.0.cuont: unknown key",
    ]
    (line, other) = scenario_mistakes(path, ("robots.parameters={speed=1}",))
    assert line.startswith(
        "--set robots.parameters={speed=1}: robots.parameters.speed: unknown key; known are left_0, "
    )
    assert other == f"{path}: robots.sensors.0.cuont: unknown key"


# --- overrides ------------------------------------------------------------------------------------------------------


def test_an_override_is_toml_or_else_a_bare_string(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    scenario = load(
        path,
        (
            "robots.count=7",
            "robots.controller=my_file:Mine",
            'summary="quoted = text"',
            "robots.sensors.0.range_m=1.5",
            "robots.body.kind=holonomic",
            "radio={range_m = 2, anonymous = true}",
            " time.dt_s = 0.05",
        ),
    )
    assert scenario.robots.count == 7
    assert scenario.robots.controller == "my_file:Mine"
    assert scenario.summary == "quoted = text"
    assert scenario.robots.sensors[0].parameters == {"range_m": 1.5}
    assert scenario.robots.body.kind == "holonomic"
    assert scenario.radio is not None
    assert scenario.radio.anonymous
    assert scenario.time.dt_s == 0.05
    assert load(path).robots.count == 5


@pytest.mark.parametrize(
    ("assignment", "line"),
    [
        ("robots.count", "--set robots.count: expected path=value"),
        ("=3", "--set =3: expected path=value"),
        (
            "robots.sensors.1.kind=pose",
            "--set robots.sensors.1.kind=pose: robots.sensors.1: expected an index below 1, got 1",
        ),
        (
            "robots.sensors.first=pose",
            "--set robots.sensors.first=pose: robots.sensors.first: expected an index below 1, got first",
        ),
        (
            "robots.sensors.\u00b2.kind=pose",  # a digit that is no decimal
            "--set robots.sensors.\u00b2.kind=pose: robots.sensors.\u00b2: expected an index below 1, got \u00b2",
        ),
        ("arena.size_m.0.x=3", "--set arena.size_m.0.x=3: arena.size_m.0 is no table"),
        ("robots.count.x.y=3", "--set robots.count.x.y=3: robots.count.x is in no table"),
    ],
)
def test_an_override_that_leads_nowhere_is_one_line(tmp_path: Path, assignment: str, line: str) -> None:
    path = written(tmp_path, GOOD)
    with pytest.raises(ScenarioError) as caught:
        load(path, (assignment,))
    assert caught.value.mistakes == [line]


def test_the_scenario_is_read_without_the_world() -> None:
    heavy = "import sys, zwerm.scenario.tables; print([m for m in ('numpy', 'pymunk', 'shapely') if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", heavy], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
