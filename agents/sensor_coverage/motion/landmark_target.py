"""The point to drive to, from the bearings of landmarks and from odometry."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from zwerm.agents.sensor_coverage.messages.commands import Landmark
from zwerm.agents.sensor_coverage.motion.homing import Offset, Vector, offset, unit


class TargetPoint(NamedTuple):
    """The offset [m] to the goal of a move.

    `used_odometry`: odometry determined part of it, because the bearings of all landmarks do not. `used_moving_landmarks`: the
    landmarks that stand still do not determine it. `spread` is the variance of the offset per variance of a bearing.
    """

    x: float
    y: float
    used_odometry: bool = False
    used_moving_landmarks: bool = False
    spread: float = 0.0

    @property
    def distance_m(self) -> float:
        """Distance [m] to the goal."""
        return math.hypot(self.x, self.y)


def target_point(
    landmarks: Sequence[Landmark], seen: Mapping[int, float], by_odometry: Vector | None, hop_m: float
) -> TargetPoint:
    """Return the offset to the goal of a move; `by_odometry` is its offset [m] by odometry alone, None if that is unknown.

    Landmarks that stand still determine it if there are enough of them. A single landmark determines no offset. A landmark
    that drives is up to a hop away from the place that its bearing refers to, and odometry is off by a small fraction of
    a hop. So odometry determines the offset until enough landmarks stand. Without it landmarks that drive do: they will stand
    where their bearings refer to.
    """
    rx, ry = by_odometry or (0.0, 0.0)
    found, pairs = Offset(0.0, 0.0, None, False), []
    for still in (True, False):
        pairs = [
            (unit(seen[each.node]), unit(each.bearing_rad))
            for each in landmarks
            if each.node in seen and (each.still or not still)
        ]
        found = offset(pairs)
        if found.known and found.blind is None:
            x, y = (found.x * hop_m, found.y * hop_m) if still or by_odometry is None else by_odometry
            return TargetPoint(x, y, False, not still, found.spread)
    if len(pairs) < 2 or not found.known or found.blind is None:
        return TargetPoint(rx, ry, used_odometry=True)
    bx, by = found.blind
    along = rx * bx + ry * by
    moving = not all(each.still for each in landmarks if each.node in seen)
    return TargetPoint(found.x * hop_m + along * bx, found.y * hop_m + along * by, True, moving, found.spread)
