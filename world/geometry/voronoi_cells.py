"""Voronoi cells of robots in a convex arena, and rings about a place.

The error to the *estimated* centroid is that of an undisturbed robot at that place (eqs. 10 to 18). Source: Schwager, McLurkin,
Rus 2006.
"""

import math

import numpy as np
import shapely

from zwerm.maths.cached_voronoi_cell import CachedVoronoiCell
from zwerm.maths.polygons import Point as Corner
from zwerm.maths.polygons import Polygon, voronoi_cell
from zwerm.wire.messages import Neighbour
from zwerm.world.arena.arena import Arena
from zwerm.world.fields import Field
from zwerm.world.geometry.quadrature import CellIntegrals, integrate
from zwerm.world.geometry.tessellation import Tessellation
from zwerm.world.scene import Floats, Ints


def outline_of(arena: Arena) -> Floats:
    """Return (m, 2) the corners of a convex arena [m], counter-clockwise."""
    ring = arena.free.exterior
    corners = np.asarray(ring.coords)[:-1, :2]
    return corners if ring.is_ccw else corners[::-1]


class VoronoiCells:
    """The Voronoi cells of a convex arena, and integrals of a field over them."""

    def __init__(self, arena: Arena, field: Field) -> None:
        self._outline, self._field = outline_of(arena), field
        self._tessellation = Tessellation()
        self._cells: list[CachedVoronoiCell] = []
        # The newest pairs, and both of their directions.
        self._last: tuple[Ints, tuple[Ints, Ints, list[int]]] | None = None

    def cells(self, position: Floats) -> list[Polygon]:
        """Return for each of position (n, 2) its cell's corners relative to it [m]; empty for one that has none."""
        return [
            voronoi_cell(outline, [(other.x_m, other.y_m) for other in others])
            for outline, others in zip(*self._seen(position), strict=True)
        ]

    def targets(self, position: Floats) -> Floats:
        """Return (n, 2) the vector from each of position (n, 2) to the goal of an undisturbed robot there [m]."""
        if len(self._cells) != len(position):
            self._cells = [CachedVoronoiCell() for _ in position]
        value, gradient = self._field.sample(position)
        return np.array(
            [
                cell.target(outline, others, phi, gx, gy)
                for cell, outline, others, phi, (gx, gy) in zip(
                    self._cells, *self._seen(position), value.tolist(), gradient.tolist(), strict=True
                )
            ]
        )

    def _seen(self, position: Floats) -> tuple[list[list[Corner]], list[tuple[Neighbour, ...]]]:
        """Return the outline and the Voronoi neighbours relative to each of position (n, 2)."""
        pairs = self._tessellation.pairs(position)
        if self._last is None or self._last[0] is not pairs:
            self._last = pairs, _both_ways(pairs, len(position))
        observer, seen, ends = self._last[1]
        x, y = (position[seen] - position[observer]).T.tolist()
        others = list(map(Neighbour, seen.tolist(), x, y))
        outlines = [list(map(tuple, outline)) for outline in (self._outline - position[:, None, :]).tolist()]
        return outlines, [tuple(others[start:end]) for start, end in zip([0, *ends[:-1]], ends, strict=True)]

    def errors(self, position: Floats) -> Floats:
        """Return (n,) the distance of each of position (n, 2) to the estimated centroid of its cell [m]."""
        x, y = self.targets(position).T
        errors: Floats = np.hypot(x, y)
        return errors

    def integrals(self, position: Floats) -> CellIntegrals:
        """Return the integrals of the true field over the cells of position (n, 2)."""
        cells = [
            [(x + px, y + py) for x, y in cell]
            for cell, (px, py) in zip(self.cells(position), position.tolist(), strict=True)
        ]
        return integrate(cells, position, self._field)


def _both_ways(pairs: Ints, count: int) -> tuple[Ints, Ints, list[int]]:
    """Return both directions of pairs (k, 2) of rows below `count`: the observer, ascending; the other; each observer's end."""
    observer, seen = np.concatenate([pairs, pairs[:, ::-1]]).T
    order = np.argsort(observer, kind="stable")
    observer, seen = observer[order], seen[order]
    return observer, seen, np.searchsorted(observer, np.arange(count), side="right").tolist()


class Rings:
    """Rings of equal width about a peak, out to the arena's farthest corner, without their parts outside the arena."""

    def __init__(self, arena: Arena, peak_m: tuple[float, float], count: int) -> None:
        self._peak = np.array(peak_m)
        self.edges_m: Floats = np.linspace(0.0, np.hypot(*(outline_of(arena) - self._peak).T).max(), count + 1)
        discs = shapely.buffer(shapely.Point(peak_m), self.edges_m[1:], quad_segs=64)
        inner = shapely.area(shapely.intersection(discs, arena.free))
        self._share = np.diff(inner, prepend=0.0) / arena.area_m2

    def density(self, position: Floats) -> dict[str, float]:
        """Return the density of robots in each ring over that of the whole arena: 1 is uniform. Figures 4 and 7."""
        distance = np.hypot(*(position - self._peak).T)
        counts: Ints = np.histogram(distance, self.edges_m)[0]
        found = {"mean_peak_distance_m": float(distance.mean())}
        for ring, (count, share) in enumerate(zip(counts.tolist(), self._share.tolist(), strict=True), 1):
            found[f"density_ring_{ring:02d}"] = count / len(position) / share if share > 0.0 else math.nan
        return found
