"""Studies: what a file may say, what is run of it, what is kept, what it comes to, and that nothing is left running."""

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from scipy import stats
from support import until

from zwerm.errors import ScenarioError
from zwerm.maths.statistics import Sample, condense, half_width
from zwerm.run.runner import run
from zwerm.study.plan import make_points, make_trials
from zwerm.study.rows import Rows, read_rows
from zwerm.study.study_figure import draw_study
from zwerm.study.study_runner import StudyResult, run_study
from zwerm.study.summary import SummaryLine
from zwerm.study.tables import Published, Study, built_in, load_study, parse_seeds

ROOT = Path(__file__).parents[2]
DEADLINE_S = 60.0

SCENARIO = """
[time]
dt_s = 0.1
duration_s = 2.0

[arena]
size_m = [1.0, 1.0]

[robots]
count = 2
controller = "{controller}"

[robots.body]
kind = "differential"

[metrics]
cells = [2, 2]
"""

# A robot's stream differs with the seed, so that a trial can be told to go wrong by it.
CONTROLLERS = """
import os, time
from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command, WheelSpeeds

class Drive(Controller):
    def step(self, observation):
        return Command(drive=WheelSpeeds(self.random.uniform(0, 0.1), self.random.uniform(0, 0.1)))

def unlucky(controller):
    return controller.setup.node == 0 and controller.random.random() < 0.4

class Raises(Drive):
    def step(self, observation):
        if observation.tick == 3 and unlucky(self):
            raise ValueError("no luck")
        return super().step(observation)

class Dies(Drive):
    def step(self, observation):
        if observation.tick == 3 and unlucky(self):
            os._exit(41)
        return super().step(observation)

class Slow(Drive):
    def step(self, observation):
        time.sleep(0.02)
        return super().step(observation)
"""


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Study]]:
    """Return a function that writes a study of a tiny scenario and loads it."""
    (tmp_path / "study_robots.py").write_text(CONTROLLERS)
    monkeypatch.syspath_prepend(tmp_path)

    def make(text: str, controller: str = "Drive", name: str = "tiny") -> Study:
        (tmp_path / "tiny-scenario.toml").write_text(SCENARIO.format(controller=f"study_robots:{controller}"))
        file = tmp_path / f"{name}.toml"
        file.write_text(text)
        return load_study(str(file))

    yield make
    sys.modules.pop("study_robots", None)


COVERING = """
name = "covering"
scenario = "voronoi-coverage-table1"
set = ["time.duration_s=1.0"]
seeds = 2
metrics = ["density_ring_01"]
"""
TINY = """
scenario = "tiny-scenario.toml"
seeds = 3
metrics = ["cell_coverage_fraction"]
"""
GRID = TINY + "[grid]\n'robots.count' = [1, 4]\n"


def without_wall_time(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: value for name, value in row.items() if name != "wall_s"} for row in rows]


def run_here(study: Study, out: Path, **options: Any) -> StudyResult:
    return run_study(study, out, jobs=1, **options)


# --- what a file may say --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ("seeds = 1\nmetrics = ['m']", "scenario: required, and missing"),
        (TINY + "sceds = 3", "sceds: unknown key"),
        (
            TINY.replace("seeds = 3", "seeds = 0"),
            "seeds: expected a count >= 1, an array of seeds, or first and last, got 0",
        ),
        (TINY.replace("seeds = 3", "seeds = [1, 1]"), "seeds: expected seeds that differ, and 1 at least, got [1, 1]"),
        (TINY.replace("seeds = 3", "seeds = true"), "seeds: expected an array, got true"),
        (TINY + "[grid]\n'robots.count' = []", "grid.robots.count: expected 1 value at least, got []"),
        (
            TINY + "[grid]\n'robots.count' = [1, 'a']",
            'grid.robots.count: expected an array of numbers, of strings or of booleans, got [1, "a"]',
        ),
        (TINY + "[grid]\nseed = [1]", "grid.seed: the results have a column of that name"),
        (
            TINY + "[[variants]]\nname = 'a'\n[[variants]]\nname = 'a'",
            "variants: expected different names, got 'a' 2 times",
        ),
        (TINY + "[[variants]]\nname = 'a'\naxes = { p = 'x' }", "variants.0.axes.p: the grid has no such axis"),
        (
            GRID + "[[paper.points]]\nat = { 'robots.count' = 2 }\nvalues = { cell_coverage_fraction = 1 }",
            "paper.points.0.at.robots.count: the grid has no such value, got 2",
        ),
        (
            GRID + "[[paper.points]]\nvalues = { cell_coverage = 1 }",
            "paper.points.0.values.cell_coverage: the study reports no such metric",
        ),
        (
            GRID + "[[paper.points]]\nvalues = { cell_coverage_fraction = { tolerance = 1 } }",
            "paper.points.0.values.cell_coverage_fraction: expected a number, or a table with either value or at_least",
        ),
    ],
)
def test_a_mistake_in_a_study_is_one_line(write: Callable[..., Study], tmp_path: Path, text: str, mistake: str) -> None:
    with pytest.raises(ScenarioError) as raised:
        write(text)
    assert raised.value.mistakes == [f"{tmp_path / 'tiny.toml'}: {mistake}"]


def test_a_mistake_in_a_scenario_names_the_point_of_the_grid_once(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(TINY + "[grid]\n'robots.count' = [4, -1]\n'time.dt_s' = [0.1, 0.2]")
    with pytest.raises(ScenarioError) as raised:
        make_points(study)
    place = f"{tmp_path / 'tiny.toml'}: robots.count=-1, time.dt_s=0.1: {tmp_path / 'tiny-scenario.toml'}"
    assert raised.value.mistakes == [f"{place}: robots.count: expected >= 1, got -1"]


def test_an_unknown_study_is_one_line_with_those_that_are_known() -> None:
    with pytest.raises(
        ScenarioError, match=r"^nope: expected a study's file .* built in are computation-free-comparison,"
    ):
        load_study("nope")


def test_seeds_are_a_count_a_list_or_a_range(write: Callable[..., Study]) -> None:
    assert write(TINY).table.seeds == [1, 2, 3]
    assert write(TINY.replace("seeds = 3", "seeds = [7, 0]")).table.seeds == [7, 0]
    assert write(TINY.replace("seeds = 3", "seeds = { first = 5, last = 7 }")).table.seeds == [5, 6, 7]
    assert parse_seeds("2") == [1, 2]
    assert parse_seeds("10-12") == [10, 11, 12]
    for text in ("0", "-1", "3-2", "x", ""):
        with pytest.raises(ScenarioError, match="expected a count, or FIRST-LAST"):
            parse_seeds(text)


def test_every_variant_is_run_at_every_point_with_every_seed(write: Callable[..., Study]) -> None:
    study = write(
        TINY
        + "set = ['time.duration_s=3']\n[grid]\nn = [1, 4]\n'time.dt_s' = [0.1, 1]\n"
        + "[[variants]]\nname = 'a'\naxes = { n = 'robots.count' }\n"
        + "[[variants]]\nname = 'b'\naxes = { n = 'robots.body.substeps' }\nset = ['robots.count=3', 'time.duration_s=4']\n"
    )
    points = make_points(study)
    found = [
        (
            p.variant,
            *p.settings.values(),
            p.scenario.robots.count,
            p.scenario.robots.body.substeps,
            p.scenario.time.dt_s,
        )
        for p in points
    ]
    assert found == [
        *(("a", 1, 0.1, 1, 10, 0.1), ("a", 1, 1.0, 1, 10, 1.0), ("a", 4, 0.1, 4, 10, 0.1), ("a", 4, 1.0, 4, 10, 1.0)),
        *(("b", 1, 0.1, 3, 1, 0.1), ("b", 1, 1.0, 3, 1, 1.0), ("b", 4, 0.1, 3, 4, 0.1), ("b", 4, 1.0, 3, 4, 1.0)),
    ]
    assert [point.scenario.time.duration_s for point in points] == [3.0] * 4 + [4.0] * 4
    trials = make_trials(study, points, study.table.seeds)
    assert [trial.seed for trial in trials] == [1] * 8 + [2] * 8 + [3] * 8
    assert len({trial.key for trial in trials}) == 24


@pytest.mark.parametrize(
    ("name", "trials"),
    [
        ("computation-free-comparison", 4 * 1000),
        ("computation-free-corridor", 1000),
        ("computation-free-heatmap", 1000),
        ("computation-free-maze", 4 * 10),
        ("computation-free-noise", 3 * 11 * 100),
        ("computation-free-scaling", 20 * 100),
        ("computation-free-shapes", 3 * 1000),
    ],
)
def test_a_study_of_the_computation_free_swarm_is_as_large_as_the_papers(name: str, trials: int) -> None:
    study = load_study(name)
    points = make_points(study)
    assert len(make_trials(study, points, study.table.seeds)) == trials
    seconds = {point.scenario.time.duration_s for point in points}
    assert seconds <= {120.0, 240.0, 600.0, 3600.0}


@pytest.mark.parametrize("name", sorted(built_in()))
def test_a_built_in_study_is_ready_to_run(name: str) -> None:
    study = load_study(name)
    assert make_points(study)
    assert study.table.summary
    assert study.table.source


# --- what is run, and kept ------------------------------------------------------------------------------------------


def test_a_row_is_what_the_run_of_that_seed_gives(write: Callable[..., Study], tmp_path: Path) -> None:
    result = run_here(write(GRID), tmp_path / "out.parquet")
    assert (result.planned, result.ran, result.done, result.failed, result.interrupted) == (6, 6, 6, 0, False)
    rows = read_rows(tmp_path / "out.parquet")
    assert [(row["robots.count"], row["seed"]) for row in rows] == [(n, seed) for n in (1, 4) for seed in (1, 2, 3)]
    same = run(tmp_path / "tiny-scenario.toml", 2, "inline", ["robots.count=4"])
    row = rows[4]
    assert row["trace"] == same.trace
    assert row["outcome"] == "time-limit"
    assert row["ticks"] == 20
    assert row["cell_coverage_fraction"] == same.metrics["cell_coverage_fraction"]
    assert same.cell_counts is not None
    assert row["cell_counts"] == same.cell_counts.ravel().tolist()
    assert rows[0]["trace"] != rows[1]["trace"]


def test_a_study_goes_on_where_it_was_and_runs_nothing_twice(write: Callable[..., Study], tmp_path: Path) -> None:
    out, study = tmp_path / "out.parquet", write(GRID)
    assert run_here(study, out, seeds=[1, 2]).ran == 4
    before = read_rows(out)
    assert run_here(study, out).ran == 2
    assert [row for row in read_rows(out) if row["seed"] < 3] == before
    assert run_here(study, out).ran == 0
    fewer = run_here(study, out, seeds=[2])
    assert (fewer.ran, fewer.done, len(read_rows(out))) == (0, 2, 6)


def test_rows_of_a_scenario_that_has_changed_are_run_again_and_replaced(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    out = tmp_path / "out.parquet"
    run_here(write(GRID), out)
    before = {row["fingerprint"] for row in read_rows(out)}
    changed = run_here(write(GRID), out, sets=["time.duration_s=1"])
    rows = read_rows(out)
    assert (changed.ran, len(rows)) == (6, 6)
    assert {row["ticks"] for row in rows} == {10}
    assert not before & {row["fingerprint"] for row in rows}
    # The words in a scenario decide nothing.
    assert run_here(write(GRID), out, sets=["time.duration_s=1", "summary=other words"]).ran == 0
    # The controller's code does.
    file = tmp_path / "study_robots.py"
    file.write_text(file.read_text() + "\n# changed\n")
    assert run_here(write(GRID), out, sets=["time.duration_s=1"]).ran == 6


def test_a_row_is_safe_as_soon_as_its_trial_has_ended(write: Callable[..., Study], tmp_path: Path) -> None:
    out, study = tmp_path / "out.parquet", write(TINY)

    class Stop:
        left = 2

        def begin(self, total: int) -> None:
            assert total == 3

        def ended(self, failed: bool) -> None:
            self.left -= 1
            if not self.left:
                raise MemoryError

    with pytest.raises(MemoryError):
        run_here(study, out, watcher=Stop())
    journal = tmp_path / "out.parquet.journal"
    assert not out.exists()
    with journal.open("ab") as file:
        file.write(b'{"study":"tiny","variant":"","se')
    assert run_here(study, out).ran == 1
    assert len(read_rows(out)) == 3
    assert not journal.exists()


def test_two_studies_do_not_write_to_one_file(tmp_path: Path) -> None:
    with Rows(tmp_path / "out.parquet"), pytest.raises(ScenarioError, match="another study is writing to it"):
        Rows(tmp_path / "out.parquet")
    with Rows(tmp_path / "out.parquet"):
        pass


def test_a_file_of_something_else_is_left_alone(write: Callable[..., Study], tmp_path: Path) -> None:
    out = tmp_path / "notes.parquet"
    out.write_text("my notes")
    with pytest.raises(ScenarioError, match="expected a Parquet file of a study's results"):
        run_here(write(TINY), out)
    assert out.read_text() == "my notes"


def test_a_file_that_cannot_be_written_is_one_line(write: Callable[..., Study], tmp_path: Path) -> None:
    out = tmp_path / "tiny-scenario.toml" / "out.parquet"
    study = write(TINY)
    with pytest.raises(ScenarioError) as raised:
        run_here(study, out)
    assert raised.value.mistakes[0].startswith(f"{out}: cannot be written: ")


def test_a_file_that_the_scenario_names_is_part_of_what_a_row_stands_for(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    study = write(TINY)
    (tmp_path / "hall.geojson").write_text('{"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 1], [0, 0]]]}')
    text = (tmp_path / "tiny-scenario.toml").read_text().replace("size_m = [1.0, 1.0]", 'geojson = "hall.geojson"')
    (tmp_path / "tiny-scenario.toml").write_text(text)
    (before,) = make_points(study)
    (same,) = make_points(study)
    (tmp_path / "hall.geojson").write_text('{"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 2], [0, 0]]]}')
    (after,) = make_points(study)
    assert before.fingerprint == same.fingerprint != after.fingerprint


def test_a_trial_that_fails_is_a_row_with_its_reason(write: Callable[..., Study], tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    study = write(TINY.replace("seeds = 3", "seeds = 8"), "Raises")
    result = run_here(study, out)
    rows = read_rows(out)
    failed = [row for row in rows if row["outcome"] == "failed"]
    assert len(rows) == 8
    assert 0 < len(failed) < 8
    assert {row["reason"] for row in failed} == {"node 0 crashed at tick 3: ValueError: no luck"}
    assert result.failed == len(failed)
    assert result.results.lines()[0].sample.n == 8 - len(failed)
    assert run_here(study, out).ran == 0
    assert run_here(study, out, retry=True).ran == len(failed)


def test_a_placement_that_finds_no_room_fails_its_trial_only(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(TINY + "[grid]\n'robots.count' = [2, 300]")
    result = run_here(study, tmp_path / "out.parquet")
    outcomes = {(row["robots.count"], row["outcome"]) for row in read_rows(result.path)}
    assert outcomes == {(2, "time-limit"), (300, "failed")}


def test_a_process_that_dies_takes_its_own_trial_only(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(TINY.replace("seeds = 3", "seeds = 6"), "Dies")
    result = run_study(study, tmp_path / "dies.parquet", jobs=2)
    rows = read_rows(result.path)
    died = [row["seed"] for row in rows if row["outcome"] == "failed"]
    assert all("its process died" in row["reason"] for row in rows if row["seed"] in died)

    raises = run_here(write(TINY.replace("seeds = 3", "seeds = 6"), "Raises"), tmp_path / "raises.parquet")
    assert died == [row["seed"] for row in read_rows(raises.path) if row["outcome"] == "failed"]
    # In processes or not: the same rows.
    keep = ("seed", "cell_coverage_fraction", "trace", "ticks")
    there, here = (
        [{k: r[k] for k in keep} for r in read_rows(p) if "trace" in r and r["outcome"] != "failed"]
        for p in (result.path, raises.path)
    )
    assert there == here
    assert len(there) == 6 - len(died) > 0


def test_counts_of_robots_are_sampled_over_time(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(
        TINY.replace("seeds = 3", "seeds = 1")
        + "series = ['robots_in_arena', 'robots_entered']\n"
        + "set = ['robots.count=5', 'robots.inflow.every_s=0.5', 'robots.inflow.entry_m=[0, 0, 1, 1]']\n"
    )
    (row,) = read_rows(run_here(study, tmp_path / "out.parquet").path)
    assert len(row["series_time_s"]) == 121
    assert row["series_time_s"][0] == 0.0
    assert row["series_time_s"][-1] == 2.0
    assert row["robots_in_arena_series"] == row["robots_entered_series"]
    at = dict(zip(row["series_time_s"], row["robots_entered_series"], strict=True))
    assert [at[t] for t in (0.0, 0.45, 0.55, 1.05, 2.0)] == [1, 1, 2, 3, 5]


# --- what it comes to -----------------------------------------------------------------------------------------------


def test_a_mean_has_students_interval() -> None:
    values = [0.5, 0.75, 0.25, 0.9, 0.6]
    n, mean, sd, half = condense(values)
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert (n, mean, sd) == (5, pytest.approx(0.6), pytest.approx(stats.tstd(values)))
    assert (mean - half, mean + half) == (pytest.approx(low), pytest.approx(high))
    assert condense([3.0])[:2] == (1, 3.0)
    assert math.isnan(condense([3.0]).half_width)
    assert condense([]).n == 0
    assert half_width(1.0, 50, 50) == pytest.approx(math.sqrt(2) * half_width(1.0, 50))


@pytest.mark.parametrize(
    ("sample", "published", "trials", "agrees"),
    [
        (Sample(100, 0.50, 0.1, math.nan), Published(value=0.515, tolerance=0.0), None, True),
        (Sample(100, 0.50, 0.1, math.nan), Published(value=0.525, tolerance=0.0), None, False),
        (Sample(100, 0.50, 0.1, math.nan), Published(value=0.525, tolerance=0.01), None, True),
        (Sample(100, 0.50, 0.1, math.nan), Published(value=0.525, tolerance=0.0), 100, True),
        (Sample(100, 0.50, 0.1, math.nan), Published(value=0.53, tolerance=0.0), 100, False),
        (Sample(100, 0.50, 0.1, math.nan), Published(at_least=0.3, tolerance=0.0), None, True),
        (Sample(100, 0.50, 0.1, math.nan), Published(at_least=0.515, tolerance=0.0), None, True),
        (Sample(100, 0.50, 0.1, math.nan), Published(at_least=0.525, tolerance=0.0), None, False),
        (condense([0.5]), Published(value=0.9, tolerance=0.0), None, None),
        (condense([]), Published(value=0.9, tolerance=0.0), None, None),
        (condense([0.5, 0.6]), None, None, None),
    ],
)
def test_the_papers_value_is_met_within_the_interval_and_the_tolerance(
    sample: Sample, published: Published | None, trials: int | None, agrees: bool | None
) -> None:
    assert SummaryLine("", {}, "m", sample, published, trials).agrees is agrees


def test_a_papers_values_find_their_points(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(
        GRID
        + "[[variants]]\nname = 'a'\n[[variants]]\nname = 'b'\n"
        + "[paper]\ntolerance = 0.25\n"
        + "[[paper.points]]\nvalues = { cell_coverage_fraction = 0.5 }\n"
        + "[[paper.points]]\nvariant = 'b'\nat = { 'robots.count' = 4 }\n"
        + "values = { cell_coverage_fraction = { at_least = 0.75, tolerance = 0 } }\n"
    )
    lines = run_here(study, tmp_path / "out.parquet", seeds=[1, 2]).results.lines()
    assert [(line.variant, line.settings["robots.count"], line.paper, line.is_bound) for line in lines] == [
        *(("a", 1, 0.5, False), ("a", 4, 0.5, False), ("b", 1, 0.5, False), ("b", 4, 0.75, True)),
    ]
    assert [line.published and line.published.tolerance for line in lines] == [0.25, 0.25, 0.25, 0.0]
    # One robot always covers one cell of four.
    assert lines[0].sample[:3] == (2, 0.25, 0.0)
    assert lines[0].difference == -0.25
    assert lines[0].agrees


def test_the_least_covered_cell_is_that_of_the_means_over_all_trials(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    study = write(TINY.replace('["cell_coverage_fraction"]', '["least_cell_robots", "most_cell_robots"]'))
    result = run_here(study, tmp_path / "out.parquet")
    counts = [row["cell_counts"] for row in read_rows(result.path)]
    means = [sum(column) / 3 for column in zip(*counts, strict=True)]
    assert [line.sample.mean for line in result.results.lines()] == pytest.approx([min(means), max(means)])


def test_a_metric_that_nothing_measures_is_told(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(TINY.replace('"cell_coverage_fraction"', '"cel_coverage"'))
    results = run_here(study, tmp_path / "out.parquet").results
    assert results.unknown_metrics() == ["cel_coverage"]
    assert "cell_coverage_fraction" in results.known_metrics


@pytest.mark.parametrize(
    "text",
    [
        GRID,
        TINY
        + "[[variants]]\nname = 'a'\n[[variants]]\nname = 'b'\n"
        + "[[paper.points]]\nvalues = { cell_coverage_fraction = 0.4 }",
        TINY + "picture = 'heatmap'",
        TINY + "series = ['robots_in_arena']",
        TINY + "picture = 'tracks'",
        COVERING + "picture = 'tracks'",
        COVERING + "picture = 'density'",
    ],
    ids=["line", "bars", "heatmap", "series", "tracks", "tracks with cells", "density"],
)
def test_a_study_is_drawn(write: Callable[..., Study], tmp_path: Path, text: str) -> None:
    result = run_here(write(text), tmp_path / "out.parquet")
    with Image.open(draw_study(tmp_path / "out.png", result.results)) as image:
        assert len(image.convert("RGB").getcolors(1 << 24) or []) > 10


# --- the command ----------------------------------------------------------------------------------------------------

COMMAND = [sys.executable, "-c", "from zwerm.cli.app import main; main()", "study"]


def start(tmp_path: Path, *arguments: str) -> "subprocess.Popen[str]":
    """Start the command in a process group of its own."""
    return subprocess.Popen(
        [*COMMAND, *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def assert_nothing_remains(group: int) -> None:
    """Wait until the process group is empty."""

    def empty() -> bool:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        return False

    try:
        until(empty, "nothing left", DEADLINE_S)
    except AssertionError:
        os.killpg(group, signal.SIGKILL)
        raise


def wait_for_rows(journal: Path) -> None:
    until(lambda: journal.exists() and journal.read_bytes().count(b"\n") >= 2, "rows", DEADLINE_S)


def test_ctrl_c_keeps_what_is_done_and_leaves_no_process(write: Callable[..., Study], tmp_path: Path) -> None:
    write(TINY.replace("seeds = 3", "seeds = 500"), "Slow")
    process = start(tmp_path, "tiny.toml", "--out", "out.parquet", "--jobs", "2")
    wait_for_rows(tmp_path / "out.parquet.journal")
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    assert_nothing_remains(process.pid)
    kept = len(read_rows(tmp_path / "out.parquet"))
    assert 2 <= kept < 500
    assert run_here(load_study(str(tmp_path / "tiny.toml")), tmp_path / "out.parquet", seeds=range(1, 3)).ran == 0


def test_a_killed_study_leaves_no_process_and_its_rows_in_the_journal(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    write(TINY.replace("seeds = 3", "seeds = 500"), "Slow")
    process = start(tmp_path, "tiny.toml", "--out", "out.parquet", "--jobs", "2")
    wait_for_rows(tmp_path / "out.parquet.journal")
    process.kill()
    process.communicate(timeout=DEADLINE_S)
    assert_nothing_remains(process.pid)
    assert run_here(load_study(str(tmp_path / "tiny.toml")), tmp_path / "out.parquet", seeds=range(1, 3)).ran == 0


def test_the_command_prints_a_table_and_says_with_its_status_how_it_went(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    write(GRID + "[[paper.points]]\nat = { 'robots.count' = 1 }\nvalues = { cell_coverage_fraction = 0.9 }")
    process = start(tmp_path, "tiny.toml", "--jobs", "1")
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, errors
    assert "cell_coverage_fraction" in output
    assert "-0.6500  OUTSIDE" in output
    assert (tmp_path / "runs" / "tiny.png").is_file()
    assert len(read_rows(tmp_path / "runs" / "tiny.parquet")) == 6

    write(TINY.replace("seeds = 3", "seeds = 8"), "Raises", name="raises")
    process = start(tmp_path, "raises.toml", "--jobs", "1")
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 1, errors
    assert "x node 0 crashed at tick 3: ValueError: no luck" in output

    process = start(tmp_path, "raises.toml", "--set", "robots.count=0")
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, output) == (2, "")
    assert errors == "zwerm: raises.toml: tiny-scenario.toml: robots.count: expected >= 1, got 0\n"
