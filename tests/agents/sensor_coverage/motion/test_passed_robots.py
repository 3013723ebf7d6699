"""A walking robot passes another one in touch along a wall: what that one knows of the wall beside it.

The wall is in the south, at y = 0. The walking robot goes east, and around the standing one on its north side.
"""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, Walk, WalkPoint, contains
from zwerm.agents.sensor_coverage.motion.walls.passed_robots import passed_robots

RADIUS_M = 0.07
SLOT = 3
PLACE = 0.0, 0.12
SOUTH = (-math.pi / 2.0,)
# Along the wall; around the robot, in touch with it; and along the wall again.
BEFORE = [(-0.05 * each, RADIUS_M) for each in range(12, 2, -1)]
AROUND = [
    (PLACE[0] + 0.14 * math.cos(math.radians(each)), PLACE[1] + 0.14 * math.sin(math.radians(each)))
    for each in range(201, -22, -20)
]
AFTER = [(0.05 * each, RADIUS_M) for each in range(3, 13)]


def walk_past(left_at: int = -1) -> Walk:
    """Return the walk. Its robot leaves the wall on the way to the point with the number `left_at`."""
    points = list[WalkPoint]()
    for number, (x, y) in enumerate((*BEFORE, *AROUND, *AFTER)):
        around = len(BEFORE) <= number < len(BEFORE) + len(AROUND)
        at_wall = y < RADIUS_M + 0.002
        there = {SLOT: math.atan2(y - PLACE[1], x - PLACE[0])}
        robots = (SLOT,) if around else ()
        points.append(WalkPoint(there, SOUTH if at_wall else (), robots, left_walls=number == left_at, at=(x, y)))
    return Walk(0, -1, tuple(points), RADIUS_M, stays={SLOT: 8})


def closed(walk: Walk, reach_m: float = 0.95) -> tuple[bool, ...]:
    """Return whether the directions to the wall at these places [m] along it are closed, and the one straight to it."""
    arcs = [Arc(*each) for passed in passed_robots(walk, reach_m) for each in passed.walls.followed]
    there = (math.atan2(-PLACE[1], x) for x in (-0.55, -0.2, 0.0, 0.2, 0.55))
    return tuple(contains(arcs, Arc(each, 0.0)) for each in there)


def test_a_passed_robot_knows_the_wall_on_both_sides() -> None:
    assert {(each.slot, each.hand) for each in passed_robots(walk_past(), 0.95)} == {(SLOT, 1), (SLOT, -1)}
    assert closed(walk_past()) == (True, True, False, True, True), "behind the robot nobody followed it"


def test_a_passed_robot_knows_the_wall_up_to_its_reach() -> None:
    assert closed(walk_past(), 0.4) == (False, True, False, True, False)


def test_a_passed_robot_does_not_know_a_wall_that_was_left_before_the_contact() -> None:
    assert closed(walk_past(left_at=5)) == (False, True, False, True, True)


def test_a_robot_that_is_not_in_sight_has_no_known_place() -> None:
    walk = walk_past()
    assert not list(passed_robots(walk._replace(points=tuple(each.unseen_by((SLOT,)) for each in walk.points)), 0.95))


@pytest.mark.parametrize(
    "part",
    [slice(None), slice(len(BEFORE), None), slice(len(BEFORE) + len(AROUND))],
    ids=["before and after", "only after the contact", "only before it"],
)
@pytest.mark.parametrize(("off_m", "is_known"), [(0.08, True), (0.4, False)])
def test_a_contact_in_the_direction_of_a_robot_farther_away_is_not_with_it(
    off_m: float, is_known: bool, part: slice
) -> None:
    """It is with a corner of the wall. The robot stands behind it, and sees the walking robot in other directions."""
    walk = walk_past()
    behind = PLACE[0], PLACE[1] - off_m
    points = tuple(
        each if each.robots else each._replace(seen={SLOT: math.atan2(each.at[1] - behind[1], each.at[0] - behind[0])})
        for each in walk.points[part]
    )
    assert bool(list(passed_robots(walk._replace(points=points), 0.95))) is is_known
