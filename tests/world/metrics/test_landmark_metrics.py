"""The fraction of places whose visible landmarks were all seen together, and conclusions that come too early."""

from pathlib import Path

import numpy as np
import pytest

from zwerm.agents.landmark_exploration.mapping.map_reports import MapReport, write_report
from zwerm.maths.keyed_random import Draws
from zwerm.run.assembly import prepare
from zwerm.scenario.load import load
from zwerm.scenario.tables import ArenaTable
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics import MetricContext, Truth
from zwerm.world.metrics.landmark_exploration import Exploration, MapCompletion, maximal, visible
from zwerm.world.scene import Scene
from zwerm.world.tick.telemetry import TelemetryRecord

LANDMARKS = np.array([(0.5, 0.5), (1.5, 0.5), (3.5, 0.5)])


def hall(walls: list[list[list[float]]] | None = None) -> Arena:
    return Arena.from_table(ArenaTable.model_validate({"size_m": [4.0, 1.0], "walls": walls or []}), Path())


def test_nothing_is_covered_before_anything_is_seen_and_all_when_every_set_was() -> None:
    arena = hall()
    completion = MapCompletion(arena, LANDMARKS, 1.0)
    assert completion.places == 40 * 10
    assert completion.fraction == 0.0
    places = np.column_stack([np.linspace(0.05, 3.95, 40), np.full(40, 0.5)])
    completion.add(visible(arena, LANDMARKS, 1.0, places))
    assert 0.9 < completion.fraction <= 1.0


def test_a_simplex_covers_the_places_that_see_a_face_of_it() -> None:
    completion = MapCompletion(hall(), LANDMARKS, 1.0)
    completion.add([(2,)])
    alone = completion.fraction
    assert 0.2 < alone < 0.4
    completion.add([(0, 1)])
    both = completion.fraction
    assert both > alone + 0.3
    completion.add([(0,), (1, 0), (2,)])
    assert completion.fraction == both


def test_a_wall_hides_landmarks() -> None:
    seen = visible(hall([[[1.0, 0.0], [1.0, 1.0]]]), LANDMARKS, 1.0, np.array([(0.8, 0.5), (1.2, 0.5)]))
    assert seen == [[0], [1]]


def test_where_nothing_is_visible_nothing_can_be_covered() -> None:
    completion = MapCompletion(hall(), np.array([(0.5, 0.5)]), 0.3)
    completion.add([(0,)])
    assert 0.0 < completion.fraction < 0.2


def test_maximal_simplices_are_no_faces() -> None:
    assert sorted(maximal([(1, 2), (2, 1, 3), (3,), (4,), (3, 2, 1), ()])) == [(1, 2, 3), (4,)]


ROBOTS = 3
SMALL = ("arena.size_m=[2.0,2.0]", f"robots.count={ROBOTS}")


def measured(reports: list[tuple[int, MapReport]], dead: tuple[int, ...] = ()) -> dict[str, float]:
    """Return the metrics after reports of nodes, one a tick."""
    scenario = load("landmark-free", SMALL)
    arena = prepare(scenario).arena
    metric = Exploration(None, MetricContext(arena, None, scenario.time.dt_s, scenario))
    nowhere, nobody = np.zeros((ROBOTS, 2)), np.zeros(ROBOTS, dtype=np.bool_)
    for tick, (node, report) in enumerate(reports):
        metric.report(TelemetryRecord(tick, 0.1 * tick, node, {}, write_report(report), nowhere, nobody))
    scene = Scene(len(reports), 0.0, nowhere, np.zeros(ROBOTS), nobody, nobody, 0.04, arena, Draws(1))
    metric.sample(Truth(scene, dead))
    return metric.metrics()


def of_robot(open_frontiers: int, done: bool = False) -> MapReport:
    return MapReport(((0, 1),), ((0, 64),), open_frontiers, done, of_robot=True)


@pytest.mark.parametrize(
    ("reports", "dead", "early"),
    [
        ([(0, of_robot(0, done=True)), (1, of_robot(3))], (), 0.0),
        ([(1, of_robot(3)), (0, of_robot(0, done=True))], (), 1.0),
        ([(1, of_robot(3)), (0, of_robot(0, done=True)), (1, of_robot(0, done=True))], (), 1.0),
        ([(1, of_robot(3)), (1, of_robot(0)), (0, of_robot(0, done=True))], (), 0.0),
        ([(1, of_robot(3)), (0, of_robot(0, done=True))], (1,), 0.0),
        ([(0, of_robot(2, done=True))], (), 1.0),
    ],
    ids=["opened after", "open elsewhere", "closed after", "closed before", "of a dead robot", "its own"],
)
def test_a_robot_concludes_early_where_a_living_one_knows_an_open_frontier(
    reports: list[tuple[int, MapReport]], dead: tuple[int, ...], early: float
) -> None:
    assert measured(reports, dead)["concluded_early"] == early


def test_open_frontiers_are_those_of_the_living_robot_that_knows_most() -> None:
    reports = [(0, of_robot(2)), (1, of_robot(5)), (2, of_robot(9))]
    assert measured(reports)["open_frontiers"] == 9.0
    assert measured(reports, dead=(2,))["open_frontiers"] == 5.0


def test_a_coordinator_cannot_conclude_early() -> None:
    found = measured([(ROBOTS, MapReport(((0, 1),), ((0, 64),), 4, done=True))])
    assert "concluded_early" not in found
    assert found["open_frontiers"] == 4.0
