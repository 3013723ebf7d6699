"""The walls close to robots that a walking robot passes in touch, by its odometry.

A robot in touch is two radii away, in the direction of its bearing. So its place is known on the way along the wall, before
the contact and after it. It closes the walls there as if it had left its slot for them and come back (`near_arcs`). A passed
robot is pushed aside, and returns to where it stood: its place is that of the first contact. A contact with a wall in the
direction of a robot farther away counts as one with that robot (`touched_robots`). Then it saw the walking robot before in
other directions than from that place.
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
    for slot in walk.robots:
        for first, last in _contacts(walk.points, slot):
            met = walk.points[first]
            place = place_of_robot(met.at, met.seen[slot], walk.radius_m)
            sides = tuple(_before(walk.points, first)), walk.points[last:]
            if not _stood(slot, place, sides, walk.radius_m):
                continue
            for hand, points in zip((-walk.hand, walk.hand), sides, strict=True):
                way = list(_near_points(points, slot, place, reach_m))
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


def _stood(slot: int, place: Vector, sides: Iterable[Iterable[WalkPoint]], radius_m: float) -> bool:
    """Return whether the robot of a slot stood at a place [m], by the directions in which it saw the points of a walk.

    The points before the contact show it, if there are any. During the contact the walking robot pushes it aside.
    """
    for points in sides:
        seen = [each for each in points if slot in each.seen and slot not in each.robots]
        if seen:
            return all(_may_see(place, each.at, each.seen[slot], radius_m) for each in seen)
    return True


def _may_see(place: Vector, at: Vector, there: float, radius_m: float) -> bool:
    """Return whether a robot near a place [m] may see another place in the direction `there` [rad]."""
    (x, y), (ux, uy) = (at[0] - place[0], at[1] - place[1]), unit(there)
    ahead_m, aside_m = x * ux + y * uy, abs(x * uy - y * ux)
    return ahead_m > radius_m - OFF_M and aside_m < OFF_M + OFF_RAD * ahead_m


def _near_points(points: Iterable[WalkPoint], slot: int, place: Vector, reach_m: float) -> Iterator[NearPoint]:
    """Yield the points from a contact on up to the next one with the same robot, or up to one out of reach."""
    for number, each in enumerate(points):
        if math.dist(each.at, place) > reach_m or (number and slot in each.robots):
            return
        at_body = each.at_body or any(other != slot for other in each.robots)
        yield NearPoint(each.at, each.walls, each.at_body, at_body)
