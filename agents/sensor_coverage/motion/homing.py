"""Bearing-only visual homing in the plane: the offset to the goal from which landmarks have the desired bearings.

Let g be the unit vector towards a landmark as it is seen, and g* the same vector at the goal. The gradient of Tron and
Daniilidis 2014 is sum(g - g*). Near the goal it is -M x offset / distance, where M = sum(I - g* g*^T). Division by M is
the paper's "adaptive gain" (Ramaithitima et al. 2015, section II-D). Landmarks in one line leave one direction of M
empty: bearings do not determine the offset in that direction.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

# An eigenvalue of M below this means that all landmarks are within about 22 degrees of one line.
EIGENVALUE_MIN = 0.15

Vector = tuple[float, float]


class Offset(NamedTuple):
    """The offset to the goal, in units of the landmarks' distance.

    `blind` is the unit direction in which the offset is unknown, or None. `known` is False if bearings determine
    nothing. `spread` is the trace of M^-1: the variance of the offset per variance of a bearing.
    """

    x: float
    y: float
    blind: Vector | None
    known: bool
    spread: float = 0.0


def offset(pairs: Iterable[tuple[Vector, Vector]]) -> Offset:
    """Return the offset to the goal, from (g, g*) pairs of unit vectors."""
    ex = ey = mxx = mxy = myy = 0.0
    for (gx, gy), (wx, wy) in pairs:
        ex += gx - wx
        ey += gy - wy
        mxx += 1.0 - wx * wx
        mxy -= wx * wy
        myy += 1.0 - wy * wy
    middle, half = (mxx + myy) / 2.0, math.hypot((mxx - myy) / 2.0, mxy)
    large, small = middle + half, middle - half
    if large < EIGENVALUE_MIN:
        return Offset(0.0, 0.0, None, False)
    if small >= EIGENVALUE_MIN:
        det = mxx * myy - mxy * mxy
        return Offset((myy * ex - mxy * ey) / det, (mxx * ey - mxy * ex) / det, None, True, (mxx + myy) / det)
    # The direction of the large eigenvalue. With several landmarks in one line it is perpendicular to that line.
    angle = 0.5 * math.atan2(2.0 * mxy, mxx - myy)
    ux, uy = math.cos(angle), math.sin(angle)
    along = (ux * ex + uy * ey) / large
    return Offset(along * ux, along * uy, (-uy, ux), True, 1.0 / large)


def unit(angle_rad: float) -> Vector:
    """Return the unit vector at an angle."""
    return math.cos(angle_rad), math.sin(angle_rad)


def slide(x: float, y: float, touched: Iterable[float]) -> Vector:
    """Return a velocity without its components into walls touched at these bearings [rad]: the robot slides along them."""
    for bearing in touched:
        nx, ny = unit(bearing)
        into = x * nx + y * ny
        if into > 0.0:
            x, y = x - into * nx, y - into * ny
    return x, y
