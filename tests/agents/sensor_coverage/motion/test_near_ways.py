"""A robot follows a wall close to its slot: what the slot sees of this way, by odometry, and what that proves.

The wall is a block whose south face is at y = 0.08 m and whose west face is at x = -0.13 m. The slot is south of it.
"""

import math
from collections.abc import Iterable

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import united_round
from zwerm.agents.sensor_coverage.frontier.wall_plans import WallPlans
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc, Origin, Walk, contains, turned_vector
from zwerm.agents.sensor_coverage.messages.commands import NearWalls, Sighting, Waypoint
from zwerm.agents.sensor_coverage.motion.walls.near_arcs import (
    FollowedWay,
    NearPoint,
    NearWay,
    arcs_around_all,
    places_beside,
    start_in_sight,
    walls_around,
)
from zwerm.agents.sensor_coverage.motion.walls.waypoint_choice import (
    LEG_BYTES_MAX,
    SIGHTING_BYTES,
    WAYPOINT_BYTES,
    first_of_message,
)
from zwerm.maths.simplicial import FlagComplex

RADIUS_M = 0.07
# Eight places on a circle stand for all: between two of them an arc may end this much [rad] earlier.
TOLERANCE_RAD = math.radians(4.0)
SLOT, OTHER = (0.0, 0.0), (-0.9, 0.1)
NORTH, EAST = (math.pi / 2.0,), (0.0,)
# The robot goes west along the south face, round the corner, and north along the west face.
Way = list[tuple[tuple[float, float], tuple[float, ...]]]
WAY: Way = [
    *(((x, 0.01), NORTH) for x in (-0.02, -0.07, -0.12)),
    ((-0.17, 0.02), ()),
    ((-0.2, 0.05), ()),
    *(((-0.2, y), EAST) for y in (0.09, 0.14, 0.19)),
]


def sights(way: list[tuple[float, float]], hand: int) -> list[float | None]:
    """Return the direction [deg] back to the slot from each point of a way, or None."""
    found = (start_in_sight(SLOT, [SLOT, *way[: number + 1]], hand, RADIUS_M) for number in range(len(way)))
    return [None if each is None else round(math.degrees(each), 1) for each in found]


@pytest.mark.parametrize("hand", [-1, 1])
def test_a_slot_sees_its_robot_up_to_a_corner_and_not_behind_it(hand: int) -> None:
    """Up to 0.09 m north the line of sight passes the corner. The mirrored way has the wall at the other hand."""
    way = [(x, -hand * y) for (x, y), _ in WAY]
    seen = sights(way, hand)
    assert [each is not None for each in seen] == [False, *[True] * 5, *[False] * 2]
    assert seen[5] == pytest.approx(hand * math.degrees(math.atan2(0.09, 0.2)), abs=0.1)


def test_a_slot_sees_its_robot_all_along_a_wall_that_bends_towards_it() -> None:
    way = [(0.1, 0.0), (0.2, 0.0), (0.2, 0.1), (0.2, 0.2), (0.1, 0.25)]
    assert None not in sights(way, -1)


def test_a_slot_does_not_see_its_robot_on_the_other_side_of_a_thin_wall() -> None:
    assert sights([(0.1, 0.0), (0.2, 0.0), (0.27, 0.07), (0.2, 0.15), (0.1, 0.15)], 1)[-1] is None


def near_arcs(way: Way) -> list[NearArc]:
    points = [NearPoint(at, walls) for at, walls in way]
    return [
        NearArc(each, -1)
        for each in united_round(Arc(*one) for one in walls_around(SLOT, FollowedWay(points, -1, RADIUS_M)).followed)
    ]


def is_closed(arcs: list[Arc], direction_deg: float) -> bool:
    return any((math.radians(direction_deg) - start) % math.tau <= width for start, width in arcs)


def test_a_way_round_a_corner_closes_no_directions_past_the_corner() -> None:
    """The robot is in touch all the way round the corner. Its steps along the south face are in the directions past it."""
    touch = [*WAY[:3], ((-0.17, 0.02), (math.radians(56.0),)), ((-0.2, 0.05), (math.radians(23.0),)), *WAY[5:]]
    closed = [each.arc for each in near_arcs(touch)]
    assert is_closed(closed, 130.0)
    assert not any(is_closed(closed, each) for each in (155.0, 165.0, 170.0, 174.0))


def open_at_slot(
    origin: int | None,
    other: tuple[float, float] = OTHER,
    way: Way = WAY,
    lost_after: int = 99,
    robot_then: int = 0,
    third: tuple[float, float] | None = None,
) -> list[Arc]:
    """Return the open arcs of slot 0 after a way in sight of slot 1, which stands at a place [m], up to a point.

    A robot at a `third` place is in sight of both.
    """
    places = {0: SLOT, 1: other} | ({} if third is None else {2: third})
    views = {
        a: {b: math.atan2(y - places[a][1], x - places[a][0]) for b, (x, y) in places.items() if b != a} for a in places
    }
    scan = ScanResult(views, FlagComplex({slot: set(seen) for slot, seen in views.items()}), ())
    slots = Slots()
    for robot in places:
        slots.occupant[robot], slots.heading[robot], slots.frame[robot] = robot, 0.0, 0
    waypoints = []
    for number, ((x, y), walls) in enumerate(way):
        seen = () if number > lost_after else (Sighting(1, math.atan2(other[1] - y, other[0] - x)),)
        back = start_in_sight(SLOT, [SLOT, *(at for at, _ in way[: number + 1])], -1, RADIUS_M)
        waypoints.append(Waypoint(x, y, seen, walls, (), back))
    slots.take_walk(0, -1, waypoints, RADIUS_M, origin=None if origin is None else Origin(origin, SLOT))
    proof = SwarmProof()
    proof.update(scan, slots.walks, {}, {0: near_arcs(way)}, {}, slots.stays.numbers({0: robot_then, 1: 1}))
    return proof.open_arcs().get(0, [])


def test_a_way_close_to_a_slot_closes_the_triangle_with_a_robot_that_sees_it() -> None:
    """Between the corner and the other robot, at 174 degrees, is the triangle with the robot behind the corner."""
    found = open_at_slot(origin=0)
    assert not is_closed(found, 160.0)
    assert not is_closed(found, 153.0), "no body passes between the robot and the corner"
    for direction_deg in (153.0, 160.0):
        assert is_closed(open_at_slot(origin=None), direction_deg), "the slot did not see the way"


def test_what_a_robot_saw_of_its_way_counts_while_it_stands_there() -> None:
    assert is_closed(open_at_slot(origin=0, robot_then=5), 160.0)


@pytest.mark.parametrize("at_robot", [True, False])
def test_a_robot_that_a_way_leads_round_may_fill_an_opening(at_robot: bool) -> None:
    """The way leads from a corner, with the right hand, to the opposite wall of a passage: round a robot in its mouth."""
    corner, opposite = (math.radians(-75.0),), (math.radians(60.0),)
    points = [
        NearPoint((0.06, 0.04), corner),
        NearPoint((0.1, 0.074), corner),
        NearPoint((0.15, 0.083), (), at_robot),
        *(NearPoint((0.17 - 0.04 * each, 0.13 + 0.01 * each), opposite) for each in range(4)),
    ]
    closed = [Arc(*each) for each in walls_around(SLOT, FollowedWay(points, -1, RADIUS_M)).followed]
    assert is_open_at(closed, 38.0) is at_robot
    assert not is_open_at(closed, 58.0)


@pytest.mark.parametrize(
    ("off_deg", "other_moves", "left"),
    [
        pytest.param(4.0, False, 1, id="0.04 m beside it"),
        pytest.param(8.0, False, 0, id="0.08 m beside it"),
        pytest.param(8.0, True, 1, id="the other slot has another robot, too: nobody knows which one moved"),
    ],
)
def test_what_counts_for_any_robot_at_a_slot_is_forgotten_when_one_stands_far_beside_it(
    off_deg: float, other_moves: bool, left: int
) -> None:
    slots = Slots()
    for robot in (7, 8):
        slots.add(robot)
    slots.length_m[0, 1] = slots.length_m[1, 0] = 0.6
    for turn, robots in ((0.0, (7, 8)), (math.radians(off_deg), (7, 9) if not other_moves else (5, 9))):
        slots.occupant |= dict(enumerate(robots))
        slots.learn_references({0: {1: turn}, 1: {0: math.pi + turn}})
        if not turn:
            WallPlans(PlannerParameters(), slots, None).note_near(1, NearWalls(((0.2, 0.6),)), 1)
    slots.take_replaced()
    assert len(slots.near[1]) == left


def test_another_robot_at_a_slot_does_not_know_the_walls_close_to_it() -> None:
    slots = Slots()
    slots.occupant[4] = 9
    own, for_all = NearArc(Arc(0.0, 1.0), 1, 9), NearArc(Arc(0.2, 0.6), 1)
    slots.note_near(4, [own, for_all])
    assert slots.take_replaced() == ()
    assert slots.near[4] == [own, for_all]
    slots.occupant[4] = 8
    assert slots.take_replaced() == (4,)
    assert slots.near[4] == [for_all]
    assert slots.take_replaced() == ()


@pytest.mark.parametrize("wall_m", [0.08, 0.15, 0.3])
def test_walls_that_another_robot_at_a_slot_knows_are_closed_wherever_it_stands(wall_m: float) -> None:
    """The robot follows a wall in the south, and the one in the east behind a corner."""
    south, (east,) = -math.pi / 2.0, EAST
    points = [
        NearPoint((0.01 * each, RADIUS_M - wall_m), (south, east) if each == 30 else (south,)) for each in range(31)
    ]
    points += [NearPoint((0.3, RADIUS_M - wall_m + 0.01 * each), EAST) for each in range(1, 31)]
    places = places_beside(SLOT, points, RADIUS_M)
    assert all(y > -wall_m + 0.6 * RADIUS_M for _, y in places), "no body is in the wall"
    closed = united_round(Arc(*each) for each in arcs_around_all(places, FollowedWay(points, -1, RADIUS_M)))
    here = united_round(Arc(*each) for each in walls_around(SLOT, FollowedWay(points, -1, RADIUS_M)).followed)
    assert math.radians(20.0) < sum(each.width_rad for each in closed) < sum(each.width_rad for each in here)
    tight = [Arc(each.start_rad + TOLERANCE_RAD, each.width_rad - 2.0 * TOLERANCE_RAD) for each in closed]
    for number in range(60):
        x, y = 0.05 * math.cos(0.4 * number), 0.05 * math.sin(0.4 * number)
        if y > -wall_m + RADIUS_M:
            there = united_round(
                Arc(*each) for each in walls_around((x, y), FollowedWay(points, -1, RADIUS_M)).followed
            )
            assert all(contains(there, each) for each in tight if each.width_rad > 0.0), (x, y)


def closed_by(way: NearWay) -> list[Arc]:
    """Return the arcs that a way closes around the slot."""
    return united_round(Arc(*each) for each in way.walls().followed)


def is_open_at(closed: Iterable[Arc], degrees: float) -> bool:
    """Return whether arcs leave a direction open."""
    return not any((math.radians(degrees) - each.start_rad) % math.tau < each.width_rad for each in closed)


@pytest.mark.parametrize(
    ("swept_only", "way_back", "is_open"),
    [
        pytest.param(False, [], False, id="a robot without a coordinator"),
        pytest.param(True, [], True, id="it goes on"),
        pytest.param(True, [(0.24, 0.23), (0.12, 0.12), (0.01, 0.0)], False, id="it drives straight back"),
        pytest.param(True, [(0.3, 0.2), (0.27, 0.07), (0.01, 0.0)], True, id="it is led round a corner"),
        pytest.param(True, [(0.24, 0.23)], True, id="it is stopped on its way back"),
    ],
)
def test_a_wall_counts_only_where_no_corner_may_hide_it(
    swept_only: bool, way_back: list[tuple[float, float]], is_open: bool
) -> None:
    """The robot drives 0.36 m to a wall in the east, and follows it to the north. A corner may be north of its straight way."""
    way = NearWay(SLOT, -1, RADIUS_M, swept_only)
    for number in range(8):
        way.take(NearPoint((0.36, 0.05 * number), EAST))
    if way_back:
        way.close(way_back)
    assert not is_open_at(closed_by(way), 10.0)
    assert is_open_at(closed_by(way), 35.0) is is_open


def test_a_triangle_across_one_of_robots_closes_nothing() -> None:
    """The third robot, at 165 degrees, is beyond the line from the other one to the point: that relies on slot 0 there."""
    assert is_closed(open_at_slot(origin=0, way=WAY[2:], third=(-0.5, 0.13)), 160.0)
    assert not is_closed(open_at_slot(origin=0, way=WAY[2:], third=(-0.5, 0.0)), 160.0), "on this side of the line"


def test_a_triangle_with_a_robot_beside_the_point_closes_nothing() -> None:
    """The other robot is 0.15 m from the point: by an error of its bearing it may stand on the other side."""
    assert is_closed(open_at_slot(origin=0, other=(-0.35, 0.095)), 160.0)


@pytest.mark.parametrize(("lost_after", "closed"), [(99, True), (2, False)])
def test_a_robot_that_loses_sight_of_a_way_straight_away_from_a_slot_is_not_relied_on(
    lost_after: int, closed: bool
) -> None:
    """The robot goes north along a wall in the east. Behind a corner the other one, in the west, sees it no more."""
    way: Way = [((0.0, 0.05 * each), EAST) for each in range(2, 8)]
    found = open_at_slot(origin=0, other=(-0.9, -0.2), way=way, lost_after=lost_after)
    assert is_closed(found, 120.0) != closed


def test_a_walk_keeps_the_slot_that_its_robot_left() -> None:
    slots = Slots()
    slots.occupant[3], slots.heading[8], slots.frame[8] = 8, 1.0, 0
    number = slots.take_walk(
        8,
        1,
        [Waypoint(0.1, 0.0, (), NORTH, (), math.pi), Waypoint(0.2, 0.0, (), NORTH, ())],
        origin=Origin(3, (0.1, 0.2)),
    )
    walk: Walk = slots.walks[number]
    assert walk.origin is not None
    assert walk.origin.slot == 3
    assert walk.origin.at == pytest.approx(turned_vector((0.1, 0.2), 1.0))
    turned = walk.turned(0, 0.5).origin
    assert turned is not None
    assert turned.at == pytest.approx(turned_vector((0.1, 0.2), 1.5))
    assert [dict(each.seen) for each in walk.points] == [{3: pytest.approx(1.0 + math.tau)}, {}]


def test_a_way_begins_with_the_first_point_that_has_a_direction() -> None:
    way = NearWay(SLOT, 1, RADIUS_M)
    way.waypoints += [Waypoint(x, 0.0, (), NORTH, ()) for x in (0.0, 0.05, 0.1, 0.05, 0.2)]
    assert [each.x_m for each in way.seen_from_start()] == [0.1, 0.05, 0.2]


def test_a_message_has_the_first_points_of_a_long_way() -> None:
    point = Waypoint(0.0, 0.0, (Sighting(1, 0.0),) * 9, NORTH, ())
    bytes_each = WAYPOINT_BYTES + 9 * SIGHTING_BYTES
    assert len(first_of_message([point] * 1_000)) == (LEG_BYTES_MAX - 1) // bytes_each
    assert len(first_of_message([point] * 5)) == 5
