"""Results of a study: intervals, comparison with a paper, figures."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image
from scipy import stats
from study_files import COVERING, GRID, TINY, run_here

from zwerm.errors import ScenarioError
from zwerm.maths.statistics import Sample, condense, half_width
from zwerm.study.rows import read_rows
from zwerm.study.study_figure import draw_study
from zwerm.study.study_tables import Published, Study
from zwerm.study.summary import SummaryLine


def test_the_interval_of_a_mean_is_students() -> None:
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
def test_a_papers_value_agrees_within_the_interval_and_the_tolerance(
    sample: Sample, published: Published | None, trials: int | None, agrees: bool | None
) -> None:
    assert SummaryLine("", {}, "m", sample, published, trials).agrees is agrees


def test_a_papers_values_are_assigned_to_their_points(write: Callable[..., Study], tmp_path: Path) -> None:
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


def test_the_least_covered_cell_is_that_of_the_mean_counts_over_all_trials(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    study = write(TINY.replace('["cell_coverage_fraction"]', '["least_cell_robots", "most_cell_robots"]'))
    result = run_here(study, tmp_path / "out.parquet")
    counts = [row["cell_counts"] for row in read_rows(result.path)]
    means = [sum(column) / 3 for column in zip(*counts, strict=True)]
    assert [line.sample.mean for line in result.results.lines()] == pytest.approx([min(means), max(means)])


def test_a_metric_that_no_scenario_measures_is_refused_before_the_first_trial(
    write: Callable[..., Study], tmp_path: Path
) -> None:
    study = write(TINY.replace('"cell_coverage_fraction"', '"cel_coverage"'))
    with pytest.raises(ScenarioError) as caught:
        run_here(study, tmp_path / "out.parquet")
    [line] = caught.value.mistakes
    assert "metrics: expected names of metrics that its scenarios measure (" in line
    assert "cell_coverage_fraction, " in line
    assert line.endswith("got 'cel_coverage'; did you mean cell_coverage_fraction?")
    assert not list(tmp_path.glob("out.parquet*"))


def test_telemetry_and_metrics_of_ones_own_are_columns_of_a_study(write: Callable[..., Study], tmp_path: Path) -> None:
    own = TINY.replace('["cell_coverage_fraction"]', '["telemetry.node", "order_parameter"]')
    settings = ['robots.controller="reporters:Reports"', 'metrics.own=["own_metrics:order_parameter"]']
    result = run_here(write(own), tmp_path / "out.parquet", sets=settings)
    assert {0.0 <= row["order_parameter"] <= 1.0 for row in read_rows(result.path)} == {True}
    assert {row["telemetry.even"] for row in read_rows(result.path)} <= {0.0, 1.0}
    assert result.results.unknown_metrics() == []


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
def test_each_kind_of_study_figure_is_drawn(write: Callable[..., Study], tmp_path: Path, text: str) -> None:
    result = run_here(write(text), tmp_path / "out.parquet")
    with Image.open(draw_study(tmp_path / "out.png", result.results)) as image:
        assert len(image.convert("RGB").getcolors(1 << 24) or []) > 10


def test_equal_values_have_no_deviation() -> None:
    """The mean of twenty equal numbers is rounded, and is not one of them."""
    assert condense([1.1162790697674418] * 20)[1:] == (pytest.approx(1.1162790697674418), 0.0, 0.0)
