"""Coverage by sight: the part of the arena that a swarm sees, and the number of robots of an ideal packing.

A robot covers what is within its range and not behind a wall, as exact polygons but for the disc, which has 256 sides.
The reference is that of Ramaithitima et al. 2015, section V: a hexagonal packing over the free space, whose points are
one range apart. The number of its points in free space depends on the position of the packing. The mean over all
positions is used here: the free area divided by the area of one cell.
"""

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import shapely

from zwerm.maths.simplicial import FlagComplex, betti
from zwerm.world.arena.arena import Arena
from zwerm.world.scene import Floats, Ints

_QUARTER_SIDES = 64
# A wall's shadow is cut into pieces that span at most this much of the view [rad].
_PIECE_RAD = 0.5
# Side of a square of places whose polygons are united first, in ranges.
_SQUARE_RANGES = 2.0
# Bodies in contact may overlap a wall by a little.
_INSIDE = 0.98
# Grids [m] for overlays that fail on nearly coincident edges, one after the other.
_GRIDS_M = (1e-9, 1e-7, 1e-6, 1e-5)


def hexagonal_packing_robots(arena: Arena, range_m: float) -> float:
    """Return the mean number of points in the arena of a hexagonal packing whose points are `range_m` apart."""
    return float(arena.area_m2 / (math.sqrt(3.0) / 2.0 * range_m**2))


class SeenArea:
    """The part of an arena that robots see. The visible polygon of a place is stored while a robot stands there.

    So are unions of polygons: those of places in one square of a grid, and those of four squares, level by level. Where few
    robots have moved since the last call, few unions are made anew.
    """

    def __init__(self, arena: Arena, range_m: float) -> None:
        self.arena, self.range_m = arena, range_m
        self._from: dict[tuple[float, ...], shapely.Geometry] = {}
        self._corner: Floats = np.array(shapely.bounds(arena.free)[:2])
        self._unions: dict[tuple[int, int, int], tuple[list[shapely.Geometry], shapely.Geometry]] = {}

    def area(self, position: Floats) -> shapely.Geometry:
        """Return the area that is seen from any of position (n, 2)."""
        return robust(shapely.intersection, self._united(position), self.arena.free)

    def fraction(self, position: Floats) -> float:
        """Return the fraction of the arena that is seen from any of position (n, 2)."""
        return min(1.0, float(self._united(position).area / self.arena.area_m2)) if len(position) else 0.0

    def _united(self, position: Floats) -> shapely.Geometry:
        """Return the union of what is seen from each of position (n, 2)."""
        self._from = {
            tuple(each.tolist()): self._from.get(tuple(each.tolist())) or seen_from(each, self.range_m, self.arena)
            for each in position
        }
        squares: dict[tuple[int, int], list[shapely.Geometry]] = {}
        for place, seen in self._from.items():
            column, row = np.maximum((np.array(place) - self._corner) // (_SQUARE_RANGES * self.range_m), 0.0).tolist()
            squares.setdefault((int(column), int(row)), []).append(seen)
        unions, level = {}, 0
        while True:
            wider: dict[tuple[int, int], list[shapely.Geometry]] = {}
            for (column, row), parts in squares.items():
                before = self._unions.get((level, column, row))
                if before is None or not _same(before[0], parts):
                    before = parts, parts[0] if len(parts) == 1 else robust(shapely.union_all, parts)
                unions[level, column, row] = before
                wider.setdefault((column // 2, row // 2), []).append(before[1])
            if len(squares) <= 1:
                self._unions = unions
                return next(iter(wider.values()))[0] if wider else shapely.Polygon()
            squares, level = wider, level + 1


def _same(some: Sequence[shapely.Geometry], others: Sequence[shapely.Geometry]) -> bool:
    """Return whether two sequences hold the same objects."""
    return len(some) == len(others) and all(one is other for one, other in zip(some, others, strict=True))


def reachable(arena: Arena, radius_m: float, position: Floats) -> shapely.Geometry:
    """Return the part of the free space that bodies of a radius can get into from any of position (n, 2).

    Space behind a gap that no body passes does not count. Corners count, though a round body does not fill them.
    """
    inner = shapely.buffer(arena.free, -_INSIDE * radius_m)
    if arena.walls:
        inner = shapely.difference(inner, shapely.buffer(shapely.union_all(list(arena.walls)), _INSIDE * radius_m))
    parts = [each for each in shapely.get_parts(inner) if shapely.dwithin(each, shapely.multipoints(position), 1e-3)]
    grown = shapely.buffer(shapely.union_all(parts), _INSIDE * radius_m, join_style="mitre")
    return shapely.intersection(grown, arena.free)


def seen_from(place: Floats, range_m: float, arena: Arena) -> shapely.Geometry:
    """Return the area that is seen from a place (2,) within `range_m`: the disc without the shadows of the walls."""
    disc = shapely.buffer(shapely.Point(place), range_m, quad_segs=_QUARTER_SIDES)
    walls = arena.segments[arena.walls_within(place[None, :], range_m).segment]
    shadows = [piece for x0, y0, x1, y1 in walls.tolist() for piece in _shadow(place, (x0, y0), (x1, y1), range_m)]
    near = shapely.intersection(disc, arena.free)
    return robust(shapely.difference, near, robust(shapely.union_all, shadows)) if shadows else near


def robust(operation: Callable[..., shapely.Geometry], *geometries: Any) -> shapely.Geometry:
    """Return an overlay of geometries; where it fails on nearly coincident edges, on the finest grid on which it does not.

    A result that is no valid geometry is a failure, too. Where all of `_GRIDS_M` fail, edges move by as much as the last.
    """
    for grid_m in (None, *_GRIDS_M):
        with contextlib.suppress(shapely.errors.GEOSException):
            found = operation(*geometries) if grid_m is None else operation(*geometries, grid_size=grid_m)
            if shapely.is_valid(found):
                return found
    return operation(*(shapely.buffer(each, _GRIDS_M[-1]) for each in geometries))


def _shadow(
    place: Floats, start: tuple[float, float], end: tuple[float, float], range_m: float
) -> Sequence[shapely.Polygon]:
    """Return polygons that cover the area that a wall hides from a place, up to `range_m`; none if the wall is too far."""
    ax, ay = start[0] - place[0], start[1] - place[1]
    bx, by = end[0] - place[0], end[1] - place[1]
    dx, dy = bx - ax, by - ay
    along = min(1.0, max(0.0, -(ax * dx + ay * dy) / (dx * dx + dy * dy)))
    cross = ax * by - ay * bx
    if math.hypot(ax + along * dx, ay + along * dy) >= range_m or abs(cross) < 1e-12:
        return []
    turn = math.atan2(cross, ax * bx + ay * by)
    pieces = math.ceil(abs(turn) / _PIECE_RAD)
    rays: list[tuple[float, float]] = []
    walls: list[tuple[float, float]] = []
    for n in range(pieces + 1):
        angle = math.atan2(ay, ax) + turn * n / pieces
        cos, sin = math.cos(angle), math.sin(angle)
        length = cross / (cos * dy - sin * dx)  # where the ray meets the wall's line
        walls.append((place[0] + length * cos, place[1] + length * sin))
        far = max(length, 0.0) + 2.0 * range_m
        rays.append((place[0] + far * cos, place[1] + far * sin))
    return [shapely.Polygon([walls[n], walls[n + 1], rays[n + 1], rays[n]]) for n in range(pieces)]


def complex_of(pairs: Ints, robots: Iterable[int]) -> FlagComplex:
    """Return the complex of `robots` that see each other in `pairs` (k, 2)."""
    lists: dict[int, list[int]] = {robot: [] for robot in robots}
    for i, j in pairs.tolist():
        if i in lists and j in lists:
            lists[i].append(j)
            lists[j].append(i)
    return FlagComplex(lists)


def holes(pairs: Ints, robots: Ints) -> int:
    """Return the number of holes (b1) of the complex of `robots` (n,) that see each other in `pairs` (k, 2)."""
    return betti(complex_of(pairs, robots.tolist()))[1]


def obstacles(arena: Arena) -> int:
    """Return how many obstacles stand free in the arena."""
    return sum(len(part.interiors) for part in getattr(arena.free, "geoms", (arena.free,))) + len(arena.walls)


def living(present: Ints, dead: Sequence[int]) -> Ints:
    """Return the living robots in the arena."""
    return np.setdiff1d(present, np.array(dead, dtype=np.int64))
