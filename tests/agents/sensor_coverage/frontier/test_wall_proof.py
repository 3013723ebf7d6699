"""The proof of coverage by arcs: conditions that close a direction, and conditions that do not."""

import math
from collections.abc import Iterable, Mapping

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.slot_proof import SlotProof
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.strips.stretches import StretchTracker
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    BLIND_MAX,
    Arc,
    TouchCounter,
    Walk,
    WalkPoint,
    WallStep,
    leaves_wall,
)
from zwerm.agents.sensor_coverage.messages.commands import Sighting, Waypoint
from zwerm.agents.sensor_coverage.messages.pushes import ProvedArc, WalkTriangle
from zwerm.agents.sensor_coverage.protocols.walls.sightlines import RESENT_POINTS, Sightlines
from zwerm.maths.simplicial import FlagComplex

# Directions of a walk, and the walls that it touches.
CORNER = ((10, (0.0,)), (20, ()), (30, ()), (40, ()), (60, (0.0,)))
ALONE = {0: dict[int, float]()}


def around(*degrees: float, hand: int, touched: bool = True) -> Walk:
    """Return a walk around slot 0 that it sees in these directions."""
    walls = (0.0,) if touched else ()
    return Walk(0, hand, tuple(WalkPoint({0: math.radians(each)}, walls, ()) for each in degrees))


def open_arcs(views: Mapping[int, Mapping[int, float]], walks: tuple[Walk, ...], *walls: float) -> dict[int, list[Arc]]:
    """Return the open arcs of all slots; slot 0 touches walls in some directions."""
    proof = SwarmProof()
    proof.update(ScanResult(views, FlagComplex(views), ()), walks, {0: walls}, {}, {})
    return proof.open_arcs()


def opened(*walks: Walk, walls: tuple[float, ...] = ()) -> list[tuple[int, int]]:
    """Return the open arcs of slot 0 in whole degrees."""
    arcs = open_arcs(ALONE, walks, *walls).get(0, [])
    return [(round(math.degrees(each.start_rad)), round(math.degrees(each.width_rad))) for each in arcs]


def test_a_robot_alone_is_open_all_around() -> None:
    assert opened() == [(0, 360)]


def test_a_closed_walk_with_the_wall_outside_closes_the_full_turn() -> None:
    assert opened(around(*range(0, 361, 20), hand=-1)) == []
    assert opened(around(*range(360, -1, -20), hand=1)) == []


def test_a_walk_around_the_robot_itself_closes_nothing() -> None:
    """With the robot at the hand, free space is on the other side of the step."""
    assert opened(around(*range(0, 361, 20), hand=1)) == [(0, 360)]


def test_a_walk_without_touch_closes_nothing() -> None:
    assert opened(around(*range(0, 361, 20), hand=-1, touched=False)) == [(0, 360)]


def test_a_walk_that_turns_round_a_corner_still_follows_the_wall() -> None:
    points = [WalkPoint({0: math.radians(each)}, walls, ()) for each, walls in CORNER]
    assert opened(Walk(0, -1, tuple(points))) == [(60, 310)]


@pytest.mark.parametrize("count", [1, 3, 8])
def test_points_without_a_contact_close_nothing_unless_the_wall_comes_back(count: int) -> None:
    free = [WalkPoint({0: math.radians(10 * (each + 1))}, (), ()) for each in range(count)]
    walk = Walk(0, -1, (WalkPoint({0: 0.0}, (0.0,), ()), *free))
    assert opened(walk) == [(0, 360)]


def touched_since(*points: tuple[tuple[int, ...], bool]) -> int:
    """Return since which point the wall is followed; a point is the directions [deg] of walls, and whether at a body."""
    counter = TouchCounter()
    for number, (walls, at_body) in enumerate(points):
        counter.take(number, tuple(math.radians(each) for each in walls), at_body)
    return counter.since


@pytest.mark.parametrize(
    ("points", "since"),
    [
        pytest.param([((0,), True), ((20,), True), ((-10,), False)], 0, id="the same wall stays in touch"),
        pytest.param([((0,), False), ((0, 90), True), ((90,), True)], 0, id="two walls of a corner"),
        pytest.param([((0,), False), ((-90,), False)], 0, id="another wall without a body"),
        pytest.param([((0,), False), ((-90,), True)], 1, id="another wall at a body"),
        pytest.param([((0,), True), ((-90,), False)], 1, id="another wall after a body"),
        pytest.param([((0,), False), ((), True), ((0,), False)], 2, id="body between two walls"),
        pytest.param([((0,), True), ((), False), ((0,), False)], 2, id="out of touch after a body"),
        pytest.param([((0,), False), ((), False), ((-90,), False)], 0, id="corner without a body"),
        pytest.param([((0,), False), *[((), False)] * (BLIND_MAX + 1), ((0,), False)], BLIND_MAX + 2, id="wall lost"),
    ],
)
def test_a_body_between_two_walls_breaks_a_walk(points: list[tuple[tuple[int, ...], bool]], since: int) -> None:
    """It may fill an opening. Without a body, the robot turned round a corner."""
    assert touched_since(*points) == since


def test_a_robot_may_lose_a_walk_behind_a_corner_that_another_robot_sees() -> None:
    hidden, unseen = WalkPoint({1: 0.0}, (0.0,), ()), WalkPoint({}, (0.0,), ())
    seen = [WalkPoint({0: math.radians(each)}, (0.0,), ()) for each in (10, 35, 70)]

    def at_slot_0(*points: WalkPoint) -> list[Arc]:
        return open_arcs({0: {}, 1: {}}, (Walk(0, -1, points),))[0]

    assert sum(at_slot_0(seen[0], hidden, seen[1])[0]) == pytest.approx(math.tau + math.radians(10.0))
    assert at_slot_0(seen[0], unseen, seen[1]) == [(0.0, math.tau)], "nobody saw the way between"
    assert at_slot_0(seen[0], hidden, seen[2]) == [(0.0, math.tau)], "too wide an arc"
    lost = [WalkPoint({1: 0.0}, (), ())] * 4
    assert at_slot_0(seen[0], *lost, seen[1]) == [(0.0, math.tau)], "the robot was not in touch"
    assert opened(Walk(0, -1, (seen[0], hidden, seen[1]))) == [(0, 360)], "the robot that saw the way has left"


def test_a_robot_in_touch_keeps_no_walk_at_the_wall() -> None:
    """The walk passes a robot that stands in an opening, behind a corner."""
    hidden = [WalkPoint({1: 0.0}, (), (1,))] * 4
    ends = [WalkPoint({0: math.radians(each)}, SOUTH, ()) for each in (10, 35)]
    views: dict[int, dict[int, float]] = {0: {}, 1: {}}
    assert open_arcs(views, (Walk(0, -1, (ends[0], *hidden, ends[1])),))[0] == [(0.0, math.tau)]
    assert open_arcs(views, (Walk(0, -1, (ends[0], *hidden[:1], ends[1])),))[0] != [(0.0, math.tau)]


def test_a_walk_closes_the_arc_that_it_was_seen_in() -> None:
    assert opened(around(10, 40, 80, hand=-1)) == [(80, 290)]


def test_the_arc_between_two_walks_stays_open() -> None:
    assert opened(around(10, 60, hand=-1), around(80, 120, 170, 220, 300, 360, hand=-1)) == [(60, 20), (0, 10)]


def test_a_wall_in_touch_closes_a_quarter_turn() -> None:
    assert opened(walls=(math.pi / 2.0,)) == [(135, 270)]


def test_a_triangle_closes_the_arc_between_its_robots() -> None:
    views = {0: {1: 0.0, 2: math.pi / 3.0}, 1: {0: math.pi, 2: 2.0}, 2: {0: -2.0, 1: -1.0}}
    arcs = open_arcs(views, ())
    assert arcs[0] == [pytest.approx((math.pi / 3.0, math.tau - math.pi / 3.0))]


# Slot 0 and slot 1 see each other, and a walk in the south from the south-east of slot 0 to the south-west of slot 1.
PAIR = {0: {1: 0.0}, 1: {0: math.pi}}
SOUTH = (math.radians(-90.0),)


def between_two(*degrees: tuple[int, int]) -> list[WalkPoint]:
    return [WalkPoint({0: math.radians(a), 1: math.radians(b)}, SOUTH, ()) for a, b in degrees]


def test_a_walk_past_two_robots_closes_the_arc_between_robot_and_wall() -> None:
    """The wall goes on beyond the lines of sight from both robots to the point of the walk."""
    points = [
        WalkPoint({0: math.radians(-70.0)}, SOUTH, ()),
        *between_two((-45, -135)),
        WalkPoint({1: math.radians(-110.0)}, SOUTH, ()),
    ]
    arcs = open_arcs(PAIR, (Walk(0, -1, tuple(points)),))
    assert arcs[0] == [pytest.approx((0.0, math.tau - math.radians(70.0)))]
    assert arcs[1] == [pytest.approx((math.pi + math.radians(70.0), math.tau - math.radians(70.0)))]


# Each walk ends beside a door that is between the two robots.
DOOR = tuple(between_two(each) for each in ((-75, -105), (-35, -145)))
PASSING = [
    WalkPoint({0: math.radians(-70.0)}, SOUTH, ()),
    *between_two((-45, -135)),
    WalkPoint({0: math.radians(-30.0), 1: math.radians(-110.0)}, SOUTH, ()),
]


def test_points_of_a_walk_count_only_while_all_robots_stand_that_saw_them() -> None:
    """The walk went on where slot 1 saw it. What it left out there was the part of slot 1."""
    walks = (Walk(0, -1, tuple(PASSING)),)
    proof = SwarmProof()
    alone = ScanResult({0: {}}, FlagComplex({0: {}}), ())
    together = ScanResult(PAIR, FlagComplex(PAIR), ())
    assert proof.update(together, walks, {}, {}, {}) == ()
    closed = _degrees(proof.open_arcs())
    assert proof.update(alone, walks, {}, {}, {}) == (0,)
    assert _degrees(proof.open_arcs()) == {0: 360}
    turned = tuple(each.turned(0, 0.0) for each in walks)
    assert proof.update(alone, turned, {}, {}, {}) == ()
    assert _degrees(proof.open_arcs()) == {0: 360}, "the slot is still gone after frames of robots became one"
    assert proof.update(together, turned, {}, {}, {}) == (0, 1)
    assert _degrees(proof.open_arcs()) == closed, "the slot is occupied again"


def test_two_points_of_walks_beside_a_door_close_nothing() -> None:
    """The triangles of the two robots with the points cross. Behind the crossing, each robot would rely on the other."""
    walks = tuple(Walk(0, -1, tuple(points)) for points in DOOR)
    assert {slot: round(sum(each.width_rad for each in arcs), 6) for slot, arcs in open_arcs(PAIR, walks).items()} == {
        0: round(math.tau, 6),
        1: round(math.tau, 6),
    }


def test_robots_in_touch_with_both_sides_of_a_door_do_not_close_it() -> None:
    """A walk in the next room is seen between the robots only. Each robot touches the end of a wall below it."""
    contacts = [math.radians(-80.0)]
    point = between_two((-45, -135))
    walks = (Walk(0, -1, tuple(point)),)
    proof = SwarmProof()
    proof.update(ScanResult(PAIR, FlagComplex(PAIR), ()), walks, {0: contacts, 1: [math.radians(-100.0)]}, {}, {})
    assert _degrees(proof.open_arcs()) == {0: 270, 1: 270}
    local = at_slot(0, PAIR, *contacts)
    pass_walk(local, point, -1)
    assert math.degrees(open_rad(local)) == pytest.approx(270.0)


@pytest.mark.parametrize(
    ("walls_deg", "open_deg"),
    [
        pytest.param((), 310, id="a body in touch fills 50 degrees"),
        pytest.param((100,), 360 - 25 - 145, id="no opening fits between the body and a wall in touch"),
        pytest.param((150,), 360 - 50 - 90, id="a wall at the other side"),
    ],
)
def test_a_robot_in_touch_closes_what_its_body_hides(walls_deg: tuple[int, ...], open_deg: int) -> None:
    scan, walls = ScanResult(PAIR, FlagComplex(PAIR), ()), [math.radians(each) for each in walls_deg]
    proof = SwarmProof()
    proof.update(scan, (), {0: walls}, {}, {0: (1,)})
    assert _degrees(proof.open_arcs()) == {0: open_deg, 1: 360}
    proof.update(ScanResult({0: {}}, FlagComplex({0: {}}), ()), (), {0: walls}, {}, {0: (1,)})
    assert _degrees(proof.open_arcs()) == {0: 360 - 90 * len(walls)}, "the robot has left the complex"
    local = SlotProof()
    local.update(0, scan, walls, (1,))
    assert math.degrees(open_rad(local)) == pytest.approx(open_deg)


@pytest.mark.parametrize(
    ("there_deg", "open_deg"),
    [
        pytest.param(-160, (310 - 25, 360 - 70 - 25), id="slot 1 sees the point behind the body: it relies on slot 0"),
        pytest.param(-150, (310 - 45, 360 - 70 - 25), id="slot 1 sees the point beside the body"),
    ],
)
def test_the_triangle_with_a_point_behind_a_body_in_touch_does_not_count(
    there_deg: int, open_deg: tuple[int, int]
) -> None:
    """A walk leads past two robots in touch."""
    points = [
        WalkPoint({0: math.radians(-70.0)}, SOUTH, ()),
        *between_two((-45, there_deg)),
        WalkPoint({1: math.radians(-110.0)}, SOUTH, ()),
    ]
    scan, proof = ScanResult(PAIR, FlagComplex(PAIR), ()), SwarmProof()
    proof.update(scan, (Walk(0, -1, tuple(points)),), {}, {}, {0: (1,), 1: (0,)})
    assert tuple(_degrees(proof.open_arcs()).values()) == open_deg
    triangle = WalkTriangle(1, 1, math.radians(there_deg + 180.0), 0, 0, 1, -1)
    local = SlotProof()
    local.inherit([ProvedArc((1,), (1,), math.radians(-45.0), math.radians(45.0), triangle)])
    local.update(0, scan, (), (1,))
    assert math.degrees(open_rad(local)) == pytest.approx(open_deg[0] + 25.0), "no step of the walk closes 25 degrees"


def test_a_wall_that_ends_before_a_point_of_another_walk_closes_no_triangle_with_it() -> None:
    """Beside their lines of sight to a point in a passage, the two robots see the corners at its mouth. Between the corners
    and the point they do not see what is behind the corners.
    """
    point = between_two((-45, -135))
    corners = [
        [WalkPoint({slot: math.radians(each)}, SOUTH, ()) for each in degrees]
        for slot, degrees in ((0, (-80, -60, -40)), (1, (-140, -120, -100)))
    ]
    walks = tuple(Walk(0, -1, tuple(points)) for points in (*corners, point))
    assert _degrees(open_arcs(PAIR, walks)) == {0: 320, 1: 320}


@pytest.mark.parametrize(
    ("seen_by_0", "open_deg"),
    [
        pytest.param({0: -55}, {0: 290, 1: 290}, id="both see the walk between their line of sight and the point"),
        pytest.param({}, {0: 290, 1: 310}, id="slot 0 sees it past a corner, and relies on slot 1"),
    ],
)
def test_a_slot_does_not_rely_on_one_that_relies_on_it_behind_a_corner(
    seen_by_0: dict[int, int], open_deg: dict[int, int]
) -> None:
    directions = {0: -70}, {1: -160, **seen_by_0}, {0: -45, 1: -135}, {0: -30, 1: -110}
    points = [WalkPoint({slot: math.radians(d) for slot, d in each.items()}, SOUTH, ()) for each in directions]
    assert _degrees(open_arcs(PAIR, (Walk(0, -1, tuple(points)),))) == open_deg


def test_an_edge_chooses_the_point_that_closes_what_no_other_edge_closes() -> None:
    """A point of the edge 0 1 closes 50 degrees at slot 1, and another one 30 degrees at slot 0.

    The edge 1 2 closes the former, too.
    """
    views = {0: {1: 0.0}, 1: {0: math.pi, 2: math.radians(100.0)}, 2: {1: math.radians(280.0)}}

    def walk(**directions: int) -> Walk:
        seen = {int(slot[1:]): degrees for slot, degrees in directions.items()}
        points = [{slot: math.radians(each + step) for slot, each in seen.items()} for step in (-2, 0, 2)]
        return Walk(0, -1, tuple(WalkPoint(each, SOUTH, ()) for each in points))

    walks = walk(_0=6, _1=130), walk(_0=30, _1=170)
    assert _degrees(open_arcs(views, walks))[0] == 348, "without the edge 1 2 the first point closes more"
    assert _degrees(open_arcs(views, (*walks, walk(_1=181, _2=230))))[0] == 328


def test_both_ends_of_an_edge_rely_on_the_same_point_of_a_walk() -> None:
    """There is a wall on both sides of a door. Slot 0 would rely on the left wall, and slot 1 on the right one."""
    left, right = ((-84, -153), (-80, -150), (-77, -148)), ((-33, -103), (-30, -100), (-26, -96))
    walks = tuple(Walk(0, -1, tuple(between_two(*each))) for each in (left, right))
    one = [_degrees(open_arcs(PAIR, (walk,))) for walk in walks]
    assert one == [{0: 276, 1: 328}, {0: 327, 1: 276}]
    both = _degrees(open_arcs(PAIR, walks))
    assert both in ({0: 276, 1: 321}, {0: 320, 1: 276}), "closed by one point, and by the steps of the other walk"


def _degrees(arcs: Mapping[int, Iterable[Arc]]) -> dict[int, int]:
    return {slot: round(math.degrees(sum(each.width_rad for each in found))) for slot, found in arcs.items()}


def test_a_walk_past_a_robot_is_no_wall() -> None:
    points = [WalkPoint({0: math.radians(each)}, (), (1,)) for each in (10, 40, 80)]
    arcs = open_arcs({0: {}, 1: {}}, (Walk(0, -1, tuple(points)),))
    assert arcs[0] == [(0.0, math.tau)]


@pytest.mark.parametrize(("at_body", "open_deg"), [(False, 280), (True, 320)])
def test_a_walk_past_a_body_without_a_slot_closes_no_arc_there(at_body: bool, open_deg: int) -> None:
    """The robot loses the wall at the body, and touches a wall again: the body may fill an opening."""
    touched: list[tuple[float, ...]] = [(0.0,), (0.0,), (), (0.0,), (0.0,)]
    points = [WalkPoint({0: math.radians(20 * n)}, each, (), at_body and not each) for n, each in enumerate(touched)]
    assert _degrees(open_arcs(ALONE, (Walk(0, -1, tuple(points)),))) == {0: open_deg}


def test_a_narrow_arc_is_open_because_an_opening_may_be_seen_along_its_wall() -> None:
    walks = around(0, 100, 200, 299, hand=-1), around(301, 330, 360, hand=-1)
    assert opened(*walks) == [(299, 2)]


SOUTH_DEG, NORTH_DEG = -90.0, 90.0


@pytest.mark.parametrize(
    ("hand", "wall_deg", "way_deg", "away"),
    [
        pytest.param(-1, SOUTH_DEG, 0.0, False, id="along the wall"),
        pytest.param(1, SOUTH_DEG, 40.0, True, id="away from a wall at the other side"),
        pytest.param(-1, SOUTH_DEG, NORTH_DEG, True, id="to the other side of a passage"),
        pytest.param(-1, SOUTH_DEG, 180.0, False, id="back along the wall"),
        pytest.param(-1, 135.0, -90.0, False, id="round a corner that is behind on the right"),
        pytest.param(1, -135.0, 90.0, False, id="round a corner that is behind on the left"),
    ],
)
def test_a_robot_that_drives_away_from_a_wall_does_not_follow_it(
    hand: int, wall_deg: float, way_deg: float, away: bool
) -> None:
    wall, way = math.radians(wall_deg), math.radians(way_deg)
    assert leaves_wall(hand, (wall,), (), 0.05 * math.cos(way), 0.05 * math.sin(way)) is away
    assert not leaves_wall(hand, (wall,), (wall,), 0.05 * math.cos(way), 0.05 * math.sin(way)), "it stays in touch"


@pytest.mark.parametrize(
    ("wall_deg", "now_deg", "way_deg", "leaves"),
    [
        pytest.param(-120.0, 60.0, 92.0, True, id="from one wall of a passage to the other"),
        pytest.param(-120.0, 120.0, 92.0, False, id="round the end of a thin wall"),
        pytest.param(-120.0, None, 92.0, False, id="round a corner behind"),
    ],
)
def test_a_robot_that_comes_to_the_opposite_wall_in_one_step_does_not_follow_the_first(
    wall_deg: float, now_deg: float | None, way_deg: float, leaves: bool
) -> None:
    """It was pushed across the passage in front of another robot, with the first wall almost behind it."""
    way, now = math.radians(way_deg), () if now_deg is None else (math.radians(now_deg),)
    assert leaves_wall(1, (math.radians(wall_deg),), now, 0.05 * math.cos(way), 0.05 * math.sin(way)) is leaves


@pytest.mark.parametrize(
    ("walls_deg", "leaves"),
    [
        pytest.param((80.0,), False, id="the wall goes on beyond the corner"),
        pytest.param((20.0,), False, id="a wall ahead, on the side of the hand"),
        pytest.param((-40.0,), True, id="the opposite corner of a door"),
        pytest.param((-40.0, 50.0), False, id="both walls of a passage"),
        pytest.param((), False, id="still round the corner"),
    ],
)
@pytest.mark.parametrize("hand", [1, -1])
def test_a_robot_that_turns_into_a_passage_does_not_follow_the_opposite_wall(
    hand: int, walls_deg: tuple[float, ...], leaves: bool
) -> None:
    walls = [math.radians(hand * each) for each in walls_deg]
    assert leaves_wall(hand, (), walls, 0.05, 0.0) is leaves
    assert not leaves_wall(hand, (), walls, 0.0, 0.0), "it did not drive"


@pytest.mark.parametrize(("left_walls", "open_deg"), [(False, 280), (True, 320)])
def test_a_walk_across_a_passage_closes_no_arc(left_walls: bool, open_deg: int) -> None:
    """The robot touches a wall, drives across the passage without a contact, and touches the other wall."""
    touched: list[tuple[float, ...]] = [SOUTH, SOUTH, (), (math.pi / 2.0,), (math.pi / 2.0,)]
    points = [
        WalkPoint({0: math.radians(20 * n)}, each, (), left_walls=left_walls and not each)
        for n, each in enumerate(touched)
    ]
    assert _degrees(open_arcs(ALONE, (Walk(0, -1, tuple(points)),))) == {0: open_deg}


def test_a_walking_robot_remembers_that_it_drove_across_a_passage() -> None:
    slots = Slots()
    slots.add(8)
    ways = (0.0, ()), (0.05, (-1.5,)), (0.1, ()), (0.15, (1.5,))
    slots.take_walk(8, -1, [Waypoint(0.0, y_m, (), walls, ()) for y_m, walls in ways])
    assert [each.left_walls for each in slots.walks[0].points] == [False, False, True, False]


def test_walks_turn_with_the_frame_in_which_they_were_seen() -> None:
    slots = Slots()
    for robot in (7, 8):
        slots.add(robot)
    slots.take(7, ())
    slots.take_walk(7, 1, (Waypoint(0.0, 0.0, (Sighting(8, 0.0),), (), ()),))
    assert slots.walks[0].points[0].seen == {}, "robot 8 is in another frame"
    slots.orient(8, 7, 0.5)
    slots.take_walk(8, 1, (Waypoint(0.0, 0.0, (Sighting(7, 0.25),), (1.0,), (7,)),))
    there, later = WalkPoint({0: 0.75 + math.pi}, (1.5,), (0,)), WalkPoint({0: 1.75 + math.pi}, (2.5,), (0,))
    assert slots.walks[1] == Walk(7, 1, (there,), stays={0: 1})
    assert slots.walks[1].turned(3, 1.0) == Walk(3, 1, (later,), stays={0: 1})


def test_a_walking_robot_remembers_that_it_touched_a_robot_without_a_slot() -> None:
    slots = Slots()
    for robot in (7, 8):
        slots.add(robot)
    slots.take_walk(8, 1, (Waypoint(0.0, 0.0, (), (), (5,)),))
    assert slots.walks[0] == Walk(8, 1, (WalkPoint({}, (), (), True),))
    assert slots.walks[0].turned(3, 1.0).points[0].at_body


# --- without a coordinator: the proof at one slot -----------------------------------------------------------------------


def at_slot(slot: int, views: Mapping[int, Mapping[int, float]], *walls: float) -> SlotProof:
    """Return the proof at a slot that touches walls in these directions [rad]."""
    proof = SlotProof()
    proof.update(slot, ScanResult(views, FlagComplex(views), ()), walls)
    return proof


def pass_walk(proof: SlotProof, points: Iterable[WalkPoint], hand: int) -> list[bool]:
    """Let a walk pass a slot; return after which points the open arcs are smaller."""
    steps: list[WallStep] = []
    smaller = []
    tracker = StretchTracker(hand, 0.0)
    for number, point in enumerate(points):
        tracker.take(number, point.at, point.walls, point.robots, point.seen)
        last = steps[-1] if steps else None
        steps.append(WallStep(None if last is None else last.point, point, hand, (), number))
        smaller.append(proof.pass_step(1, last, steps[-1], tracker.latest))
    return smaller


def open_rad(proof: SlotProof) -> float:
    return sum(each.width_rad for each in proof.open_arcs())


def test_a_slot_keeps_what_a_walk_closed_and_passes_it_on() -> None:
    """Slot 0 sees slot 1. The walk closes arcs by its steps, and an arc with slot 1."""
    proof = at_slot(0, PAIR)
    assert pass_walk(proof, PASSING, -1) == [False, True, True]
    assert proof.open_arcs() == [pytest.approx((0.0, math.tau - math.radians(70.0)))]
    assert not any(pass_walk(proof, PASSING, -1)), "nothing is new"
    heir = SlotProof()
    heir.inherit(proof.memory())
    heir.update(0, ScanResult(PAIR, FlagComplex(PAIR), ()), ())
    assert heir.open_arcs() == proof.open_arcs()
    heir.update(0, ScanResult({0: {}}, FlagComplex({0: {}}), ()), ())
    assert open_rad(heir) == pytest.approx(math.tau - math.radians(40.0)), (
        "the robot at slot 1 moves: another one comes"
    )
    heir.update(0, ScanResult(PAIR, FlagComplex(PAIR), ()), ())
    heir.lose(1)
    assert open_rad(heir) == pytest.approx(math.tau), "slot 1 is lost, which saw the walk, too"


def test_a_slot_proves_an_arc_at_a_neighbour_that_did_not_see_the_whole_walk() -> None:
    """Slot 1 does not know that there is a wall beyond the line of sight from slot 0."""
    here, there = at_slot(0, PAIR), at_slot(1, PAIR)
    pass_walk(here, PASSING, -1)
    pass_walk(there, PASSING[1:], -1)
    assert there.for_neighbours == []
    assert open_rad(there) == pytest.approx(math.tau - math.radians(25.0))
    assert [there.accept(arc) for slot, arc in here.for_neighbours if slot == 1] == [True]
    assert open_rad(there) == pytest.approx(math.tau - math.radians(70.0))
    there.lose(0)
    assert open_rad(there) == pytest.approx(math.tau), "slot 0 is lost, which is responsible for the space beyond"


def test_a_slot_proves_nothing_at_a_neighbour_beside_a_door() -> None:
    proof = at_slot(0, PAIR)
    for points in DOOR:
        pass_walk(proof, points, -1)
    assert proof.for_neighbours == []


def test_two_points_of_walks_beside_a_door_close_nothing_at_a_slot() -> None:
    """The triangles of the two robots with the points cross. Behind the crossing, each robot would rely on the other."""
    proof = at_slot(0, PAIR)
    for points in DOOR:
        pass_walk(proof, points, -1)
    assert open_rad(proof) == pytest.approx(math.tau)


def test_an_arc_behind_a_corner_stays_closed_while_the_robot_that_saw_the_way_stands() -> None:
    proof = at_slot(0, PAIR)
    before, point = (WalkPoint({0: math.radians(each)}, SOUTH, ()) for each in (-90.0, -70.0))
    tracker = StretchTracker(-1, 0.0)
    for number in (0, 1):
        tracker.take(number, before.at, SOUTH, (), (0,))
    assert proof.pass_step(1, None, WallStep(before, point, -1, (1,)), tracker.latest)
    assert open_rad(proof) == pytest.approx(math.tau - math.radians(20.0))
    proof.update(0, ScanResult({0: {}}, FlagComplex({0: {}}), ()), ())
    assert open_rad(proof) == pytest.approx(math.tau)


def test_a_walking_robot_tells_who_saw_the_way_that_a_robot_did_not_see() -> None:
    lines = Sightlines()
    assert lines.take(1, (7, 8)) == ()
    assert lines.take(2, (8,)) == ()
    assert lines.take(3, (8, 9)) == ((9, 0, ((8,),)),), "it sees the walking robot for the first time"
    assert lines.take(4, (7, 9)) == ((9, 0, ((8,),)), (7, 1, ((8,), (8, 9))))
    assert lines.take(5, (7,)) == ((7, 1, ((8,), (8, 9))),), "repeated, because the message may be lost"
    for number in range(6, 4 + RESENT_POINTS):
        assert lines.take(number, (7,))
    assert lines.take(4 + RESENT_POINTS, (7,)) == ()


def test_a_walking_robot_remembers_who_saw_the_first_and_the_last_point_that_a_robot_did_not_see() -> None:
    """They are responsible for what is behind the corner at which that robot lost it, and for where it sees it again."""
    lines = Sightlines()
    lines.take(1, (7, 8))
    lines.take(2, (8,))
    for number in range(3, 200):
        lines.take(number, (9,))
    ((node, last, between),) = lines.take(200, (7,))
    assert (node, last) == (7, 1)
    assert (between[0], between[-1]) == ((8,), (9,))
    assert () in between, "nobody is known to have seen the points that are forgotten"
    for number, seen in ((201, (8,)), (202, (9,)), (203, (8,))):
        lines.take(number, seen)
    between = next(each for each in lines.take(204, (7,)) if each[0] == 7)[2]
    assert between == ((8,), (9,), (8,))
