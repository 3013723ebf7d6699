"""Bearings in 256 steps of a full turn, and conclusions from a set of them about the place of the observer.

A step is 1.4 degrees, less than the standard deviation of the sensor (pi/72), and fits into a byte of a message. All robots
draw the same conclusions from an observation because all use these steps.
"""

import math
from collections.abc import Iterable, Sequence
from operator import sub
from typing import Final, NamedTuple

# Landmark ids are below this.
LANDMARKS_MAX: Final = 1 << 16

STEPS: Final = 256
HALF: Final = STEPS // 2
_PER_RAD: Final = STEPS / (2.0 * math.pi)


class BearingSnapshot(NamedTuple):
    """An observation: the ids of the landmarks seen, ascending, and the bearing of each in steps, in the compass frame."""

    landmarks: tuple[int, ...]
    bearings: tuple[int, ...]


def to_steps(bearing_rad: float) -> int:
    """Return a bearing in steps, in [0, STEPS)."""
    return round(bearing_rad * _PER_RAD) % STEPS


def all_to_steps(bearings_rad: Iterable[float]) -> tuple[int, ...]:
    """Return bearings in steps, each in [0, STEPS)."""
    return tuple([round(each * _PER_RAD) % STEPS for each in bearings_rad])


def to_rad(steps: int) -> float:
    """Return a bearing [rad] in [0, 2 pi)."""
    return steps / _PER_RAD


def is_left(bearing_a: int, bearing_b: int) -> bool:
    """Return whether the observer stands left of the line from landmark a to landmark b.

    It does iff the relative bearing (theta_b - theta_a) mod 2 pi is in (0, pi).
    """
    return 0 < (bearing_b - bearing_a) % STEPS < HALF


def widest_gap(bearings: Sequence[int]) -> int:
    """Return the widest angle between adjacent bearings in steps; STEPS for fewer than two."""
    if len(bearings) < 2:
        return STEPS
    ordered = sorted(bearings)
    gaps: list[int] = [ordered[0] - ordered[-1] + STEPS, *map(sub, ordered[1:], ordered)]
    return max(gaps)


def is_inside(bearings: Sequence[int]) -> bool:
    """Return whether the observer stands inside the convex hull of the landmarks it sees.

    It does iff there are three or more and no two adjacent bearings are pi or more apart (section IV-A, Fig. 4).
    """
    return widest_gap(bearings) < HALF
