"""Ends of followed walls, and walls that a slot sees from behind: what counts as closed there."""

import math
from collections.abc import Sequence

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.strips.crossings import arcs_beside_pocket
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import (
    FollowedStretch,
    Pocket,
    StretchEnd,
    kept_part,
    touched_point,
)
from zwerm.agents.sensor_coverage.frontier.strips.stretches import pocket_of
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, Crossing, Walk, WalkPoint, arcs_into
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
    return closed_ranges(proof_of(walk, (0, *standing)))


def proof_of(walk: Walk, standing: tuple[int, ...], touched_deg: tuple[float, ...] = (), robot: int = 9) -> SwarmProof:
    """Return the proof of these slots, which do not see each other; slot 0 touches walls in these directions [degrees].

    The `robot` did so at slot 0.
    """
    views = {each: dict[int, float]() for each in standing}
    proof = SwarmProof()
    touched = {0: tuple(math.radians(each) for each in touched_deg)}
    proof.update(ScanResult(views, FlagComplex(views), ()), (walk,), touched, {}, {}, {}, {(0, robot): touched[0]})
    return proof


def closed_ranges(proof: SwarmProof) -> list[tuple[int, int]]:
    """Return the first and the last closed direction [degrees], of slot 0, by each open arc."""
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
    """The walking robot, in touch with the slot's robot, touched the wall at -26.6 degrees."""
    touching = way_to(0.0)
    assert closed_deg(touching) == [(-45, -4)], "through the strip the slot looks past its other end, at -4.4 degrees"
    assert closed_deg(tied(touching), 1) == [(-45, 0)]
    assert closed_deg(touching._replace(points=touching.points[-1:])) == [], "the robot touched the wall once only"


def test_a_robot_that_is_touched_twice_at_an_end_looks_past_it_once() -> None:
    """The walking robot goes from the slot's robot, at 30 degrees, along a wall in the west. It touched the robot before that.

    By its bearing then, 10 degrees off, the robot looks into the strip beside the wall from 22 degrees on.
    """
    west, deg = (math.pi,), math.radians
    points = (
        WalkPoint({0: deg(-20.0)}, (), (0,), at=(0.138, -0.024)),
        WalkPoint({0: deg(30.0)}, west, (0,), at=(0.12, 0.07)),
        WalkPoint({0: deg(45.0)}, west, (), at=(0.12, 0.12)),
        WalkPoint({0: deg(55.0)}, west, (), at=(0.12, 0.17)),
    )
    stretches = proof_of(Walk(0, 1, points, RADIUS_M), (0,))._wall_arcs[0].by_stretch.values()
    into = [arc for arcs in stretches for arc in arcs]
    assert not any((deg(25.0) - start) % math.tau < width for start, width in into)
    assert all((deg(first) - start) % math.tau >= width for start, width in into for first in (32.0, 50.0)), "and out"


def way_to(direction_rad: float) -> Walk:
    """Return a walk to the west along a wall in the south, up to a robot in touch, which sees it in a direction [rad]."""
    robot = 0.0, RADIUS_M - 2.0 * RADIUS_M * math.sin(direction_rad)
    walk = way_along(robot, (*WEST, (2.0 * RADIUS_M * math.cos(direction_rad), RADIUS_M)), SOUTH, 1)
    return walk._replace(points=(*walk.points[:-1], walk.points[-1]._replace(robots=(0,))))


def tied(walk: Walk) -> Walk:
    """Return a walk that begins in touch with the robot at slot 1."""
    return walk._replace(points=(walk.points[0]._replace(robots=(1,)), *walk.points[1:]))


def test_between_two_contacts_that_no_opening_fits_between_all_is_closed() -> None:
    """The pocket ends at -40 degrees, and what the slot's robot touches at -45 degrees.

    Another robot at the slot may stand 0.09 m away, and touch the other side of a passage there.
    """
    walk = tied(way_to(math.radians(5.0)))._replace(stays={0: 8})
    assert closed_ranges(proof_of(walk, (0, 1), (-90.0,), 8)) == [(-135, 1)]
    assert closed_ranges(proof_of(walk, (0, 1), (-90.0,), 9)) == [(-40, -45), (-135, 1)]


def test_a_contact_on_the_other_side_of_a_robot_closes_nothing_between() -> None:
    """The slot's robot stands in a passage of 0.16 m: the touched points are close to each other, and it is between them."""
    at = 0.14 * math.cos(math.radians(-120.0)), 0.14 * math.sin(math.radians(-120.0))
    end = StretchEnd(at, touched_point(at, math.radians(30.0), RADIUS_M))
    pocket = Pocket(end, end, RADIUS_M, True, (0.0, 0.0), True)
    beside = [len(list(arcs_beside_pocket(-1, pocket, (math.radians(each),)))) for each in (85.0, -60.0)]
    assert beside == [0, 1], "the arc up to the contact; the robot is past the end of the wall"


@pytest.mark.parametrize(("ahead_m", "closed"), [(0.07, 1), (0.02, 1), (-0.01, 0), (-0.04, 0)])
def test_a_robot_past_the_end_of_a_wall_does_not_see_how_it_goes_on(ahead_m: float, closed: int) -> None:
    """The wall is in the south of the walking robot. The standing one sees the wall, or is past its end, in a bend."""
    at = 0.14 * math.cos(math.asin((0.07 - ahead_m) / 0.14)), 0.07 - ahead_m
    end = StretchEnd(at, (at[0], at[1] - RADIUS_M))
    pocket = Pocket(end, end, RADIUS_M, True, (0.0, 0.0), True)
    assert len(list(arcs_beside_pocket(1, pocket, ()))) == closed


@pytest.mark.parametrize(("wall_deg", "pockets"), [(-90.0, 1), (170.0, 0)])
def test_a_robot_between_the_end_of_a_way_and_the_wall_makes_no_pocket(wall_deg: float, pockets: int) -> None:
    """The walking robot was in touch with the standing one a point before, at its other side."""
    at = 0.15, 0.0
    end = StretchEnd(at, touched_point(at, math.radians(wall_deg), 4.0 * RADIUS_M if wall_deg > 0.0 else RADIUS_M))
    stretch = FollowedStretch(1, 5, end, end, RADIUS_M)
    assert (pocket_of(stretch, 0, (0.14, 0.0), 0.0) is not None) == bool(pockets)


@pytest.mark.parametrize(("hand", "closed"), [(1, []), (-1, [(-80, -65)])])
def test_a_robot_that_passes_between_robots_and_a_wall_makes_no_pocket(
    hand: int, closed: list[tuple[int, int]]
) -> None:
    """It goes east, with a wall in the south, and the slot's robot in the north. It first touched the end of the wall."""
    walk = way_along((0.3, 0.21), tuple((x, RADIUS_M) for x in (0.3, 0.35, 0.4)), SOUTH, hand)
    first = walk.points[0]._replace(walls=(math.radians(-60.0),), robots=(0,))
    assert closed_deg(walk._replace(points=(first, *walk.points[1:]))) == closed


@pytest.mark.parametrize(
    ("to_walking_deg", "closed"),
    [
        pytest.param(60.0, 2, id="both robots stand along one wall"),
        pytest.param(78.0, 2, id="the same with an error of a switch and of a bearing"),
        pytest.param(85.0, 1, id="before the corners of a door"),
    ],
)
def test_two_robots_that_touch_walls_in_one_direction_may_stand_before_two_corners(
    to_walking_deg: float, closed: int
) -> None:
    """Both touch a wall at -30 degrees. One arc is a body's radius of the wall that the walking robot touched."""
    wall, there = math.radians(-30.0), math.radians(to_walking_deg)
    at = 2.0 * RADIUS_M * math.cos(there), 2.0 * RADIUS_M * math.sin(there)
    end = StretchEnd(at, touched_point(at, wall, RADIUS_M))
    pocket = Pocket(end, end, RADIUS_M, False, (0.0, 0.0), True)
    assert len(list(arcs_beside_pocket(-1, pocket, (wall,)))) == closed


def test_close_ends_of_two_stretches_close_what_is_between_them_for_the_robot_beside() -> None:
    """The walking robot follows a wall to the tip of a corner, where a robot stands, and goes round that robot."""
    first = StretchEnd((0.05, 0.13), (0.1, 0.08))
    for apart_m, closed in ((0.12, 1), (0.16, 0)):
        end = StretchEnd((0.12, -0.07), (0.1, 0.08 - apart_m))
        other = StretchEnd((0.4, -0.07), (0.4, 0.0))
        pocket = Pocket(end, other, RADIUS_M, False, (0.0, 0.0), False, first)
        assert len(list(arcs_beside_pocket(-1, pocket, ()))) == closed


def test_a_step_back_along_the_wall_closes_nothing() -> None:
    """The robot turns round in front of another one. Its wall is at its other hand then."""
    back = way_along((0.0, 0.2), EAST[:3][::-1], SOUTH, -1)
    assert closed_deg(back) == []
    assert closed_deg(way_along((0.0, 0.2), EAST[:3], SOUTH, -1)) != []


def test_an_end_within_the_directions_of_a_step_is_cut_out() -> None:
    """The step turns round a corner close to the slot, which looks along the wall into the passage behind it."""
    end = StretchEnd((-0.215, 0.215), (-0.25, 0.154))
    start, stop = (-0.086, 0.052), (-0.084, 0.101)
    there, beyond = (math.atan2(y, x) for x, y in (start, stop))
    low, high = kept_part(start, stop, there, beyond - there, [end])
    for number in range(100):
        part = low + (high - low) * (number + 0.5) / 100.0
        direction = there + part * (beyond - there)
        # Directions are taken to be even along the step, which is off by less than a degree.
        assert not math.atan2(0.215, -0.215) + 0.017 < direction < math.atan2(0.154, -0.25), "past the end of the strip"
    assert 0.0 < high - low < 1.0
    assert kept_part(start, stop, there, beyond - there, []) == (0.0, 1.0)


def test_a_last_step_away_from_the_slot_closes_nothing_by_the_noise_of_its_bearings() -> None:
    """The step leads to the north along a wall in the east. By noise the slot sees it turn left, as if the wall was beyond."""
    end = StretchEnd((0.0, 1.0), (RADIUS_M, 1.0))
    start, stop = math.radians(91.0), math.radians(96.0)
    assert kept_part((0.0, 0.9), end.at, start, stop - start, []) == (0.0, 1.0)
    assert kept_part((0.0, 0.9), end.at, start, stop - start, [end]) == (0.0, 0.0)
    assert kept_part((0.0, 0.9), end.at, math.radians(-20.0), stop - start, [end]) == (0.0, 1.0), (
        "a slot before the wall"
    )


def test_noise_of_the_first_bearing_beside_a_robot_closes_nothing_past_the_way() -> None:
    """A walk away from the robot at the slot. By odometry it begins 6 degrees to the left of where the slot saw it."""
    wall = (math.radians(-60.0),)
    points = (
        WalkPoint({0: math.radians(76.0)}, (), (0,), at=(2.531, -0.569)),
        WalkPoint({0: math.radians(53.0)}, wall, (), at=(2.579, -0.581)),
        WalkPoint({0: math.radians(55.0)}, wall, (), at=(2.627, -0.512)),
        WalkPoint({0: math.radians(57.0)}, wall, (), at=(2.656, -0.484)),
        WalkPoint({0: math.radians(54.0)}, wall, (), at=(2.746, -0.398)),
        WalkPoint({0: math.radians(46.0)}, wall, (), at=(2.794, -0.344)),
        WalkPoint({0: math.radians(47.0)}, wall, (), at=(2.822, -0.338)),
    )
    arcs = [
        arc for each in proof_of(Walk(0, -1, points, RADIUS_M), (0,))._wall_arcs[0].by_stretch.values() for arc in each
    ]
    closed = {each for each in range(25, 75) if any((math.radians(each) - a) % math.tau < width for a, width in arcs)}
    assert closed, "the wall beside the way"
    assert not closed & set(range(48, 75)), "between the bearings and the odometry of the first point"
