"""The TOML file of a study: errors, seeds, grid, and the built-in studies."""

from collections.abc import Callable
from pathlib import Path

import pytest
from study_files import GRID, TINY

from zwerm.errors import ScenarioError
from zwerm.study.study_tables import Study, built_in, load_study, parse_seeds
from zwerm.study.trial_plan import make_points, make_trials


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ("seeds = 1\nmetrics = ['m']", "scenario: required, and missing"),
        (TINY + "sceds = 3", "sceds: unknown key; did you mean seeds?"),
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
def test_an_error_in_a_study_file_is_one_line(
    write: Callable[..., Study], tmp_path: Path, text: str, mistake: str
) -> None:
    with pytest.raises(ScenarioError) as raised:
        write(text)
    assert raised.value.mistakes == [f"{tmp_path / 'tiny.toml'}: {mistake}"]


def test_an_error_in_a_scenario_names_the_point_of_the_grid_once(write: Callable[..., Study], tmp_path: Path) -> None:
    study = write(TINY + "[grid]\n'robots.count' = [4, -1]\n'time.dt_s' = [0.1, 0.2]")
    with pytest.raises(ScenarioError) as raised:
        make_points(study)
    place = f"{tmp_path / 'tiny.toml'}: robots.count=-1, time.dt_s=0.1: {tmp_path / 'tiny-scenario.toml'}"
    assert raised.value.mistakes == [f"{place}: robots.count: expected >= 1, got -1"]


def test_an_unknown_study_is_an_error_of_one_line_with_the_known_names() -> None:
    with pytest.raises(ScenarioError, match=r"^nope: expected a study's file .* `zwerm list` names all"):
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


def test_each_variant_runs_at_each_point_with_each_seed(write: Callable[..., Study]) -> None:
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
def test_the_computation_free_studies_have_as_many_trials_as_the_paper(name: str, trials: int) -> None:
    study = load_study(name)
    points = make_points(study)
    assert len(make_trials(study, points, study.table.seeds)) == trials
    seconds = {point.scenario.time.duration_s for point in points}
    assert seconds <= {120.0, 240.0, 600.0, 3600.0}


@pytest.mark.parametrize("name", sorted(built_in()))
def test_a_built_in_study_has_valid_scenarios(name: str) -> None:
    study = load_study(name)
    assert make_points(study)
    assert study.table.summary
    assert study.table.source
