"""Bearing-only visual homing in the plane: where am I from the place at which I would see these bearings?

With g the unit vector towards a landmark as it is seen, and g* as it is to be seen, the gradient of Tron and Daniilidis 2014
is sum(g - g*). Near the place it is -M x offset / distance, where M = sum(I - g* g*^T); dividing by M is the paper's
"adaptive gain" (Ramaithitima et al. 2015, section II-D). Landmarks in one line leave one direction of M empty: there bearings
say nothing.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

# An eigenvalue of M below this: all landmarks are within about 22 degrees of one line.
EIGENVALUE_MIN = 0.15

Vector = tuple[float, float]


class Offset(NamedTuple):
    """How far the place is, in units of the landmarks' distance, and the unit direction that is unknown, if one is."""

    x: float
    y: float
    blind: Vector | None
    known: bool
    spread: float = 0.0  # trace of M^-1: the variance per that of a bearing


def offset(pairs: Iterable[tuple[Vector, Vector]]) -> Offset:
    """Return where the place is, from (g, g*) pairs: `known` is False where the pairs tell nothing at all."""
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
    # The direction of the large eigenvalue; with several landmarks in line it is across that line.
    angle = 0.5 * math.atan2(2.0 * mxy, mxx - myy)
    ux, uy = math.cos(angle), math.sin(angle)
    along = (ux * ex + uy * ey) / large
    return Offset(along * ux, along * uy, (-uy, ux), True, 1.0 / large)


def unit(angle_rad: float) -> Vector:
    """Return the unit vector at an angle."""
    return math.cos(angle_rad), math.sin(angle_rad)


def slid(x: float, y: float, touched: Iterable[float]) -> Vector:
    """Return a velocity less what would push into walls touched at these bearings: the robot slides along them."""
    for bearing in touched:
        nx, ny = unit(bearing)
        into = x * nx + y * ny
        if into > 0.0:
            x, y = x - into * nx, y - into * ny
    return x, y
