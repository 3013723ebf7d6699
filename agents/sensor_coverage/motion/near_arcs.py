"""The arcs around a slot that its robot closes when it leaves the slot along a wall close to it, by odometry."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import (
    direction_of,
    ends_of_stretch,
    kept_part,
    touched_point,
)
from zwerm.agents.sensor_coverage.frontier.wall_proof import SAME_WALL_RAD
from zwerm.agents.sensor_coverage.motion.homing import Vector

# Points closer [m] to the start have no direction from there.
NEAR_M_MIN: Final = 0.02
# Two contacts at the same point that differ by less than this [rad] are the walls of a corner.
CORNER_RAD: Final = math.radians(125.0)


class NearPoint(NamedTuple):
    """A point [m] of the way along a wall close to the start, and the directions of touched walls [rad].

    `at_body` is true if a dead robot is in touch.
    """

    at: Vector
    walls: tuple[float, ...]
    at_body: bool = False


def arcs_around(
    start: Vector, points: Sequence[NearPoint], hand: int, radius_m: float
) -> tuple[tuple[float, float], ...]:
    """Return the arcs (start, width) [rad] around a start in which a wall was followed in touch, by odometry.

    Two successive points close the arc between them, if the wall is beyond, up to the touched points at the ends of a stretch
    (`frontier.strips.loose_ends`). Two successive contacts with the same wall
    close the arc between the touched points of the wall. So do two contacts at the same point, because a body does not pass
    between them. A dead robot may fill an opening: from there on only the same wall closes an arc, up to the next wall.
    """
    found = list[tuple[float, float]]()
    at_body = False
    stretch: list[NearPoint] = []
    for before, point in pairwise(points):
        at_body = before.at_body or (at_body and not before.walls)
        same = [(a, b) for a in before.walls for b in point.walls if angle_between(a, b) < SAME_WALL_RAD]
        if same or (bool(before.walls or point.walls) and not (at_body or point.at_body)):
            stretch = [*(stretch or [before]), point]
        else:
            found += _arcs_of_stretch(start, stretch, hand, radius_m)
            stretch = []
        for a, b in combinations(point.walls, 2):
            if angle_between(a, b) < CORNER_RAD:
                ends = (touched_point(point.at, each, radius_m) for each in (a, b))
                found.append(_between(start, *ends))
        for a, b in same:
            found.append(_between(start, touched_point(before.at, a, radius_m), touched_point(point.at, b, radius_m)))
    found += _arcs_of_stretch(start, stretch, hand, radius_m)
    return tuple((a, width) if width >= 0.0 else (a + width, -width) for a, width in found)


def _arcs_of_stretch(
    start: Vector, points: Sequence[NearPoint], hand: int, radius_m: float
) -> Iterator[tuple[float, float]]:
    """Yield the arcs (start, width) [rad] around a start that the steps along one stretch of wall close."""
    touching = [number for number, each in enumerate(points) if each.walls]
    if len(touching) < 2:
        return
    points = points[touching[0] : touching[-1] + 1]
    ends = ends_of_stretch([(each.at, each.walls) for each in points if each.walls], hand, radius_m)
    for before, point in pairwise(points):
        first, width = _between(start, before.at, point.at)
        if min(math.dist(start, each.at) for each in (before, point)) > NEAR_M_MIN and width * hand < 0.0:
            # the start and the wall are on different sides of the step
            low, high = kept_part(before.at, point.at, first, width, ends)
            if low < high:
                yield first + low * width, (high - low) * width


def _between(start: Vector, a: Vector, b: Vector) -> tuple[float, float]:
    """Return the direction [rad] of a point from the start, and the angle from there to another point."""
    first = direction_of(start, a)
    return first, math.remainder(direction_of(start, b) - first, math.tau)
