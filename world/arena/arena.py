"""The arena: free space, and the walls that stop robots, sight and radio.

Free space is a polygon (its holes are obstacles) plus walls without thickness. Queries take many points or lines at once. The
answers are exact to rounding, and no line of sight passes the corner at which two walls meet. Small arenas compare all pairs,
large ones use a spatial index. An arena never changes, and it holds no robots. `shapes` reads arenas from files.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, MultiPolygon, Polygon

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import ArenaTable
from zwerm.scenario.types import COORDINATE_MAX_M
from zwerm.world.arena.shapes import read_shape
from zwerm.world.geometry.segments import Segments
from zwerm.world.geometry.wall_index import WallIndex

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Up to this many pairs, comparing all pairs is faster than a query of the index (measured).
_DENSE_LINES = 5_000
# Up to this many walls, blocks of lines are compared with every wall: the index is slower.
_FEW_SEGMENTS = 64
_DENSE_POINTS = 20_000
_DENSE_WALLS = 8  # up to this many walls, for any number of points
_ON_WALL_M = 1e-9  # added to the distance of the tree, so that rounding hides no nearest wall


class WallContacts(NamedTuple):
    """Every wall segment near a point: one row per (point, segment) pair, by point and then by segment."""

    point: Ints  # (c,) which of the points
    segment: Ints  # (c,) which row of Arena.segments
    nearest: Floats  # (c, 2) the segment's place nearest to the point [m]
    distance_m: Floats  # (c,)


class Arena:
    """Free space and its walls.

    `free` is the shapely polygon of free space, `walls` the walls without thickness, `segments` (m, 4) every wall as
    straight pieces x0, y0, x1, y1 [m], collinear neighbours merged; `bounds` is xmin, ymin, xmax, ymax [m]. `is_convex`
    means that every two points see each other.
    """

    def __init__(self, free: Polygon | MultiPolygon, walls: Sequence[LineString] = ()) -> None:
        self.free = free
        self.walls = tuple(walls)
        shapely.prepare(free)
        rings = [np.asarray(ring.coords)[:, :2] for part in shapely.get_parts(free) for ring in _rings(part)]
        lines = [np.asarray(wall.coords)[:, :2] for wall in self.walls]
        pieces = [_segments(ring, closed=True) for ring in rings] + [_segments(line, closed=False) for line in lines]
        self.segments: Floats = np.ascontiguousarray(np.concatenate(pieces))
        self.segments.flags.writeable = False
        self.area_m2 = float(free.area)
        xmin, ymin, xmax, ymax = map(float, free.bounds)
        self.bounds = (xmin, ymin, xmax, ymax)
        self.is_convex = not self.walls and len(rings) == 1 and _is_convex(rings[0])
        self._pieces = Segments.of(self.segments)
        self._qx, self._qy = (np.ascontiguousarray(column) for column in self.segments.T[2:])
        self._index = WallIndex(self.segments)
        self._tree = shapely.STRtree(shapely.linestrings(self.segments.reshape(-1, 2, 2)))

    @classmethod
    def from_table(cls, table: ArenaTable, folder: Path) -> "Arena":
        """Return the arena that `table` describes; relative paths start at `folder`, or else where the process runs.

        Raises ScenarioError with every mistake, each `arena.key: rule, got value`.
        """
        free, walls = read_shape(table, folder)
        largest = max(map(abs, free.bounds), default=0.0)
        if not largest <= COORDINATE_MAX_M:
            raise ScenarioError([f"arena: expected coordinates of at most {COORDINATE_MAX_M:g} m, got {largest:g}"])
        return cls(free, walls)

    def blocked(self, start: Floats, end: Floats) -> Bools:
        """Return (k,) whether a wall crosses or touches each line from start (k, 2) to end (k, 2), its ends excluded."""
        count = len(start)
        if self.is_convex or count == 0:
            return np.zeros(count, dtype=np.bool_)
        if count * len(self.segments) <= _DENSE_LINES:
            a, b = start.T[:, :, None], end.T[:, :, None]
            hit = _crosses(a[0], a[1], b[0], b[1], self._pieces.px, self._pieces.py, self._qx, self._qy)
            dense: Bools = np.logical_or.reduce(hit, axis=1)
            return dense
        if len(self.segments) <= _FEW_SEGMENTS:
            step = _DENSE_LINES // len(self.segments)
            parts = [self.blocked(start[at : at + step], end[at : at + step]) for at in range(0, count, step)]
            return np.concatenate(parts)
        blocked = np.zeros(count, dtype=np.bool_)
        line, wall = self._index.candidates(start, end)
        a, b = start[line].T, end[line].T
        crossing = _crosses(
            a[0], a[1], b[0], b[1], self._pieces.px[wall], self._pieces.py[wall], self._qx[wall], self._qy[wall]
        )
        blocked[line[crossing]] = True
        return blocked

    def nearest_wall_points(self, points: Floats) -> Floats:
        """Return (k, 2) the point on a wall nearest to each of points (k, 2) [m]; of equally near ones, the first segment's."""
        count = len(points)
        if count * len(self.segments) <= _DENSE_POINTS:
            x, y = points.T[:, :, None]
            nx, ny = self._pieces.nearest(x, y, np.s_[:])
            best = np.argmin((nx - x) ** 2 + (ny - y) ** 2, axis=1)
            rows = np.arange(count)
            return np.column_stack([nx[rows, best], ny[rows, best]])
        # The tree's distances only bound the search; the same sums as above then find the nearest wall.
        _, distance = self._tree.query_nearest(shapely.points(points), all_matches=False, return_distance=True)
        point, wall = self._near(points, distance + _ON_WALL_M)
        x, y = points[point].T
        nx, ny = self._pieces.nearest(x, y, wall)
        order = np.lexsort((wall, (nx - x) ** 2 + (ny - y) ** 2, point))
        best = order[np.searchsorted(point, np.arange(count))]
        return np.column_stack([nx[best], ny[best]])

    def walls_within(self, points: Floats, distance_m: float) -> WallContacts:
        """Return every pair of a point of points (k, 2) and a wall segment at most distance_m from it."""
        if len(self.segments) <= _DENSE_WALLS:
            x, y = points.T[:, :, None]
            nx, ny = self._pieces.nearest(x, y, np.s_[:])
            apart = np.hypot(nx - x, ny - y)
            point, wall = (apart <= distance_m).nonzero()
            return WallContacts(point, wall, np.column_stack([nx[point, wall], ny[point, wall]]), apart[point, wall])
        point, wall = self._near(points, distance_m)
        nearest = np.column_stack(self._pieces.nearest(points[point, 0], points[point, 1], wall))
        distance = _norm(nearest - points[point])
        near = distance <= distance_m
        return WallContacts(point[near], wall[near], nearest[near], distance[near])

    def contains(self, points: Floats, margin_m: float = 0.0) -> Bools:
        """Return (k,) whether each of points (k, 2) is in free space and at least margin_m from every wall."""
        inside: Bools = shapely.contains_xy(self.free, points[:, 0], points[:, 1])
        if margin_m > 0.0:
            close = self.walls_within(points, margin_m)
            inside[close.point[close.distance_m < margin_m]] = False
        return inside

    def _near(self, points: Floats, distance_m: float | Floats) -> tuple[Ints, Ints]:
        """Return pairs (point, wall), sorted, among which are all walls within distance_m of points (k, 2)."""
        x, y = points.T
        boxes = shapely.box(x - distance_m, y - distance_m, x + distance_m, y + distance_m)
        point, wall = self._tree.query(boxes)
        order = np.lexsort((wall, point))
        return point[order], wall[order]


def _norm(vectors: Floats) -> Floats:
    length: Floats = np.hypot(vectors[:, 0], vectors[:, 1])
    return length


def _rings(polygon: Polygon) -> list[LineString]:
    return [polygon.exterior, *polygon.interiors]


def _segments(line: Floats, closed: bool) -> Floats:
    """Return (m, 4) the pieces of a line of points (n, 2), without empty ones and with collinear neighbours merged."""
    line = line[np.r_[True, (np.diff(line, axis=0) != 0.0).any(axis=1)]]
    if closed:
        line = line[:-1]
        line = line[_bends(np.roll(line, 1, axis=0), line, np.roll(line, -1, axis=0))]
        return np.hstack([line, np.roll(line, -1, axis=0)])
    keep = np.r_[True, _bends(line[:-2], line[1:-1], line[2:]), True] if len(line) > 2 else np.s_[:]
    line = line[keep]
    return np.hstack([line[:-1], line[1:]])


def _bends(before: Floats, at: Floats, after: Floats) -> Bools:
    inward, outward = at - before, after - at
    cross = inward[:, 0] * outward[:, 1] - inward[:, 1] * outward[:, 0]
    dot = (inward * outward).sum(axis=1)
    straight: Bools = (np.abs(cross) <= 1e-12 * np.abs(dot)) & (dot > 0.0)
    return ~straight


def _is_convex(ring: Floats) -> bool:
    """Return whether a simple closed ring (n, 2) turns one way only; a turn of 1e-9 rad counts as none."""
    edge = np.diff(ring, axis=0)
    edge = edge[(edge != 0.0).any(axis=1)]
    edge /= _norm(edge)[:, None]
    following = np.roll(edge, -1, axis=0)
    turn = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
    return bool((turn > -1e-9).all() or (turn < 1e-9).all())


def _crosses(
    ax: Floats, ay: Floats, bx: Floats, by: Floats, px: Floats, py: Floats, qx: Floats, qy: Floats
) -> NDArray[np.bool_]:
    """Return whether wall pq meets line ab between a and b, elementwise.

    Each sign depends on one wall end only, so that two walls with a common end agree about it and leave no gap.
    """
    dx, dy = bx - ax, by - ay
    apx, apy, aqx, aqy = px - ax, py - ay, qx - ax, qy - ay
    side_p, side_q = dx * apy - dy * apx, dx * aqy - dy * aqx
    side_a = apx * aqy - apy * aqx
    bpx, bpy, bqx, bqy = px - bx, py - by, qx - bx, qy - by
    side_b = bpx * bqy - bpy * bqx
    hit: Bools = (side_a * side_b < 0.0) & (side_p * side_q <= 0.0)
    along = (side_p == 0.0) & (side_q == 0.0)  # on one line: they meet where their spans overlap
    if along.any():
        length2 = dx * dx + dy * dy
        at_p, at_q = dx * apx + dy * apy, dx * aqx + dy * aqy
        hit |= along & (np.maximum(at_p, at_q) > 0.0) & (np.minimum(at_p, at_q) < length2)
    return hit
