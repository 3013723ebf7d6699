"""The Voronoi cell of a robot, with a cache of the order of its sides.

The robots and the sides of the region that bound a cell seldom change between two observations; their positions always do. So
the cell stores the order of its sides, and computes its corners as the intersections of consecutive bisectors. A test of the
corners then shows whether they bound the cell. If not, the cell is clipped, and the order is found again. The order is always
the one that clipping finds, so the cache changes no result.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Protocol

from zwerm.maths.polygons import COINCIDENT_M, MASS_MIN, Point, Polygon, estimated_centroid, nearest_point, voronoi_cell


class RelativePosition(Protocol):
    """A neighbour's position relative to the robot [m]."""

    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...


@dataclass(slots=True)
class _MirrorImage:
    x_m: float
    y_m: float


Neighbours = Sequence[RelativePosition]

# A corner (x, y) [m] of a cell that is being clipped, and the label of the side that starts there.
_Corner = tuple[float, float, int]

# Factor by which rounding may move a corner beyond a bisector that only touches the cell.
_TOUCHING: Final = 1.0 + 1e-9

_COINCIDENT2: Final = COINCIDENT_M * COINCIDENT_M


class CachedVoronoiCell:
    """The Voronoi cell of one robot, at the origin of its own frame.

    A side of the region is treated as the bisector between the robot and its mirror image behind that side. So all sides are
    bisectors.
    """

    def __init__(self) -> None:
        # Number of neighbours and of sides of the region when the order was found.
        self._others = self._sides = -1
        # Walls are sides of the region, by the index of the corner at their end.
        self._walls: list[int] = []  # walls that bound the cell
        self._far_walls: list[int] = []  # the other walls
        self._far_others: list[int] = []  # neighbours that do not bound the cell
        # The sides of the cell, counter-clockwise: indices of neighbours, then of walls. The first is repeated at the end.
        self._order: list[int] = []

    def target(self, region: Polygon, others: Neighbours, value: float, gx: float, gy: float) -> Point:
        """Return the centroid of the cell under the linear estimate value + gx x + gy y of the field [m].

        The centroid is relative to the robot, so it is also the error vector. If the cell is empty, the nearest point of the
        region is returned. The region must have corners.
        """
        centroid = None
        if len(others) == self._others and len(region) == self._sides:
            centroid = self._centroid(region, others, value, gx, gy)
        if centroid is None and self._find(region, others):
            centroid = self._centroid(region, others, value, gx, gy)
        if centroid is not None:
            return centroid
        # The robot is outside the region, or the field is negative in a part of the cell, or the region is not convex.
        self._others = -1
        cell = voronoi_cell(region, [(other.x_m, other.y_m) for other in others])
        return estimated_centroid(cell, value, gx, gy) or nearest_point(region)

    def _centroid(self, region: Polygon, others: Neighbours, value: float, gx: float, gy: float) -> Point | None:
        """Return the centroid of the cell in the stored order, or None if it is not valid. Schwager 2006, eqs. 14 to 18.

        The cell is divided into triangles from the robot to its sides. The integral of q phi over a triangle is a third of
        its area times the sum of q phi at the middles of its sides, because q phi is quadratic. Let w be twice the area, e
        a quarter of the rise of phi from the robot to a corner, and s = value + e0 + e1. Then the integral is
        w (q0 (s + e0) + q1 (s + e1)) / 6, and the mass is w (4 s - value) / 6. No term is negative, so no digits cancel.
        """
        everyone = [*others, *_mirrored(region, self._walls)] if self._walls else others
        bounds = [everyone[which] for which in self._order]
        gx, gy, lowest = 0.25 * gx, 0.25 * gy, -0.25 * value
        side, after = bounds[0], bounds[1]
        a0, b0, a1, b1 = side.x_m, side.y_m, after.x_m, after.y_m
        c0, c1 = a0 * a0 + b0 * b0, a1 * a1 + b1 * b1
        across = a0 * b1 - b0 * a1
        if across <= 0.0:
            return None
        # The corner where two bisectors intersect: a x + b y = c / 2 for each of them.
        half = 0.5 / across
        x0, y0 = x_first, y_first = (c0 * b1 - b0 * c1) * half, (a0 * c1 - c0 * a1) * half
        e0 = e_first = gx * x0 + gy * y0
        if e0 < lowest:
            return None
        reach2 = x0 * x0 + y0 * y0
        turns = 0
        w0 = m0 = area = sum_m = sum_x = sum_y = 0.0
        a0, b0, c0 = a1, b1, c1
        for side in bounds[2:]:
            a1 = side.x_m
            b1 = side.y_m
            c1 = a1 * a1 + b1 * b1
            across = a0 * b1 - b0 * a1
            if across <= 0.0:
                return None
            half = 0.5 / across
            x = (c0 * b1 - b0 * c1) * half
            y = (a0 * c1 - c0 * a1) * half
            w = x0 * y - y0 * x
            e = gx * x + gy * y
            if w < 0.0 or e < lowest:
                return None
            if y0 < 0.0 <= y:
                turns += 1
            distance2 = x * x + y * y
            if distance2 > reach2:
                reach2 = distance2
            m = w * (value + e0 + e)
            area += w
            sum_m += m
            k = m0 + m + (w0 + w) * e0
            sum_x += k * x0
            sum_y += k * y0
            x0 = x
            y0 = y
            e0 = e
            w0 = w
            m0 = m
            a0 = a1
            b0 = b1
            c0 = c1
        w = x0 * y_first - y0 * x_first
        if y0 < 0.0 <= y_first:
            turns += 1
        # The sides turn left around the robot exactly once: they are the sides of a convex polygon.
        if w < 0.0 or turns != 1 or self._is_cut(region, others, bounds, reach2):
            return None
        m = w * (value + e0 + e_first)
        mass = 4.0 * (sum_m + m) - value * (area + w)
        if not mass > MASS_MIN:
            return None
        k, k_first = m0 + m + (w0 + w) * e0, m + w * e_first
        return (sum_x + k * x0 + k_first * x_first) / mass, (sum_y + k * y0 + k_first * y_first) / mass

    def _is_cut(self, region: Polygon, others: Neighbours, bounds: list[RelativePosition], reach2: float) -> bool:
        """Return whether a neighbour or wall that is no side of the cell cuts it; `reach2` bounds its corners [m2]."""
        for end in self._far_walls:
            x0, y0 = region[end - 1]
            x1, y1 = region[end]
            a = y1 - y0
            b = x0 - x1
            c = x0 * y1 - y0 * x1
            if c <= 0.0:
                return True
            if c * c < reach2 * (a * a + b * b) and _reaches(bounds, a, b, c):
                return True
        for which in self._far_others:
            a, b = others[which].x_m, others[which].y_m
            c = 0.5 * (a * a + b * b)
            if _COINCIDENT2 < 2.0 * c < 4.0 * reach2 and _reaches(bounds, a, b, c):
                return True
        return False

    def _find(self, region: Polygon, others: Neighbours) -> bool:
        """Find the sides of the cell by clipping; return whether it has any."""
        count, walls = len(others), len(region)
        # The label of a wall is `count` plus the index of the corner at its end.
        cell: list[_Corner] = [(x, y, count + (start + 1) % walls) for start, (x, y) in enumerate(region)]
        near = sorted([(other.x_m * other.x_m + other.y_m * other.y_m, which) for which, other in enumerate(others)])
        for distance2, which in near:
            if distance2 > _COINCIDENT2:
                cell = _clip(cell, others[which].x_m, others[which].y_m, 0.5 * distance2, which)
        labels = [
            label for (x, y, label), (x1, y1, _) in zip(cell, [*cell[1:], *cell[:1]], strict=True) if x != x1 or y != y1
        ]
        if len(labels) < 3:
            return False
        self._others, self._sides = count, walls
        self._walls = sorted([label - count for label in labels if label >= count])
        self._far_walls = [end for end in range(walls) if end not in self._walls]
        self._far_others = [which for which in range(count) if which not in labels]
        order = [label if label < count else count + self._walls.index(label - count) for label in labels]
        start = order.index(min(order))
        order = order[start:] + order[:start]
        self._order = [*order, order[0]]
        return True


def _mirrored(region: Polygon, walls: list[int]) -> list[RelativePosition]:
    """Return the mirror images of the robot behind the walls that end in these corners of the region."""
    images: list[RelativePosition] = []
    for end in walls:
        (x0, y0), (x1, y1) = region[end - 1], region[end]
        a, b, c = y1 - y0, x0 - x1, x0 * y1 - y0 * x1
        # If the robot is behind the wall itself, the image is put at the robot: a bisector with itself bounds nothing.
        twice = 2.0 * c / (a * a + b * b) if c > 0.0 else 0.0
        images.append(_MirrorImage(twice * a, twice * b))
    return images


def _reaches(bounds: Sequence[RelativePosition], a: float, b: float, c: float) -> bool:
    """Return whether a corner of the cell lies beyond a x + b y = c."""
    beyond = c * _TOUCHING
    for n0, n1 in pairwise(bounds):
        half = 0.5 / (n0.x_m * n1.y_m - n0.y_m * n1.x_m)
        c0, c1 = n0.x_m * n0.x_m + n0.y_m * n0.y_m, n1.x_m * n1.x_m + n1.y_m * n1.y_m
        if (a * (c0 * n1.y_m - n0.y_m * c1) + b * (n0.x_m * c1 - c0 * n1.x_m)) * half > beyond:
            return True
    return False


def _clip(polygon: list[_Corner], a: float, b: float, c: float, label: int) -> list[_Corner]:
    """Return the part of `polygon` where a x + b y <= c; the new side gets this label. See `zwerm.maths.polygons.clip`."""
    kept: list[_Corner] = []
    if not polygon:
        return kept
    x0, y0, label0 = polygon[-1]
    over0 = a * x0 + b * y0 - c
    for corner in polygon:
        x1, y1, label1 = corner
        over1 = a * x1 + b * y1 - c
        if over0 < 0.0 < over1 or over1 <= 0.0 < over0:
            share = over0 / (over0 - over1)
            kept.append((x0 + share * (x1 - x0), y0 + share * (y1 - y0), label0 if over1 <= 0.0 else label))
        if over1 <= 0.0:
            kept.append(corner)
        x0, y0, label0, over0 = x1, y1, label1, over1
    return kept
