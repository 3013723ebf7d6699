"""The metrics of a run: when they sample, which a scenario asks for, and the user's own among them."""

import pytest
from support import scenario

from zwerm.catalogue import ALGORITHMS, METRICS
from zwerm.errors import ScenarioError
from zwerm.run.runner import run
from zwerm.scenario.plugin_names import class_named
from zwerm.scenario.tables import Scenario
from zwerm.world.metrics import Metric


def measuring(**metrics: object) -> Scenario:
    return scenario(robots={"controller": "reporters:Reports", "sensors": []}, metrics=metrics)


@pytest.mark.parametrize("path", [*METRICS.values(), *(path for row in ALGORITHMS for path in row.metrics)])
def test_every_metric_of_the_catalogue_is_a_metric_and_declares_its_names(path: str) -> None:
    found = class_named(path, "metric", ())
    assert issubclass(found, Metric)
    assert found.names


def test_a_metric_of_the_end_is_sampled_once_and_over_the_run_where_the_scenario_gives_a_period() -> None:
    at_end = run(measuring(cells=[4, 4]), 1, "inline")
    sampled = run(measuring(cells=[4, 4], every_s=0.5), 1, "inline")
    assert at_end.series == {}
    assert sampled.series["time_s"] == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert sampled.series["cell_coverage_fraction"][-1] == sampled.metrics["cell_coverage_fraction"]
    assert sampled.metrics == at_end.metrics
    assert sampled.trace == at_end.trace


def test_a_function_of_the_users_own_is_a_metric_with_a_series_and_changes_no_trace() -> None:
    own = run(measuring(own=["own_metrics:order_parameter", "own_metrics:newest_tick"], every_s=0.5), 1, "inline")
    assert 0.0 <= own.metrics["order_parameter"] <= 1.0
    assert own.series["order_parameter"][-1] == own.metrics["order_parameter"]
    assert own.series["newest_tick"].tolist() == [-1.0, 4.0, 9.0, 14.0, 19.0]
    assert own.as_json()["metrics"]["newest_tick"] == 19.0
    assert own.trace == run(measuring(), 1, "inline").trace


def test_a_class_of_the_users_own_gets_every_report_and_its_samples() -> None:
    own = run(measuring(own=["own_metrics:Reports"]), 1, "inline")
    assert own.metrics["records"] == 4 * 20
    assert own.series["time_s"] == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert 0.0 < own.metrics["gone_m"] < 0.3


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("order_parameter", "expected module:name, got 'order_parameter'"),
        ("own_metrics:missing", "module 'own_metrics' has no metric 'missing'"),
        ("own_metrics:number", "expected a metric class or a function, got 'own_metrics:number'"),
        ("own_metrics:two", "expected a function of one argument, the truth, got 'own_metrics:two'"),
        (
            "own_metrics:Nameless",
            "expected a subclass of zwerm.Metric that declares its `names`, got 'own_metrics:Nameless'",
        ),
        (
            "own_metrics:robots_in_arena",
            "expected a name that no other metric has, got 'robots_in_arena'",
        ),
    ],
)
def test_a_mistake_in_a_metric_of_ones_own_is_one_line(name: str, rule: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        run(measuring(own=[name]), 1, "inline")
    assert caught.value.mistakes == [f"small.toml: metrics.own.0: {rule}"]


def test_the_same_metric_twice_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"metrics\.own\.1: expected a name that no other metric has"):
        run(measuring(own=["own_metrics:newest_tick"] * 2), 1, "inline")


def test_a_metric_of_ones_own_that_raises_ends_the_run_with_its_name_tick_and_place() -> None:
    with pytest.raises(ScenarioError) as caught:
        run(measuring(own=["own_metrics:divides"]), 1, "inline")
    [line] = caught.value.mistakes
    assert line.startswith("metrics.own: divides at tick 10: ZeroDivisionError: ")
    assert "own_metrics.py:" in line


@pytest.mark.parametrize(
    ("metrics", "mistake"),
    [
        ({"cells": [5, 0]}, "metrics.cells.1: expected >= 1, got 0"),
        ({"cells": 3}, "metrics.cells: expected an array, got 3"),
        ({"coverage_radius_m": "far"}, 'metrics.coverage_radius_m: expected a number, got "far"'),
        ({"voronoi": {"rings": 0}}, "metrics.voronoi.rings: expected >= 1, got 0"),
        ({"voronoi": {"nix": 0}}, "metrics.voronoi.nix: unknown key"),
        ({"sight": 3}, "metrics.sight: unknown key"),
        ({"every_s": 0}, "metrics.every_s: expected > 0, got 0"),
        ({"voronoi": {}}, "metrics.voronoi: needs a field, and the scenario has none"),
    ],
)
def test_each_key_is_validated_by_its_row_of_the_catalogue(metrics: dict[str, object], mistake: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        run(measuring(**metrics), 1, "inline")
    assert [each.removeprefix("small.toml: ") for each in caught.value.mistakes] == [mistake]
