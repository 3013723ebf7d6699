"""The quadratic estimate: own value and gradient, and the curvature that fits the Voronoi neighbours' values best.

The paper's conclusion proposes it: "each robot might estimate the sensory function from a quadratic fit of its own and each
of its Voronoi neighbors' measured values". Mass and centroid stay closed forms, with moments up to the third order. If
the fit is underdetermined, or may be negative on the cell, the linear estimate is used instead.
"""

import math
from typing import Final, NamedTuple

from zwerm.maths.polygons import Point, Polygon, estimated_centroid, moments

# If the determinant of the normal equations is below this fraction of its upper bound, the curvature is undetermined.
_SINGULAR: Final = 1e-9

# Tolerance, as a factor: a bisector is a side of the cell if a corner's distance equals its own up to this.
_ON_SIDE: Final = 1e-9


class NeighbourSample(NamedTuple):
    """A neighbour's position relative to this robot [m], and the field's value there."""

    x: float
    y: float
    value: float


class Curvature(NamedTuple):
    """The second derivatives of the field [1/m2]."""

    xx: float
    xy: float
    yy: float


def bordering(cell: Polygon, samples: list[NeighbourSample]) -> list[NeighbourSample]:
    """Return those of `samples` whose bisector is a side of `cell`."""
    found = []
    for sample in samples:
        half = 0.5 * (sample.x**2 + sample.y**2)
        if cell and half > 0.0 and max([sample.x * x + sample.y * y for x, y in cell]) >= half * (1.0 - _ON_SIDE):
            found.append(sample)
    return found


def fit(value: float, gx: float, gy: float, samples: list[NeighbourSample]) -> Curvature | None:
    """Return the curvature that fits the samples best in the sense of least squares, or None if it is undetermined.

    Each sample's equation is divided by the square of its distance: the fitted values are the curvatures in the
    directions of the samples.
    """
    # Normal equations of  residual = xx a + xy b + yy c.
    aa = ab = ac = bb = bc = cc = ra = rb = rc = 0.0
    for x, y, other in samples:
        distance2 = x * x + y * y
        if distance2 <= 0.0:
            continue
        a, b, c = 0.5 * x * x / distance2, x * y / distance2, 0.5 * y * y / distance2
        residual = (other - value - gx * x - gy * y) / distance2
        aa, ab, ac, bb, bc, cc = aa + a * a, ab + a * b, ac + a * c, bb + b * b, bc + b * c, cc + c * c
        ra, rb, rc = ra + residual * a, rb + residual * b, rc + residual * c
    # Cramer's rule.
    da, db, dc = bb * cc - bc * bc, ab * cc - bc * ac, ab * bc - bb * ac
    determinant = aa * da - ab * db + ac * dc
    if not determinant > _SINGULAR * aa * bb * cc:
        return None
    xx = ra * da - ab * (rb * cc - bc * rc) + ac * (rb * bc - bb * rc)
    xy = aa * (rb * cc - bc * rc) - ra * db + ac * (ab * rc - rb * ac)
    yy = aa * (bb * rc - rb * bc) - ab * (ab * rc - rb * ac) + ra * dc
    return Curvature(xx / determinant, xy / determinant, yy / determinant)


def third_moments(polygon: Polygon, ox: float, oy: float) -> tuple[float, float, float, float]:
    """Return the integrals of x^3, x^2 y, x y^2 and y^3 over `polygon` about (ox, oy)."""
    i30 = i21 = i12 = i03 = 0.0
    x0, y0 = polygon[-1]
    x0, y0 = x0 - ox, y0 - oy
    for x, y in polygon:
        x1, y1 = x - ox, y - oy
        w = x0 * y1 - x1 * y0
        xx0, xx1, yy0, yy1, xx, yy = x0 * x0, x1 * x1, y0 * y0, y1 * y1, x0 * x1, y0 * y1
        i30 += w * (xx0 + xx1) * (x0 + x1)
        i03 += w * (yy0 + yy1) * (y0 + y1)
        i21 += w * (y0 * (3.0 * xx0 + 2.0 * xx + xx1) + y1 * (xx0 + 2.0 * xx + 3.0 * xx1))
        i12 += w * (x0 * (3.0 * yy0 + 2.0 * yy + yy1) + x1 * (yy0 + 2.0 * yy + 3.0 * yy1))
        x0, y0 = x1, y1
    return i30 / 20.0, i21 / 60.0, i12 / 60.0, i03 / 20.0


def quadratic_centroid(cell: Polygon, value: float, gx: float, gy: float, bend: Curvature | None) -> Point | None:
    """Return the centroid of `cell` under the quadratic estimate, or under the linear one if the quadratic one may be
    negative."""
    if bend is None or not cell or _lowest(cell, value, gx, gy, bend) < 0.0:
        return estimated_centroid(cell, value, gx, gy)
    xx, xy, yy = bend
    ox, oy = cell[0]
    i00, i10, i01, i20, i11, i02 = moments(cell, ox, oy)
    i30, i21, i12, i03 = third_moments(cell, ox, oy)
    # The estimate's value and slope at the corner about which the moments are taken.
    c1 = value + gx * ox + gy * oy + 0.5 * (xx * ox * ox + yy * oy * oy) + xy * ox * oy
    c2, c3 = gx + xx * ox + xy * oy, gy + xy * ox + yy * oy
    mass = c1 * i00 + c2 * i10 + c3 * i01 + 0.5 * (xx * i20 + yy * i02) + xy * i11
    x = c1 * i10 + c2 * i20 + c3 * i11 + 0.5 * (xx * i30 + yy * i12) + xy * i21
    y = c1 * i01 + c2 * i11 + c3 * i02 + 0.5 * (xx * i21 + yy * i03) + xy * i12
    if not mass > 0.0 or not math.isfinite(x / mass + y / mass):
        return estimated_centroid(cell, value, gx, gy)
    return ox + x / mass, oy + y / mass


def _lowest(cell: Polygon, value: float, gx: float, gy: float, bend: Curvature) -> float:
    """Return a lower bound of the estimate on `cell`: the minimum of its linear part, minus a bound of its quadratic part."""
    mean, difference = 0.5 * (bend.xx + bend.yy), 0.5 * (bend.xx - bend.yy)
    flattest = mean - math.hypot(difference, bend.xy)
    reach2 = max([x * x + y * y for x, y in cell])
    return value + min([gx * x + gy * y for x, y in cell]) + 0.5 * min(0.0, flattest) * reach2
