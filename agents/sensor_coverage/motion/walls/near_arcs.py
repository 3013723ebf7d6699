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
from zwerm.agents.sensor_coverage.frontier.wall_proof import CONTACT_RAD, SAME_WALL_RAD, drives_away
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit

# Points closer [m] to the start have no direction from there.
NEAR_M_MIN: Final = 0.02
# Two contacts at the same point that differ by less than this [rad] are the walls of a corner. The walls of a passage as wide
# as a body differ by 150 degrees or more, as two switches show them. So do those of a wedge, but there the robot turns back.
CORNER_RAD: Final = math.radians(125.0)
WEDGE_RAD: Final = math.radians(175.0)
# A way shorter than this [m] leads nowhere: the robot is wedged.
WEDGED_M: Final = 0.005
# The place of a touched point is known within this part of a body's radius, by the width of a switch. So far a wall goes on
# beyond it: two walks from the same slot that begin at the same point leave no gap.
OVERHANG: Final = math.sin(CONTACT_RAD)


class NearPoint(NamedTuple):
    """A point [m] of the way along a wall close to the start, and the directions of touched walls [rad].

    `at_body` is true if a dead robot is in touch, and `at_robot` if any robot is but the one at the start.
    """

    at: Vector
    walls: tuple[float, ...]
    at_body: bool = False
    at_robot: bool = False


def arcs_around(
    start: Vector, points: Sequence[NearPoint], hand: int, radius_m: float
) -> tuple[tuple[float, float], ...]:
    """Return the arcs (start, width) [rad] around a start in which a wall was followed in touch, by odometry.

    Two successive points close the arc between them, if the wall is beyond, up to the touched points at the ends of a stretch
    (`frontier.strips.loose_ends`), and a part of a body beyond. Two successive contacts with the same wall close the arc
    between the touched points of the wall. So do two contacts at the same point, because a body does not pass between them:
    those of a corner, or of a wedge from which the robot turned back. A dead robot may fill an opening: from there on only
    the same wall closes an arc, up to the next wall. A step from one wall to the opposite one closes nothing.
    """
    found = list[tuple[float, float]]()
    for number, each in enumerate(points):
        limit_rad = WEDGE_RAD if _turns_back(start, points, number) else CORNER_RAD
        for a, b in combinations(each.walls, 2):
            if angle_between(a, b) < limit_rad:
                found.append(_between(start, *(touched_point(each.at, wall, radius_m) for wall in (a, b))))
    at_body = False
    stretch: list[NearPoint] = []
    begins_clear = False
    for before, point in pairwise(points):
        at_body = before.at_body or (at_body and not before.walls)
        leaves = drives_away(hand, before.walls, point.walls, point.at[0] - before.at[0], point.at[1] - before.at[1])
        same = [(a, b) for a in before.walls for b in point.walls if angle_between(a, b) < SAME_WALL_RAD]
        if not leaves and (same or (bool(before.walls or point.walls) and not (at_body or point.at_body))):
            begins_clear = begins_clear if stretch else not before.at_robot
            stretch = [*(stretch or [before]), point]
        else:
            is_clear = begins_clear, not (before.at_robot or point.at_robot)
            found += _arcs_of_stretch(start, stretch, hand, radius_m, is_clear)
            stretch = []
        for a, b in same:
            found.append(_between(start, touched_point(before.at, a, radius_m), touched_point(point.at, b, radius_m)))
    is_clear = begins_clear, bool(points) and not points[-1].at_robot
    found += _arcs_of_stretch(start, stretch, hand, radius_m, is_clear)
    return tuple((a, width) if width >= 0.0 else (a + width, -width) for a, width in found)


def _turns_back(start: Vector, points: Sequence[NearPoint], number: int) -> bool:
    """Return whether walls alone made the robot turn back at a point of its way, or wedged it."""
    if number + 1 == len(points) or points[number].at_robot:
        return False
    before, at, after = (start if number == 0 else points[number - 1].at), points[number].at, points[number + 1].at
    on = after[0] - at[0], after[1] - at[1]
    return math.hypot(*on) < WEDGED_M or (at[0] - before[0]) * on[0] + (at[1] - before[1]) * on[1] < 0.0


def _arcs_of_stretch(
    start: Vector, points: Sequence[NearPoint], hand: int, radius_m: float, is_clear: tuple[bool, bool]
) -> Iterator[tuple[float, float]]:
    """Yield the arcs (start, width) [rad] around a start that the steps along one stretch of wall close.

    `is_clear` states for each end whether no robot was in touch there: one may stand in an opening.
    """
    touching = [number for number, each in enumerate(points) if each.walls]
    if len(touching) < 2:
        return
    points = points[touching[0] : touching[-1] + 1]
    ends = ends_of_stretch([(each.at, each.walls) for each in points if each.walls], hand, radius_m)
    for end, sign, clear in zip(ends, (1, -1), is_clear, strict=True):
        if clear:  # from the touched point along the wall, away from the stretch
            ux, uy = unit(direction_of(end.at, end.touched) + sign * hand * math.pi / 2.0)
            beyond = end.touched[0] + OVERHANG * radius_m * ux, end.touched[1] + OVERHANG * radius_m * uy
            yield _between(start, end.touched, beyond)
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
