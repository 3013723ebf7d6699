"""The walls close to robots that a walking robot passes in touch, by its odometry.

A robot in touch is two radii away, in the direction of its bearing. So its place is known on the way along the wall, before
the contact and after it. It closes the walls there as if it had left its slot for them and come back (`near_arcs`). A passed
robot is pushed aside, and returns to where it stood: its place is that of the first contact. A contact with a wall in the
direction of a robot farther away may count as one with that robot (`touched_robots`). A place from which it would have seen
the walking robot before or after in other directions does not count.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import place_of_robot
from zwerm.agents.sensor_coverage.frontier.wall_proof import Walk, WalkPoint
from zwerm.agents.sensor_coverage.messages.commands import NearWalls
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit
from zwerm.agents.sensor_coverage.motion.walls.near_arcs import FollowedWay, NearPoint, walls_around

# From the place of the contact, a passed robot saw the walking robot so close [m] to where that was, and so close [rad] to its
# direction: it may have been pushed already, and bearings have noise.
OFF_M: Final = 0.1
OFF_RAD: Final = math.radians(10.0)


class PassedRobot(NamedTuple):
    """A slot whose robot was passed, the walls around it, and the hand at them on the way from the contact."""

    slot: int
    walls: NearWalls
    hand: int


def passed_robots(walk: Walk, reach_m: float) -> Iterator[PassedRobot]:
    """Yield what a walk closes around each robot in touch, twice for each contact: on the way there, and from there on.

    Points count up to the first one farther from the robot than `reach_m`.
    """
    for slot in walk.stays:
        for first, last in _contacts(walk.points, slot):
            met = walk.points[first]
            place = place_of_robot(met.at, met.seen[slot], walk.radius_m)
            sides = _before(walk.points, first), walk.points[last:]
            ways = [list(_in_reach(points, slot, place, reach_m)) for points in sides]
            if all(_may_see(place, each, slot, walk.radius_m) for points in ways for each in points):
                for hand, points in zip((-walk.hand, walk.hand), ways, strict=True):
                    way = [_near_point(each, slot) for each in points]
                    yield PassedRobot(slot, walls_around(place, FollowedWay(way, hand, walk.radius_m, True)), hand)


def _contacts(points: tuple[WalkPoint, ...], slot: int) -> Iterator[tuple[int, int]]:
    """Yield the numbers of the first and the last point of each contact with the robot of a slot, which it sees there."""
    first: int | None = None
    for number, each in enumerate(points):
        if slot in each.robots and slot in each.seen:
            first = number if first is None else first
        elif first is not None:
            yield first, number - 1
            first = None
    if first is not None:
        yield first, len(points) - 1


def _before(points: tuple[WalkPoint, ...], first: int) -> Iterator[WalkPoint]:
    """Yield the points before a contact and its first one, backwards, as long as the robot followed the wall."""
    for each in points[first::-1]:
        yield each
        if each.left_walls:
            return


def _in_reach(points: Iterable[WalkPoint], slot: int, place: Vector, reach_m: float) -> Iterator[WalkPoint]:
    """Yield the points from a contact on up to the next one with the same robot, or up to one out of reach."""
    for number, each in enumerate(points):
        if math.dist(each.at, place) > reach_m or (number and slot in each.robots):
            return
        yield each


def _may_see(place: Vector, point: WalkPoint, slot: int, radius_m: float) -> bool:
    """Return whether the robot of a slot may have seen a point from near a place [m] in the direction that is known.

    While it is in touch, it may be pushed aside.
    """
    if slot not in point.seen or slot in point.robots:
        return True
    (x, y), (ux, uy) = (point.at[0] - place[0], point.at[1] - place[1]), unit(point.seen[slot])
    ahead_m, aside_m = x * ux + y * uy, abs(x * uy - y * ux)
    return ahead_m > radius_m - OFF_M and aside_m < OFF_M + OFF_RAD * ahead_m


def _near_point(point: WalkPoint, slot: int) -> NearPoint:
    """Return a point of a walk as one of a way close to the robot of a slot."""
    return NearPoint(point.at, point.walls, point.at_body or any(other != slot for other in point.robots))
