"""Ends of followed walls, and walls that a slot sees from behind: what counts as closed there."""

import math
from collections.abc import Sequence

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.strips.crossings import Crossing, arcs_into
from zwerm.agents.sensor_coverage.frontier.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, Walk, WalkPoint
from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.maths.simplicial import FlagComplex

RADIUS_M = 0.07
SOUTH = -math.pi / 2.0
# A way to the east along a wall in the south.
EAST = tuple((0.1 * each, RADIUS_M) for each in range(3, 10))
WEST = EAST[::-1]


def way_along(robot: tuple[float, float], way: Sequence[tuple[float, float]], wall: float, hand: int) -> Walk:
    """Return a walk along a wall, in sight of slot 0."""
    points = [WalkPoint({0: direction(robot, each)}, (wall,), (), at=each) for each in way]
    return Walk(0, hand, tuple(points), RADIUS_M)


def direction(a: tuple[float, float], b: tuple[float, float]) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])


def closed_deg(walk: Walk, *standing: int) -> list[tuple[int, int]]:
    """Return the first and the last closed direction [degrees], of slot 0, by its open arc, while these other slots stand."""
    views = {each: dict[int, float]() for each in (0, *standing)}
    proof = SwarmProof()
    proof.update(ScanResult(views, FlagComplex(views), ()), (walk,), {}, {})
    return [
        (
            round(math.degrees(math.remainder(each.start_rad + each.width_rad, math.tau))),
            round(math.degrees(math.remainder(each.start_rad, math.tau))),
        )
        for each in proof.open_arcs()[0]
        if each.width_rad < math.tau
    ]


@pytest.mark.parametrize(("way", "hand"), [(EAST, -1), (WEST, 1)])
def test_a_slot_that_looks_along_a_wall_stays_open_past_the_last_touched_point(
    way: tuple[tuple[float, float], ...], hand: int
) -> None:
    """The farthest point is at -8.2 degrees. Between it and the touched point, at -12.5 degrees, the wall may end."""
    assert closed_deg(way_along((0.0, 0.2), way, SOUTH, hand)) == [(-23, -13)]


def test_a_slot_that_looks_straight_at_the_end_of_a_stretch_loses_nothing() -> None:
    """The other end is at -144.4 degrees, and the touched point there at -140.2 degrees."""
    assert closed_deg(way_along((0.9, 0.5), EAST, SOUTH, -1)) == [(-140, -90)]


def test_a_robot_that_stands_at_the_end_of_a_stretch_is_responsible_beyond() -> None:
    walk = way_along((0.0, 0.2), EAST, SOUTH, -1)._replace(end=1)
    assert closed_deg(walk, 1) == [(-23, -8)]
    assert closed_deg(walk) == [(-23, -13)]


def test_the_legs_of_a_walk_are_one_stretch() -> None:
    slots = Slots()
    slots.add(8)
    first = slots.take_walk(8, -1, [Waypoint(x, y, (), (SOUTH,), ()) for x, y in EAST[:4]], RADIUS_M)
    second = slots.take_walk(8, -1, [Waypoint(x, y, (), (SOUTH,), ()) for x, y in EAST[4:]], RADIUS_M, first, True)
    assert [each.at for each in slots.walks[second].points] == list(EAST)
    assert [each.end for each in slots.walks] == [None, 0]


def test_a_wall_that_a_slot_sees_from_its_other_side_closes_nothing() -> None:
    """The robot enters a passage in the east, with the wall in the north. The slot sees it past the corner of this wall."""
    assert closed_deg(way_along((0.0, 0.2), EAST, -SOUTH, 1)) == []


def test_a_walk_that_noise_leads_beyond_its_end_and_back_closes_no_more_than_up_to_its_end() -> None:
    into = [Crossing(Arc(0.0, 0.5), 1), Crossing(Arc(0.2, 0.3), -1)]
    assert [tuple(each) for each in arcs_into(into)] == [pytest.approx((0.0, 0.2))]
    assert [tuple(each) for each in arcs_into([Crossing(Arc(6.0, 1.0), 1)])] == [pytest.approx((6.0, 1.0))]


def test_a_pocket_ends_a_body_beside_the_touched_wall() -> None:
    """The slot touches the wall, too: the walking robot, in touch with both, touched the wall at -26.6 degrees."""
    way = (*WEST, (0.14, RADIUS_M))
    robot = 0.0, RADIUS_M
    walk = way_along(robot, way, SOUTH, 1)
    touching = walk._replace(points=(*walk.points[:-1], walk.points[-1]._replace(robots=(0,))))
    assert closed_deg(touching) == [(-45, 0)]
    assert closed_deg(touching._replace(points=touching.points[-1:])) == [], "the robot touched the wall once only"
