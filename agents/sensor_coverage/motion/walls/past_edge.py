"""When a robot that follows a wall is past the edge of an open arc around its slot."""

import math
from collections.abc import Callable
from typing import Final

from zwerm.agents.sensor_coverage.motion.homing import Vector

# A robot goes past an edge of an open arc for this length [m] at most, and if the edge is within this angle [rad].
EDGE_M_MAX: Final = 0.7
HALF_RAD_MAX: Final = math.radians(60.0)
# Past the edge it goes on for so many radii of its body.
PAST_RADII: Final = 1.5


def past_edge(
    position: Callable[[], Vector],
    radius_m: float,
    bearing_rad: float,
    hand: int,
    half_rad: float,
    start: Vector,
    clear_m: float = math.inf,
) -> Callable[[], bool]:
    """Return a question: is the robot past the direction `half_rad` beside a bearing from its start, or `clear_m` away?

    `position` returns where the robot is [m]. With the wall at its left `hand`, +1, it moves to the right.
    """
    past = list[Vector]()

    def is_past() -> bool:
        here = position()
        there = math.atan2(here[1] - start[1], here[0] - start[0])
        beside = hand * math.remainder(bearing_rad - there, math.tau)
        if not past and beside >= min(half_rad, HALF_RAD_MAX) and math.dist(start, here) > radius_m / 2.0:
            past.append(here)
        is_beyond = bool(past) and math.dist(past[0], here) >= PAST_RADII * radius_m
        return is_beyond or math.dist(start, here) >= clear_m

    return is_past
