"""Comparisons: what the command line may say, that pairs share their luck, what the differences are, and what is shown."""

import io
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from scipy import stats
from support import ROOT, ZWERM

from zwerm.compare.comparison import METRICS, Comparison, _less, make_comparison
from zwerm.compare.comparison_figure import axis_label, check_figure, draw_comparison, label
from zwerm.compare.comparison_report import print_comparison, shown
from zwerm.compare.variants import parse_sweep, parse_variant
from zwerm.errors import PictureError, ScenarioError
from zwerm.maths.statistics import Sample
from zwerm.run.runner import run
from zwerm.study.plan import make_points
from zwerm.study.rows import read_rows
from zwerm.study.study_runner import run_study
from zwerm.study.summary import Results
from zwerm.study.tables import Study, load_study

# Ten robots in reach of each other, for two seconds; how often they speak is what the variants differ in.
GOSSIP = """
summary = "Ten robots agree"

[time]
dt_s = 0.1
duration_s = 2.0

[arena]
size_m = [2.0, 2.0]

[robots]
count = 10
controller = "gossip-max"
parameters = { done_at = 9 }

[radio]
range_m = 1.0
"""
VARIANTS = ["often", "seldom:robots.parameters.every_ticks=5"]


@pytest.fixture
def gossip(tmp_path: Path) -> Path:
    path = tmp_path / "talk.toml"
    path.write_text(GOSSIP)
    return path


def planned(gossip: Path, sweeps: tuple[str, ...] = ("radio.loss=0.0,0.5",), **options: Any) -> Study:
    return make_comparison(
        str(gossip), [parse_variant(each) for each in VARIANTS], [parse_sweep(each) for each in sweeps], **options
    )


# --- what the command line may say ----------------------------------------------------------------------------------


def test_a_variant_is_a_name_and_what_it_sets() -> None:
    assert parse_variant("central").set == []
    both = parse_variant("gradient:services.path=gradient, services.redundancy=link")
    assert (both.name, both.set) == ("gradient", ["services.path=gradient", "services.redundancy=link"])
    nested = parse_variant("a:arena.size_m=[1, 2],robots.body={kind='x', radius_m=1},name='a,b'")
    assert nested.set == ["arena.size_m=[1, 2]", "robots.body={kind='x', radius_m=1}", "name='a,b'"]


@pytest.mark.parametrize("text", ["", ":a=1", "name:", "name:a", "na/me", "name:a=1,b"])
def test_what_is_no_variant_is_one_line(text: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_variant(text)
    assert caught.value.mistakes == [f"--variant: expected NAME or NAME:PATH=VALUE,PATH=VALUE, got {text!r}"]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("radio.loss=0,0.1,...,0.4", [0.0, 0.1, 0.2, 0.3, 0.4]),
        ("robots.count=10,20,...,40", [10, 20, 30, 40]),
        ("radio.loss=0.9,0.6,...,0", [0.9, 0.6, 0.3, 0.0]),
        ("radio.loss=0,0.5", [0.0, 0.5]),
        ("services.path=coordinator,gradient", ["coordinator", "gradient"]),
        ("robots.body.collide=true,false", [True, False]),
    ],
)
def test_a_sweep_lists_its_values_or_counts_them(text: str, values: list[object]) -> None:
    sweep = parse_sweep(text)
    assert sweep.values == values
    assert {type(each) for each in sweep.values} == {type(values[0])}
    assert sweep.levels == {}


def test_a_sweep_of_tables_and_arrays_names_its_values() -> None:
    sweep = parse_sweep("a.models+b.models=none:[],bursts:[{kind='bursts', n=3}],[1, 2]")
    assert sweep.values == ["none", "bursts", "[1, 2]"]
    assert sweep.levels["bursts"] == ["a.models=[{kind='bursts', n=3}]", "b.models=[{kind='bursts', n=3}]"]
    assert sweep.levels["[1, 2]"] == ["a.models=[1, 2]", "b.models=[1, 2]"]


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("radio.loss", "expected PATH=VALUE,VALUE"),
        ("=1,2", "expected PATH=VALUE,VALUE"),
        ("radio.loss=", "expected PATH=VALUE,VALUE"),
        ("radio.loss=0,0.3,...,1", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=0,...,1", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=1,2,...,0", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=0,0,...,1", "expected FIRST,SECOND,...,LAST in even steps"),
        ("radio.loss=a,b,...,c", "expected FIRST,SECOND,...,LAST in even steps"),
    ],
)
def test_what_is_no_sweep_is_one_line(text: str, rule: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_sweep(text)
    assert caught.value.mistakes == [f"--sweep: {rule}, got {text!r}"]


def test_one_variant_is_nothing_to_compare() -> None:
    with pytest.raises(ScenarioError, match="variants: expected 2 at least to compare, got 0"):
        make_comparison("gossip-max")


def test_a_figure_has_a_kind_that_can_be_drawn() -> None:
    with pytest.raises(PictureError, match=r"figure.jpeg: expected a file that ends in .png or .pdf or .svg"):
        check_figure(Path("figure.jpeg"))


# --- points -----------------------------------------------------------------------------------------------------------


def test_an_axis_sets_one_path_or_several_or_what_its_values_are_levels_of(gossip: Path) -> None:
    sweeps = ("radio.loss+robots.sensors.0.false_negative=0.25,0.5", "models=none:[],late:[]")
    study = planned(gossip, sweeps, base=None)
    study.table.set.append("robots.sensors=[{kind='line_of_sight'}]")
    study.table.levels["models"] = {
        "none": [],
        "late": ["radio.models=[{kind='delay', delay_s=0.3}]", "robots.count=4"],
    }
    points = make_points(study)
    assert [point.label for point in points][:4] == [
        f"often, radio.loss+robots.sensors.0.false_negative={loss}, models={model}"
        for loss in (0.25, 0.5)
        for model in ("none", "late")
    ]
    last = points[-1].scenario
    assert last.radio is not None
    assert (last.radio.loss, last.robots.sensors[0].model_dump()["false_negative"]) == (0.5, 0.5)
    assert [each.model_dump()["delay_s"] for each in last.radio.models] == [0.3]
    assert (last.robots.count, points[2].scenario.robots.count) == (4, 10)


def test_variants_grid_and_settings_come_from_a_study_and_what_is_given_here_wins(tmp_path: Path, gossip: Path) -> None:
    (tmp_path / "ways.toml").write_text(
        'seeds = 7\nmetrics = ["delivered_fraction"]\nscenario = "none"\nset = ["robots.count=5"]\n'
        '[[variants]]\nname = "a"\n[[variants]]\nname = "b"\nset = ["radio.loss=0.1"]\n'
        '[grid]\nlag = ["none", "long"]\n"time.duration_s" = [1.0]\n'
        "[levels.lag]\nnone = []\nlong = [\"radio.models=[{kind='delay', delay_s=0.5}]\"]\n"
    )
    base = load_study(str(tmp_path / "ways.toml"))
    study = make_comparison(str(gossip), sweeps=[parse_sweep("time.duration_s=2.0,3.0")], base=base)
    assert list(study.table.grid) == ["time.duration_s", "lag"]
    assert (study.table.seeds, study.table.metrics) == (list(range(1, 8)), ["delivered_fraction"])
    assert [variant.name for variant in study.variants] == ["a", "b"]
    assert {point.scenario.robots.count for point in make_points(study)} == {5}
    assert make_comparison(str(gossip), metrics=["ticks"], base=base).table.metrics == ["ticks"]
    late = make_comparison(str(gossip), sweeps=[parse_sweep("lag=long")], base=base)
    assert [len(point.scenario.radio.models) for point in make_points(late) if point.scenario.radio] == [1, 1]
    with pytest.raises(ScenarioError, match="lag: unknown key"):
        make_points(make_comparison(str(gossip), sweeps=[parse_sweep("lag=longer")], base=base))


@pytest.mark.parametrize(
    ("levels", "mistake"),
    [
        ("[levels.other]\na = []", "levels.other: the grid has no such axis"),
        ("[levels.lag]\nnone = []", "levels.lag: expected what 'long' of the grid sets"),
    ],
)
def test_a_mistake_in_levels_is_one_line(tmp_path: Path, levels: str, mistake: str) -> None:
    text = 'scenario = "gossip-max"\nseeds = 1\nmetrics = ["delivered_fraction"]\n[grid]\nlag = ["none", "long"]\n'
    (tmp_path / "ways.toml").write_text(text + levels)
    with pytest.raises(ScenarioError, match=mistake):
        load_study(str(tmp_path / "ways.toml"))


# --- pairs ------------------------------------------------------------------------------------------------------------


def test_variants_of_one_seed_have_the_same_faults_at_random_and_the_same_places(gossip: Path) -> None:
    study = planned(gossip, ("random_faults.cut_per_h=36000.0",))
    study.table.set.append("random_faults.mean_s=0.2")
    often, seldom = make_points(study)
    one, other = (run(point.scenario, 3, "inline") for point in (often, seldom))
    assert one.trace != other.trace
    assert one.faults == other.faults != []
    assert (one.history.arrays().position[0] == other.history.arrays().position[0]).all()
    assert one.faults != run(often.scenario, 4, "inline").faults


def rows_of(study: Study, told: dict[str, list[dict[str, Any]]]) -> Comparison:
    """Return a comparison of made-up rows, by variant."""
    points = make_points(study)
    rows = [
        {"variant": point.variant, "fingerprint": point.fingerprint, "seed": seed, "reason": "", **row}
        for point in points
        for seed, row in enumerate(told[point.variant], start=1)
    ]
    return Comparison(Results(study, points, rows))


def test_a_difference_is_of_pairs_and_has_students_interval(gossip: Path) -> None:
    ours, theirs = [3.0, 5.0, 4.0, math.nan, 9.0], [2.5, 4.0, 4.25, 1.0]
    comparison = rows_of(
        planned(gossip, (), metrics=["cost"]),
        {
            "often": [{"outcome": "completed", "cost": each} for each in theirs],
            "seldom": [{"outcome": "completed", "cost": each} for each in ours],
        },
    )
    [place] = comparison.places
    found = comparison.difference(place, place.points[1], "cost")
    low, high = stats.ttest_rel(ours[:3], theirs[:3]).confidence_interval(0.95)
    assert found.n == 3
    assert (found.mean - found.half_width, found.mean + found.half_width) == pytest.approx((low, high))
    # Rounding is no difference: its interval would be as narrow as it is, and leave out zero.
    assert _less(0.1 + 0.2, 0.3) == 0.0
    # The means are of all that have a value, pairs or not.
    assert comparison.sample(place.points[1], "cost").n == 4


def test_a_run_that_failed_counts_with_what_it_measured_and_is_told_by_its_reason(gossip: Path) -> None:
    gave_up = "node 160 gave up: cut-off: no path leads to the frontier, 3 frontier edges left"
    crashed = "node {} crashed at tick 5: ValueError"
    comparison = rows_of(
        planned(gossip, (), metrics=["cost"]),
        {
            "often": [{"outcome": "completed", "cost": 1.0}, {"outcome": "time-limit", "cost": 2.0}],
            "seldom": [
                {"outcome": "failed", "reason": gave_up, "cost": 4.0},
                *({"outcome": "failed", "reason": crashed.format(node)} for node in (3, 12)),
            ],
        },
    )
    [place] = comparison.places
    assert comparison.outcomes(place.points[0]) == {"completed": 1, "time-limit": 1}
    assert comparison.outcomes(place.points[1]) == {
        "failed (cut-off)": 1,
        "failed (node N crashed at tick N: ValueError)": 2,
    }
    assert comparison.difference(place, place.points[1], "cost").mean == 3.0
    assert comparison.sample(place.points[0], "completed").mean == 0.5
    assert comparison.difference(place, place.points[1], "completed").mean == -0.5


def test_a_coordinators_crash_is_nothing_to_a_variant_without_one_which_is_run_once(tmp_path: Path) -> None:
    study = make_comparison(
        "sensor-coverage",
        [parse_variant("central"), parse_variant("decentralised:services.path=gradient")],
        [parse_sweep('faults=none:[],crash:[{kind="crash", nodes=["coordinator"], at_s=1.0}]')],
        metrics=["coverage_fraction"],
    )
    study.table.set.append("time.duration_s=2.0")
    result = run_study(study, tmp_path / "rows.parquet", seeds=[1, 2], jobs=1)
    assert result.planned == result.ran == result.done == 6
    comparison = Comparison(result.results)
    assert [dict(comparison.outcomes(each)) for place in comparison.places for each in place.points] == [
        {"time-limit": 2}
    ] * 4
    none, crash = comparison.places
    assert none.points[1].fingerprint == crash.points[1].fingerprint
    assert crash.points[0].scenario.faults
    assert comparison.difference(crash, crash.points[1], "coverage_fraction").n == 2


def test_what_nothing_measured_or_all_as_zero_is_left_out_unless_it_was_asked_for(gossip: Path) -> None:
    rows = [{"outcome": "completed", "coverage_fraction": 0.0, "robots_deployed": 3.0}]
    told = {"often": rows, "seldom": rows}
    assert rows_of(planned(gossip, ()), told).metrics == ["robots_deployed"]
    assert rows_of(planned(gossip, (), metrics=["coverage_fraction"]), told).metrics == ["coverage_fraction"]
    assert set(METRICS) > {"coverage_fraction", "robots_deployed"}


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((2, 0.98765, 0.1, 0.0123), "+0.9877 ± 0.0123"),
        ((2, 1234.5, 1.0, 6.0), "+1234 ± 6"),
        ((1, 12.345, math.nan, math.nan), "+12.35"),
        ((2, -0.00001, 0.1, 0.0), "+0.0000 ± 0.0000"),
        ((0, math.nan, math.nan, math.nan), "-"),
    ],
)
def test_a_mean_and_its_interval_have_the_same_digits(values: tuple[int, float, float, float], text: str) -> None:
    assert shown(Sample(*values), signed=True) == text


@pytest.mark.parametrize(
    ("metric", "words"),
    [
        ("messages_per_robot_mean", "messages per robot"),
        ("time_to_90_percent_coverage_s", "time to 90 % coverage [s]"),
        ("coverage_fraction", "coverage [fraction]"),
        ("completed", "runs completed [fraction]"),
        ("sim_s", "duration of the run [s]"),
    ],
)
def test_a_metric_on_an_axis_is_words_with_a_unit(metric: str, words: str) -> None:
    assert label(metric) == words


# --- whole comparisons --------------------------------------------------------------------------------------------


def test_a_sweep_of_loss_is_words_on_its_axis_and_any_other_is_its_path() -> None:
    assert axis_label("radio.loss+uplink.loss") == axis_label("radio.loss") == "messages lost [fraction]"
    assert axis_label("faults.0.at_s") == "faults.0.at_s"
    assert axis_label("") == ""


def test_a_comparison_goes_on_where_it_was_and_gives_in_processes_what_it_gives_inline(
    gossip: Path, tmp_path: Path
) -> None:
    study = planned(gossip, ("radio.loss=0.3",))
    inline = run_study(study, tmp_path / "inline.parquet", seeds=[1, 2], jobs=1)
    again = run_study(study, tmp_path / "inline.parquet", seeds=[1, 2, 3], jobs=1)
    assert (inline.ran, again.ran, again.done) == (4, 2, 6)
    run_study(study, tmp_path / "processes.parquet", seeds=[2], runner="processes")
    here, there = (
        {row["variant"]: row["trace"] for row in read_rows(tmp_path / f"{name}.parquet") if row["seed"] == 2}
        for name in ("inline", "processes")
    )
    assert here == there
    assert here["often"] != here["seldom"]


def test_there_is_one_figure_for_every_setting_of_the_further_sweeps(gossip: Path, tmp_path: Path) -> None:
    study = planned(gossip, ("radio.loss=0.0,0.5", "radio.range_m=0.8,1.0"))
    result = run_study(study, tmp_path / "out.parquet", seeds=[1, 2], jobs=1)
    for suffix, start in ((".png", b"\x89PNG"), (".pdf", b"%PDF")):
        drawn = draw_comparison(tmp_path / f"figure{suffix}", Comparison(result.results))
        assert [path.name for path in drawn] == [f"figure-radio.range_m={each}{suffix}" for each in (0.8, 1.0)]
        assert all(path.read_bytes().startswith(start) for path in drawn)


def test_a_line_goes_through_numbers_as_they_ascend_however_they_were_given(gossip: Path, tmp_path: Path) -> None:
    drawn = []
    for sweep in ("radio.loss=0.0,0.3,0.6", "radio.loss=0.3,0.6,0.0"):
        result = run_study(planned(gossip, (sweep,)), tmp_path / "out.parquet", seeds=[1], jobs=1)
        drawn += draw_comparison(tmp_path / f"{len(drawn)}.png", Comparison(result.results))
    assert drawn[0].read_bytes() == drawn[1].read_bytes()


@pytest.mark.parametrize("width", [80, 140])
def test_tables_are_readable_on_a_narrow_terminal_and_no_wider_than_it(
    gossip: Path, tmp_path: Path, width: int
) -> None:
    variants = [parse_variant(each) for each in ("as-it-is", "decentralised-seldom:robots.parameters.every_ticks=5")]
    sweeps = [parse_sweep("radio.loss+robots.body.radius_m=0.05,0.1"), parse_sweep("robots.parameters.done_at=9")]
    study = make_comparison(str(gossip), variants, sweeps, metrics=["messages_per_robot_mean"])
    comparison = Comparison(run_study(study, tmp_path / "out.parquet", seeds=[1, 2], jobs=1).results)
    console = Console(width=width, record=True, file=io.StringIO())
    print_comparison(console, comparison)
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= width
    words = [line.split() for line in lines]
    # Names are in one piece, or broken at their joints, and so are values.
    for name in ("radio.loss", "+robots.body.radius_m", "as-it-is", "decentralised-seldom"):
        assert sum(name in line for line in words) >= 2, name
    rows = [line for line in words if line[:1] in (["0.05"], ["0.1"])]
    assert {tuple(line[:2]) for line in rows} == {("0.05", "9"), ("0.1", "9")}
    assert sum(line.count("±") for line in rows) == 2 * 3, "two means and a difference at each of two places"


def zwerm(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "COLUMNS": "140", "HOME": str(cwd)}
    return subprocess.run(
        [sys.executable, *ZWERM, *arguments], cwd=cwd, env=environment, capture_output=True, text=True, timeout=120
    )


def test_the_command_prints_tables_draws_a_figure_and_with_json_one_object(gossip: Path, tmp_path: Path) -> None:
    command = ["compare", "talk.toml", "--seeds", "2", "--jobs", "1", "--sweep", "radio.loss=0.0,0.5"]
    command += [word for each in VARIANTS for word in ("--variant", each)]
    ran = zwerm(*command, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "seldom against often" in ran.stdout
    assert "how runs ended" in ran.stdout
    assert "seldom - often" in ran.stdout
    assert "8 of 8 trials, 8 of them run now: runs/compare-talk.parquet" in ran.stderr
    assert (tmp_path / "runs/compare-talk.png").read_bytes().startswith(b"\x89PNG")

    ran = zwerm(*command, "--json", cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (0, "")
    found = json.loads(ran.stdout)
    assert (found["planned"], found["done"], found["ran"]) == (8, 8, 0)
    assert found["variants"] == ["often", "seldom"]
    assert [(point["variant"], point["settings"]["radio.loss"]) for point in found["points"]] == [
        ("often", 0.0), ("seldom", 0.0), ("often", 0.5), ("seldom", 0.5),
    ]  # fmt: skip
    often, seldom = found["points"][:2]
    messages = "messages_per_robot_mean"
    difference = seldom["metrics"][messages]["mean"] - often["metrics"][messages]["mean"]
    assert seldom["differences"][messages]["mean"] == pytest.approx(difference)
    assert seldom["against"] == "often"
    assert sum(often["outcomes"].values()) == 2


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--variant", "a", "--variant", "b:radio.lost=1"], "compare: b: talk.toml: radio.lost: unknown key"),
        (["--variant", "a", "--variant", "b", "--sweep", "radio.loss=2"], "radio.loss: expected <= 1, got 2"),
        (["--variants", "nothing.toml"], "nothing.toml: expected a study's file or the name of a built-in one"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(gossip: Path, tmp_path: Path, arguments: list[str], line: str) -> None:
    ran = zwerm("compare", "talk.toml", *arguments, cwd=tmp_path)
    assert ran.returncode == 2
    assert line in ran.stderr
    assert len(ran.stderr.splitlines()) <= 2
    assert ran.stdout == ""


def test_a_study_too_is_one_json_object(gossip: Path, tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(
        'scenario = "talk.toml"\nseeds = 2\nmetrics = ["delivered_fraction", "nothing"]\n'
        "[[paper.points]]\nvalues = { delivered_fraction = { at_least = 0.01 } }\n"
    )
    ran = zwerm("study", "study.toml", "--jobs", "1", "--json", cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (0, "")
    [point] = json.loads(ran.stdout)["points"]
    assert point["metrics"]["delivered_fraction"]["n"] == 2
    assert point["metrics"]["delivered_fraction"]["paper_is_bound"] is True
    assert point["metrics"]["nothing"] == {"n": 0, "mean": None, "sd": None, "half_width": None}
