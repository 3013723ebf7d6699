"""A robot that takes a slot over and stands elsewhere: what the former one saw of walls closes nothing there."""

import math
from itertools import pairwise

import pytest

from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc, Walk, WalkPoint
from zwerm.agents.sensor_coverage.messages.pushes import ReferenceBearing
from zwerm.agents.sensor_coverage.neighbourhood.references import Displaced, References

EAST = math.radians(10.0)
FAR_OFF, CLOSE = math.radians(25.0), math.radians(15.0)


def three_slots() -> Slots:
    """Slots 0, 1 and 2 see each other. A robot followed a wall close to slot 1, and was seen from slots 0 and 1."""
    slots = Slots()
    for robot in (10, 11, 12):
        slots.add(robot)
    slots.learn_references(views(0.0))
    slots.near[1] = [NearArc(Arc(0.0, 1.0), 1)]
    slots.walks.append(Walk(10, 1, (WalkPoint({0: 0.5, 1: 1.5}, (0.0,), ()), WalkPoint({0: 0.6}, (0.0,), ()))))
    return slots


def views(off: float) -> dict[int, dict[int, float]]:
    """Return views in which slot 1 is seen in other directions, by an angle [rad]."""
    found = dict[int, dict[int, float]]({0: {}, 1: {}, 2: {}})
    for (a, b), there in zip(pairwise((0, 1, 2, 0)), (EAST + off, 2.0 + off, 4.0), strict=True):
        found[a][b], found[b][a] = there, there + math.pi
    return found


def test_what_a_slot_saw_of_walls_falls_when_its_new_robot_stands_elsewhere() -> None:
    slots = three_slots()
    slots.occupant[1] = 13
    slots.learn_references(views(FAR_OFF))
    assert slots.take_displaced() == (1,)
    assert slots.take_displaced() == (), "they are named once"
    assert 1 not in slots.near
    assert [tuple(each.seen) for each in slots.walks[0].points] == [(0,), (0,)]
    assert slots.direction(0, 1) == pytest.approx(EAST + FAR_OFF)


@pytest.mark.parametrize(("robot", "off"), [(13, CLOSE), (11, 0.0)])
def test_what_a_slot_saw_of_walls_remains_when_its_robot_stands_there(robot: int, off: float) -> None:
    slots = three_slots()
    walks = slots.walks
    slots.occupant[1] = robot
    slots.learn_references(views(off))
    assert slots.take_displaced() == ()
    assert slots.near[1] == [NearArc(Arc(0.0, 1.0), 1)]
    assert slots.walks is walks


@pytest.mark.parametrize(
    ("pushes", "left", "seen"),
    [
        pytest.param([0.02, -0.02, 0.02], 2, True, id="to and fro"),
        pytest.param([0.02, 0.02], 1, False, id="again and again: its own way along walls close by counts no more"),
        pytest.param([0.02, 0.02, 0.02, 0.02, 0.03], 0, False, id="far: nothing counts that the slot saw of walls"),
    ],
)
def test_what_a_slot_saw_of_walls_falls_when_others_push_its_robot_on(
    pushes: list[float], left: int, seen: bool
) -> None:
    slots = three_slots()
    stay = slots.stays.number(1, 11)
    slots.note_near(1, [NearArc(Arc(0.0, 1.0), 1, 11), NearArc(Arc(0.0, 0.5), 1)])
    for each in pushes:
        slots.note_push(1, (each, 0.0))
    slots.take_replaced()
    assert len(slots.near.get(1, ())) == left
    assert (slots.stays.number(1, 11) == stay) is seen
    assert (1 in slots.walks[0].points[0].seen) is (slots.take_displaced() == ())


def test_another_robot_at_a_slot_was_not_pushed_yet() -> None:
    slots = three_slots()
    slots.note_push(1, (0.09, 0.0))
    slots.occupant[1] = 13
    slots.note_push(1, (0.09, 0.0))
    assert slots.take_displaced() == ()
    slots.note_push(1, (0.02, 0.0))
    assert slots.take_displaced() == (1,)


def test_both_slots_are_displaced_when_no_robot_is_new() -> None:
    """Nobody knows which of the two robots has moved."""
    slots = three_slots()
    moved = views(0.0)
    moved[0][1], moved[1][0] = EAST + FAR_OFF, EAST + FAR_OFF + math.pi
    slots.learn_references(moved)
    assert slots.take_displaced() == (0, 1)


def test_a_robot_that_stands_less_than_a_body_beside_its_slot_is_not_displaced() -> None:
    slots = three_slots()
    slots.occupant[1] = 13
    slots.length_m = {(0, 1): 0.2, (1, 2): 0.2}
    slots.learn_references(views(FAR_OFF))
    assert slots.take_displaced() == ()
    assert slots.direction(0, 1) == pytest.approx(EAST + FAR_OFF)


@pytest.mark.parametrize(
    ("ways", "remains"),
    [
        pytest.param(((0.5, 0.0), (0.45, 0.0)), True, id="as far as the first robot"),
        pytest.param(((0.5, 0.0), (0.62, 0.0)), False, id="farther, in the same direction"),
        pytest.param(((0.5, 0.0), (0.49, 0.11)), False, id="as far, in another direction"),
        pytest.param(((0.5, 0.0), (0.44, 0.0), (0.38, 0.0)), False, id="less far from robot to robot"),
        pytest.param(((0.5, 0.0),), True, id="the first robot of the slot"),
    ],
)
def test_a_slot_is_displaced_where_bearings_do_not_show_it(
    ways: tuple[tuple[float, float], ...], remains: bool
) -> None:
    """The robots that the slot sees are all in one line with it, or stand beside their slots, too."""
    slots = three_slots()
    for number, way in enumerate(ways):
        slots.note_way(0, 1, way, by_odometry=number > 0)
    assert (1 in slots.near) is remains
    assert slots.take_displaced() == (), "attempts are not counted anew"


def test_a_robot_that_drove_as_far_as_was_measured_stands_at_its_slot() -> None:
    slots = three_slots()
    slots.length_m[0, 1] = 0.5
    slots.note_way(0, 1, (0.5, 0.0), by_odometry=True)
    assert 1 in slots.near


def test_a_slot_to_which_nobody_drove_before_may_be_displaced() -> None:
    slots = three_slots()
    slots.note_way(0, 1, (0.5, 0.0), by_odometry=True)
    assert 1 not in slots.near
    assert [tuple(each.seen) for each in slots.walks[0].points] == [(0,), (0,)]


@pytest.mark.parametrize("at_landmarks", [True, False])
def test_a_robot_that_found_its_place_by_robots_that_stood_still_is_at_its_slot(at_landmarks: bool) -> None:
    """It may have driven around a corner, or from a slot of which the distance was measured with an error."""
    slots = three_slots()
    slots.note_way(0, 1, (0.5, 0.0), by_odometry=False)
    slots.note_way(0, 1, (0.7, 0.2), by_odometry=False, at_landmarks=at_landmarks)
    assert (1 in slots.near) is at_landmarks


@pytest.mark.parametrize(("off_deg", "remains"), [(12.0, False), (5.0, True)])
def test_walls_close_by_are_forgotten_where_a_new_robot_stands_beside_its_slot(off_deg: float, remains: bool) -> None:
    slots = three_slots()
    walks = slots.walks
    slots.note_way(0, 1, (0.9, 0.0), by_odometry=False)
    slots.occupant[1] = 13
    slots.learn_references(views(math.radians(off_deg)))
    assert (1 in slots.near) is remains
    assert slots.walks is walks, "walls farther off are seen in nearly the same directions"
    assert slots.take_displaced() == ()


@pytest.mark.parametrize(
    ("ways", "displaced"),
    [
        pytest.param(((0.5, 0.0), (0.45, 0.0)), [False, False], id="as far as the first robot"),
        pytest.param(((0.5, 0.0), (0.62, 0.0)), [False, True], id="farther, in the same direction"),
        pytest.param(((0.5, 0.0), (0.62, 0.0), (0.62, 0.0)), [False, True, False], id="where the displaced one stood"),
        pytest.param(((0.5, 0.0), (0.44, 0.0), (0.38, 0.0)), [False, False, True], id="less far from robot to robot"),
    ],
)
def test_without_a_coordinator_a_way_shows_a_robot_that_stands_elsewhere(
    ways: tuple[tuple[float, float], ...], displaced: list[bool]
) -> None:
    """Each robot inherits the ways of the one before, and its bearings are those of the first one."""
    found, bearings = References(), (ReferenceBearing(0, 7, 0.0, 1),)
    shown = []
    for way in ways:
        shown.append(found.take_way(3, way))
        found = References(bearings, ((slot, *each) for slot, each in found.ways.items()))
    assert shown == displaced
    assert not found.take_way(4, (9.0, 9.0)), "nobody came from there before"


@pytest.mark.parametrize(
    ("readers", "displaced"),
    [
        pytest.param((7, 7), Displaced.SELF, id="one robot, read twice"),
        pytest.param((7, 8), Displaced.OTHER, id="another robot at the other slot"),
    ],
)
def test_without_a_coordinator_a_bearing_shows_which_robot_stands_elsewhere(
    readers: tuple[int, int], displaced: Displaced
) -> None:
    found, there_rad = References(), (0.0, math.radians(60.0))
    shown = [
        found.take(node, 3, (1, number, 1, number), there, there + math.pi, 0.5)
        for number, (node, there) in enumerate(zip(readers, there_rad, strict=True))
    ]
    assert shown == [Displaced.NONE, displaced]
