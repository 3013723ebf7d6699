"""Convex polygons in the plane: Voronoi cells by clipping, and integrals of polynomials over them in closed form.

A polygon is a list of (x, y) [m], counter-clockwise. All functions are plain arithmetic on Python floats. The polygons
of Voronoi coverage have about six corners, and arrays are several times slower for so few. Nothing here integrates
numerically. Repeated corners and polygons without area are allowed; each function states its result for them.

Source: Schwager, McLurkin, Rus: Distributed Coverage Control with Sensory Feedback for Networked Robots, 2006, section
III.
"""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

Point = tuple[float, float]
Polygon = Sequence[Point]

# A cell has six sides on average; before this many cuts, computing its reach costs more than it saves.
_CUTS_BEFORE_REACH: Final = 6

# Below this mass, the quotient of two sums of denormal numbers has no correct digit.
MASS_MIN: Final = 1e-290

# The area of a thinner polygon may be rounding, and its centroid is held to its bounding box [m2].
_THIN_M2: Final = 1e-12

# Robots nearer than this count as being at one place and have no bisector [m].
COINCIDENT_M: Final = 1e-12


def clip(polygon: Polygon, a: float, b: float, c: float) -> list[Point]:
    """Return the part of `polygon` where a x + b y <= c; empty where there is none. Sutherland and Hodgman 1974."""
    kept: list[Point] = []
    if not polygon:
        return kept
    x0, y0 = polygon[-1]
    over0 = a * x0 + b * y0 - c
    for corner in polygon:
        x1, y1 = corner
        over1 = a * x1 + b * y1 - c
        if over1 <= 0.0:
            if over0 > 0.0:
                share = over0 / (over0 - over1)
                kept.append((x0 + share * (x1 - x0), y0 + share * (y1 - y0)))
            kept.append(corner)
        elif over0 < 0.0:
            share = over0 / (over0 - over1)
            kept.append((x0 + share * (x1 - x0), y0 + share * (y1 - y0)))
        x0, y0, over0 = x1, y1, over1
    return kept


def voronoi_cell(region: Polygon, others: Iterable[Point]) -> Polygon:
    """Return the part of `region` that is no nearer to any of `others` than to the origin; an empty list if there is
    none.

    Others that do not border on the cell do not change it, so a robot needs to know only its Voronoi neighbours. By the
    definition with <=, another robot at the origin has the same cell; it is skipped.
    """
    cell = region
    order = sorted([(x * x + y * y, x, y) for x, y in others])
    beyond = float("inf")
    for cut, (distance2, x, y) in enumerate(order):
        if distance2 >= beyond:
            break
        if distance2 <= COINCIDENT_M * COINCIDENT_M:
            continue
        # |q|^2 <= |q - p|^2  <=>  p . q <= |p|^2 / 2
        cell = clip(cell, x, y, 0.5 * distance2)
        if cut >= _CUTS_BEFORE_REACH:
            # A bisector half as far away as the other robot misses a cell that does not reach there.
            beyond = 4.0 * max([x * x + y * y for x, y in cell], default=0.0)
    return cell


class Moments(NamedTuple):
    """The integrals of the monomials x^a y^b, I^ab, up to second order. Schwager 2006, eq. 16."""

    i00: float
    i10: float
    i01: float
    i20: float
    i11: float
    i02: float


def moments(polygon: Polygon, ox: float = 0.0, oy: float = 0.0) -> Moments:
    """Return the moments of `polygon` about (ox, oy), for at least one corner. Schwager 2006, the list after eq. 18.

    The paper writes each as a sum of its own over the sides. Let w = x0 y1 - x1 y0, twice the signed area between a
    side and the origin. All moments are sums of w times a symmetric polynomial (Green's theorem), with a third of the
    arithmetic of the printed form. Taken about one of the polygon's own corners every w is >= 0, and nothing cancels.
    """
    i00 = i10 = i01 = i20 = i11 = i02 = 0.0
    x0, y0 = polygon[-1]
    x0, y0 = x0 - ox, y0 - oy
    for x, y in polygon:
        x1, y1 = x - ox, y - oy
        w = x0 * y1 - x1 * y0
        sx, sy = x0 + x1, y0 + y1
        i00 += w
        i10 += w * sx
        i01 += w * sy
        i20 += w * (sx * sx - x0 * x1)
        i11 += w * (2.0 * sx * sy - x0 * y1 - x1 * y0)
        i02 += w * (sy * sy - y0 * y1)
        x0, y0 = x1, y1
    return Moments(i00 / 2.0, i10 / 6.0, i01 / 6.0, i20 / 12.0, i11 / 24.0, i02 / 12.0)


def linear_centroid(polygon: Polygon, value: float, gx: float, gy: float) -> tuple[float, float, float]:
    """Return mass and centroid (M, x, y) of `polygon` under the density value + gx x + gy y. Schwager 2006, eqs. 14 to
    18.

    The density must not be negative on the polygon. If the mass is 0 the centroid is a corner.

    Misprints of the paper, corrected here:
    - eq. 14 has the integral of q^T q, a number. The term (q - p) grad(phi)^T q needs the integral of q q^T, a matrix,
      as in eq. 17;
    - eq. 15's second term has a stray p_i: it is grad(phi)^T times the integral of q, as in eq. 18. As printed it is not
      even a number;
    - c_1 is defined twice: [c_1 c_2]^T = grad(phi) should read [c_2 c_3]^T, as used in eqs. 17 and 18.
    """
    if not polygon:
        return 0.0, 0.0, 0.0
    ox, oy = polygon[0]
    i00, i10, i01, i20, i11, i02 = moments(polygon, ox, oy)
    c1 = value + gx * ox + gy * oy  # the density at the corner about which the moments are taken
    mass = c1 * i00 + gx * i10 + gy * i01  # eq. 18
    if not mass > MASS_MIN:
        return 0.0, ox, oy
    x = ox + (c1 * i10 + gx * i20 + gy * i11) / mass  # eq. 17
    y = oy + (c1 * i01 + gx * i11 + gy * i02) / mass
    if i00 < _THIN_M2:
        xs, ys = [x for x, _ in polygon], [y for _, y in polygon]
        x, y = min(max(x, min(xs)), max(xs)), min(max(y, min(ys)), max(ys))
    return mass, x, y


def estimated_centroid(cell: Polygon, value: float, gx: float, gy: float) -> Point | None:
    """Return the centroid of `cell` under the linear estimate value + gx x + gy y, truncated to V+. Schwager 2006, eq.
    10.

    V+ is where the estimate is not negative (eq. 12). A field that is zero or negative all over the cell has no mass.
    Then the centroid is that of a constant field, the cell's own. A cell without area has none: None.
    """
    positive = cell
    if cell and min([gx * x + gy * y for x, y in cell]) < -value:
        positive = clip(cell, -gx, -gy, value)
    mass, x, y = linear_centroid(positive, value, gx, gy)
    if not mass:
        mass, x, y = linear_centroid(cell, 1.0, 0.0, 0.0)
        if not mass:
            return None
    return x, y


def nearest_point(polygon: Polygon) -> Point:
    """Return the point on the boundary of `polygon` (not empty) that is nearest to the origin."""
    best, nearest = float("inf"), polygon[0]
    x0, y0 = polygon[-1]
    for x1, y1 in polygon:
        dx, dy = x1 - x0, y1 - y0
        length2 = dx * dx + dy * dy
        along = min(1.0, max(0.0, -(x0 * dx + y0 * dy) / length2)) if length2 > 0.0 else 0.0
        x, y = x0 + along * dx, y0 + along * dy
        if x * x + y * y < best:
            best, nearest = x * x + y * y, (x, y)
        x0, y0 = x1, y1
    return nearest
