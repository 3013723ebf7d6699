"""Robots that stand where a walk has ended are idle, unless the proof of coverage needs what they see."""

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.wall_proof import WalkPoint
from zwerm.coordinator.sensor_coverage.coordinator import SensorCoverageCoordinator
from zwerm.coordinator.sensor_coverage.idle_slots import beside_others, still_idle, without_witnesses
from zwerm.deploy.node_specs import node_specs
from zwerm.maths.simplicial import FlagComplex
from zwerm.scenario.load import load

IDLE = dict.fromkeys((7, 8, 9))


@pytest.mark.parametrize(
    ("neighbours", "left"),
    [
        pytest.param({7: (1,), 8: (1, 7), 9: (2,)}, [7, 8, 9], id="each is in sight of a slot that is not idle"),
        pytest.param({7: (1,), 8: (2,), 9: ()}, [7, 8], id="nobody sees one of them: it went where nobody has been"),
        pytest.param({7: (1,), 8: (1, 9), 9: (8,)}, [7], id="only an idle one sees it, and both are needed"),
    ],
)
def test_a_robot_is_idle_only_where_a_standing_robot_sees_it(
    neighbours: dict[int, tuple[int, ...]], left: list[int]
) -> None:
    assert list(still_idle(IDLE, neighbours)) == left


def test_a_robot_that_alone_saw_a_walking_robot_is_not_idle() -> None:
    points = [WalkPoint(dict.fromkeys(seen, 0.0), (), ()) for seen in ((1, 7), (7, 8), (1, 2), ())]
    assert list(without_witnesses(IDLE, points)) == [9]


@pytest.mark.parametrize(
    ("stations", "left"),
    [
        pytest.param([(7, 8)], [9], id="a station that sees no others"),
        pytest.param([(1, 7)], [7, 8, 9], id="a station that sees another robot"),
        pytest.param([(1, 7), (9,)], [7, 8], id="one of two stations"),
        pytest.param([()], [7, 8, 9], id="a station that sees nobody"),
    ],
)
def test_an_idle_robot_counts_next_to_a_station_that_sees_no_others(
    stations: list[tuple[int, ...]], left: list[int]
) -> None:
    """As drawn building 804 showed: the station let out a robot as its first one, and that one stood beyond a bend."""
    assert list(beside_others(IDLE, stations)) == left


def test_an_idle_robot_beside_an_arc_that_no_walk_closes_counts_again_once() -> None:
    coordinator = Node(*node_specs(load("sensor-coverage", ("robots.count=3",)), 1)[3])._controller
    assert isinstance(coordinator, SensorCoverageCoordinator)
    walking = coordinator.walking
    views = {1: {2: 0.0, 7: 1.0}, 2: {1: 0.0, 8: 1.0}, 7: {1: 0.0}, 8: {2: 0.0}}
    scan = ScanResult(views, FlagComplex(views), ())
    walking.idle = dict.fromkeys((7, 8))
    assert not walking.wake(scan)
    coordinator.walls.unproven = (1,)
    assert walking.wake(scan)
    assert list(walking.idle) == [8]
    walking.idle[7] = None
    assert not walking.wake(scan)
