"""The walls close to robots that a walking robot passes in touch, by its odometry.

A robot in touch is two radii away, in the direction of its bearing. So its place is known on the way along the wall, before
the contact and after it. It closes the walls there as if it had left its slot for them and come back (`near_arcs`). A passed
robot is pushed aside, and returns to where it stood: its place is that of the first contact.
"""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import place_of_robot
from zwerm.agents.sensor_coverage.frontier.wall_proof import Walk, WalkPoint
from zwerm.agents.sensor_coverage.messages.commands import NearWalls
from zwerm.agents.sensor_coverage.motion.homing import Vector
from zwerm.agents.sensor_coverage.motion.walls.near_arcs import FollowedWay, NearPoint, walls_around


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
            for hand, points in ((-walk.hand, _before(walk.points, first)), (walk.hand, walk.points[last:])):
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


def _near_points(points: Iterable[WalkPoint], slot: int, place: Vector, reach_m: float) -> Iterator[NearPoint]:
    """Yield the points from a contact on up to the next one with the same robot, or up to one out of reach."""
    for number, each in enumerate(points):
        if math.dist(each.at, place) > reach_m or (number and slot in each.robots):
            return
        at_body = each.at_body or any(other != slot for other in each.robots)
        yield NearPoint(each.at, each.walls, each.at_body, at_body)
