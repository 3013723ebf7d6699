"""Voronoi neighbours: the Delaunay triangulation of a swarm, stored from scene to scene.

The triangulation of slowly moving robots seldom changes, so the previous one is tested first. It is the Delaunay
triangulation of the new positions if its triangles still turn counter-clockwise, its hull is convex, and no edge must
be flipped (Delaunay's lemma). This test is much faster than a new triangulation. A few edges are flipped in place
(Lawson 1977). `Tessellation.pairs` states the result for robots at one place and swarms on one line. Ranges, walls and
noise play no part.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zwerm.world.geometry.pairs import every_pair
from zwerm.world.scene import Floats, Ints

Complexes = NDArray[np.complex128]

# Beyond this many flips at once, or this many rounds, a new triangulation is faster.
_FLIPS_AT_ONCE: Final = 12  # or _FLIPS_SHARE of the points, if that is more
_FLIPS_SHARE: Final = 0.06
_ROUNDS: Final = 8

# The rows of the edges of a mesh, and of its hull.
_A, _B, _C, _D, _LEFT, _RIGHT = range(6)
_BEFORE, _CORNER, _AFTER, _APEX, _WITHIN = range(5)


class _Mesh(NamedTuple):
    """A triangulation: its inner edges, and the edges of its convex hull."""

    # (6, e) for every inner edge a -> b: a, b, the corner c to its left, the corner d to its right, and the triangles on its
    # left and right.
    edges: Ints
    # (5, h) for every corner of the hull: the corner before, the corner, the corner after. Then the triangle at the side to
    # the corner after: its corner opposite to that side, and its number.
    hull: Ints


class Tessellation:
    """The Delaunay pairs of moving points."""

    def __init__(self) -> None:
        import scipy.spatial  # noqa: F401  now, so that no tick waits for it

        self._mesh: _Mesh | None = None
        self._rows: dict[
            tuple[int, int], int
        ] = {}  # row of each edge by its ends, the smaller first; empty until it is needed
        self._position: Floats = np.empty((0, 2))
        self._pairs: Ints = np.empty((0, 2), dtype=np.int64)

    def pairs(self, position: Floats) -> Ints:
        """Return (k, 2) rows i < j of position (n, 2) that are Voronoi neighbours in the plane, ascending.

        Of several points at one place, one has the neighbours. The others are neighbours of it, of its neighbours and of each
        other. Points on one line are all neighbours, and so are fewer than four points. Additional neighbours do not change a
        cell that is clipped by bisectors.
        """
        position = np.ascontiguousarray(position)
        if position.shape == self._position.shape and (
            (position == self._position).all() if self._mesh is None else self._repair(position)
        ):
            return self._pairs
        self._position = position.copy()
        self._mesh, self._pairs = _triangulate(self._position)
        self._rows = {}
        self._pairs.flags.writeable = False
        return self._pairs

    def _repair(self, position: Floats) -> bool:
        """Flip edges until the mesh is the Delaunay triangulation of these positions; return whether that succeeded."""
        assert self._mesh is not None
        for changes in range(_ROUNDS):
            wrong = _wrong_edges(self._mesh, position)
            if wrong is None:
                if not self._repair_hull(position):
                    return False
            elif len(wrong) > max(_FLIPS_AT_ONCE, _FLIPS_SHARE * len(position)):
                return False
            elif len(wrong):
                self._flip(wrong)
            else:
                if changes:
                    self._pairs = _pairs_of(self._mesh, len(position))
                    self._pairs.flags.writeable = False
                return True
        return False

    def _repair_hull(self, position: Floats) -> bool:
        """Fill a dent of the hull, or remove a triangle whose inner corner is outside; return whether either was done."""
        assert self._mesh is not None
        hull = self._mesh.hull
        place = position.view(np.complex128)[:, 0]
        before, corner, after, apex = place.take(hull[:_WITHIN])
        dented = np.flatnonzero(_turn(corner - before, after - before) < 0.0)
        if len(dented):
            return self._fill(int(dented[0]))
        turned = np.flatnonzero(_turn(after - corner, apex - corner) <= 0.0)
        return len(turned) > 0 and self._uncover(int(turned[0]))

    def _fill(self, at: int) -> bool:
        """Add the triangle that fills the dent at this column of the hull; return False if it then has no triangle."""
        assert self._mesh is not None
        edges, hull = self._mesh
        p, q, r, far, beyond = hull[:, at].tolist()
        (first,), (last,) = np.flatnonzero(hull[_CORNER] == p), np.flatnonzero(hull[_CORNER] == r)
        if hull.shape[1] <= 3:
            return False
        new = int(max(edges[_LEFT:].max(), hull[_WITHIN].max())) + 1
        inner = [[p, q], [q, r], [hull[_APEX, first], far], [r, p], [hull[_WITHIN, first], beyond], [new, new]]
        hull[_AFTER:, first] = r, q, new
        hull[_BEFORE, last] = p
        self._mesh = _Mesh(np.concatenate([edges, np.array(inner)], axis=1), np.delete(hull, at, axis=1))
        self._rows = {}
        return True

    def _uncover(self, at: int) -> bool:
        """Remove the triangle at the side after this corner of the hull; return False if its inner corner is on the hull."""
        assert self._mesh is not None
        edges, hull = self._mesh
        _, q, r, s, gone = hull[:, at].tolist()
        if (hull[_CORNER] == s).any():
            return False
        # Its two inner sides, q s and s r, become sides of the hull. The triangles behind them are now at the hull.
        rows, sides = [], []
        for p in (q, r):
            (row,) = np.flatnonzero(
                ((edges[_A] == p) & (edges[_B] == s)) | ((edges[_A] == s) & (edges[_B] == p))
            ).tolist()
            across = 1 if edges[_LEFT, row] == gone else 0
            rows.append(row)
            sides.append((int(edges[_C + across, row]), int(edges[_LEFT + across, row])))
        (last,) = np.flatnonzero(hull[_CORNER] == r)
        hull[_AFTER:, at] = s, *sides[0]
        hull[_BEFORE, last] = s
        hull = np.concatenate([hull, np.array([[q], [s], [r], [sides[1][0]], [sides[1][1]]])], axis=1)
        self._mesh = _Mesh(np.delete(edges, rows, axis=1), hull)
        self._rows = {}
        return True

    def _flip(self, wrong: Ints) -> None:
        """Flip these edges, but for those that another flip has changed."""
        assert self._mesh is not None
        edges, hull = self._mesh
        if not self._rows:
            low, high = np.minimum(edges[_A], edges[_B]).tolist(), np.maximum(edges[_A], edges[_B]).tolist()
            self._rows = {ends: row for row, ends in enumerate(zip(low, high, strict=True))}
        touched: list[int] = []
        for row in wrong.tolist():
            a, b, c, d, left, right = edges[:, row].tolist()
            if left in touched or right in touched:
                continue
            touched += [left, right]
            del self._rows[_ends(a, b)]
            self._rows[_ends(c, d)] = row
            edges[:, row] = d, c, a, b, left, right
            # The four edges around it get another opposite corner, two of them in the other triangle.
            for p, q, was, old, now, new in (
                (b, c, a, left, d, right),
                (c, a, b, left, d, left),
                (a, d, b, right, c, left),
                (d, b, a, right, c, right),
            ):
                around = self._rows.get(_ends(p, q))
                if around is None:
                    hull[_APEX:, hull[_CORNER] == p] = [[now], [new]]
                else:
                    side = 0 if edges[_C, around] == was and edges[_LEFT, around] == old else 1
                    edges[_C + side, around] = now
                    edges[_LEFT + side, around] = new


def _ends(p: int, q: int) -> tuple[int, int]:
    return (p, q) if p < q else (q, p)


def _triangulate(position: Floats) -> tuple[_Mesh | None, Ints]:
    count = len(position)
    if count < 4:
        return None, np.column_stack(every_pair(count))
    from scipy.spatial import Delaunay, QhullError  # slow to import, and few swarms need it

    try:
        found = Delaunay(position)
    except QhullError:  # all points on one line, or at one place
        return None, np.column_stack(every_pair(count))
    triangles = found.simplices.astype(np.int64)
    a, b, c = position.view(np.complex128)[:, 0].take(triangles.T)
    clockwise = _turn(b - a, c - a) < 0.0
    across = found.neighbors.astype(np.int64)
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    across[clockwise] = across[clockwise][:, ::-1]
    starts, ends = triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]  # the side opposite each corner
    mesh = _Mesh(_inner_edges(triangles, starts, ends, across), _hull_edges(triangles, starts, ends, across))
    pairs = _pairs_of(mesh, count)
    if len(found.coplanar):
        return None, _with_coincident(pairs, found.coplanar[:, [0, 2]].astype(np.int64), count)
    return mesh, pairs


def _inner_edges(triangles: Ints, starts: Ints, ends: Ints, across: Ints) -> Ints:
    """Return (6, e) every inner edge once."""
    row, corner = np.nonzero(across > np.arange(len(triangles))[:, None])
    other = across[row, corner]
    a, b, c = starts[row, corner], ends[row, corner], triangles[row, corner]
    d = triangles[other].sum(axis=1) - a - b
    return np.array([a, b, c, d, row, other])


def _hull_edges(triangles: Ints, starts: Ints, ends: Ints, across: Ints) -> Ints:
    """Return (5, h) the hull's corners: before, corner, after, and the triangle on the side to that."""
    row, corner = np.nonzero(across < 0)
    start, end = starts[row, corner], ends[row, corner]
    order = np.argsort(end)
    before = start[order][np.searchsorted(end[order], start)]
    return np.array([before, start, end, triangles[row, corner], row])


def _pairs_of(mesh: _Mesh, count: int) -> Ints:
    """Return (k, 2) the ends of every edge, in order, ascending."""
    p, q = np.concatenate([mesh.edges[:2], mesh.hull[:2]], axis=1)
    keys = np.sort(np.minimum(p, q) * count + np.maximum(p, q))
    return np.column_stack([keys // count, keys % count])


def _with_coincident(pairs: Ints, twins: Ints, count: int) -> Ints:
    """Return `pairs` with those of the points that were left out: (k, 2) each with the one that stands for it."""
    extra = [pairs]
    for point, stand_in in twins.tolist():
        near = pairs[(pairs == stand_in).any(axis=1)]
        friends = np.concatenate([near.sum(axis=1) - stand_in, [stand_in], twins[twins[:, 1] == stand_in, 0]])
        friends = friends[friends != point]
        extra.append(np.column_stack([np.minimum(friends, point), np.maximum(friends, point)]))
    together = np.concatenate(extra)
    keys = np.unique(together[:, 0] * count + together[:, 1])
    return np.column_stack([keys // count, keys % count])


def _wrong_edges(mesh: _Mesh, position: Floats) -> Ints | None:
    """Return the edges that are to be flipped; None where the triangles do not cover the hull, each place once."""
    place = position.view(np.complex128)[:, 0]  # one lookup for x and y
    before, corner, after = place.take(mesh.hull[:_APEX])
    if _turn(corner - before, after - before).min() < 0.0:
        return None
    # a, b, c, a, b, with the corner d for the origin.
    ends = place.take(mesh.edges[: _D + 1])
    around = np.empty((5, ends.shape[1]), dtype=np.complex128)
    np.subtract(ends[:_D], ends[_D], out=around[:_D])
    around[_D:] = around[:2]
    bc, ca, ab = turns = _turn(around[1:4], around[2:])
    # Every triangle is on one side of an inner edge: a b c on the left, or b a d on the right.
    if ab.max() >= 0.0 or (ab + bc + ca).min() <= 0.0:
        return None
    # True if the corner d lies within the circle through a, b and c.
    x, y = around.real[:_D], around.imag[:_D]
    a, b, c = (x * x + y * y) * turns
    return np.flatnonzero(a + b + c > 0.0)


def _turn(p: Complexes, q: Complexes) -> Floats:
    """Return the turn from p to q, vectors of one shape: twice the area of the triangles with the origin."""
    # Not a product of complex numbers: that rounds differently on processors with fused multiply-add.
    turn: Floats = p.real * q.imag - p.imag * q.real
    return turn
