"""Paired runs and their differences."""

import math
from pathlib import Path
from typing import Any

import pytest
from comparisons import planned
from scipy import stats

from zwerm.compare.comparison import METRICS, Comparison, _difference, make_comparison
from zwerm.compare.comparison_figure import label
from zwerm.compare.comparison_report import shown
from zwerm.compare.variants import parse_sweep, parse_variant
from zwerm.maths.statistics import Sample
from zwerm.run.runner import run
from zwerm.study.study_runner import run_study
from zwerm.study.study_tables import Study
from zwerm.study.summary import Results
from zwerm.study.trial_plan import make_points


def test_variants_with_one_seed_have_the_same_random_faults_and_positions(gossip: Path) -> None:
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


def test_a_difference_is_over_pairs_of_seeds_with_students_interval(gossip: Path) -> None:
    ours, theirs = [3.0, 5.0, 4.0, math.nan, 9.0], [2.5, 4.0, 4.25, 1.0]
    comparison = rows_of(
        planned(gossip, (), metrics=["telemetry.cost"]),
        {
            "often": [{"outcome": "completed", "telemetry.cost": each} for each in theirs],
            "seldom": [{"outcome": "completed", "telemetry.cost": each} for each in ours],
        },
    )
    [place] = comparison.places
    found = comparison.difference(place, place.points[1], "telemetry.cost")
    low, high = stats.ttest_rel(ours[:3], theirs[:3]).confidence_interval(0.95)
    assert found.n == 3
    assert (found.mean - found.half_width, found.mean + found.half_width) == pytest.approx((low, high))
    # Rounding is no difference: its interval would be as narrow as it is, and leave out zero.
    assert _difference(0.1 + 0.2, 0.3) == 0.0
    # The means are of all that have a value, pairs or not.
    assert comparison.sample(place.points[1], "telemetry.cost").n == 4


def test_a_failed_run_counts_with_its_measured_values_and_its_reason(gossip: Path) -> None:
    gave_up = "node 160 gave up: cut-off: no path leads to the frontier, 3 frontier edges left"
    crashed = "node {} crashed at tick 5: ValueError"
    comparison = rows_of(
        planned(gossip, (), metrics=["telemetry.cost"]),
        {
            "often": [
                {"outcome": "completed", "telemetry.cost": 1.0},
                {"outcome": "time-limit", "telemetry.cost": 2.0},
            ],
            "seldom": [
                {"outcome": "failed", "reason": gave_up, "telemetry.cost": 4.0},
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
    assert comparison.difference(place, place.points[1], "telemetry.cost").mean == 3.0
    assert comparison.sample(place.points[0], "completed").mean == 0.5
    assert comparison.difference(place, place.points[1], "completed").mean == -0.5


def test_a_setting_without_effect_on_a_variant_runs_its_trials_once(tmp_path: Path) -> None:
    study = make_comparison(
        "sensor-coverage",
        [parse_variant("central"), parse_variant("decentralised:services.path=gradient")],
        [parse_sweep('faults=none:[],crash:[{kind="crash", nodes=["coordinator"], at_s=1.0}]')],
        metrics=["delivered_fraction"],
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
    assert comparison.difference(crash, crash.points[1], "delivered_fraction").n == 2


def test_unmeasured_and_zero_metrics_are_left_out_unless_requested(gossip: Path) -> None:
    rows = [{"outcome": "completed", "delivered_fraction": 0.0, "robots_deployed": 3.0}]
    told = {"often": rows, "seldom": rows}
    assert rows_of(planned(gossip, ()), told).metrics == ["robots_deployed"]
    assert rows_of(planned(gossip, (), metrics=["delivered_fraction"]), told).metrics == ["delivered_fraction"]
    assert set(METRICS) > {"delivered_fraction", "robots_deployed"}


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
def test_the_label_of_a_metric_is_text_with_its_unit(metric: str, words: str) -> None:
    assert label(metric) == words
