"""Who is a Voronoi neighbour of whom: the Delaunay triangulation of a swarm, kept from scene to scene.

While robots move little their triangulation seldom changes. So the last one is tried first: if its triangles still turn
counter-clockwise, its rim is still convex and no edge should be flipped, it is the Delaunay triangulation of the new
positions too (Delaunay's lemma), and that is far quicker to see than to triangulate anew. Robots that share one place, and
swarms on one line, are dealt with as stated; nothing here knows of ranges, walls or noise.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import Delaunay, QhullError

from zwerm.world.scene import Bools, Floats, Ints


class _Mesh(NamedTuple):
    """A triangulation: counter-clockwise triangles, its inner edges with the corners across, and its rim."""

    triangles: Ints  # (t, 3)
    edges: Ints  # (e, 4) left corner a, b of an inner edge, the corner c left of a -> b, and d right of it
    rim: Ints  # (h, 3) consecutive corners of the convex hull, counter-clockwise


class Tessellation:
    """The Delaunay pairs of points that move."""

    def __init__(self) -> None:
        self._mesh: _Mesh | None = None
        self._position: Floats = np.empty((0, 2))
        self._pairs: Ints = np.empty((0, 2), dtype=np.int64)

    def pairs(self, position: Floats) -> Ints:
        """Return (k, 2) rows i < j of position (n, 2) that are Voronoi neighbours in the plane, ascending.

        Of points at one place, one has the neighbours, and the others are neighbours of it, of its neighbours and of one
        another. Points on one line, and fewer than four, are all neighbours: too many do no harm to who clips a cell.
        """
        if position.shape == self._position.shape and (
            (position == self._position).all() or (self._mesh is not None and _holds(self._mesh, position))
        ):
            return self._pairs
        self._position = position.copy()
        self._mesh, self._pairs = _triangulate(position)
        self._pairs.flags.writeable = False
        return self._pairs


def _everyone(count: int) -> Ints:
    return np.column_stack(np.triu_indices(count, 1)).astype(np.int64)


def _triangulate(position: Floats) -> tuple[_Mesh | None, Ints]:
    count = len(position)
    if count < 4:
        return None, _everyone(count)
    try:
        found = Delaunay(position)
    except QhullError:  # all on one line, or at one place
        return None, _everyone(count)
    triangles = found.simplices.astype(np.int64)
    a, b, c = (position[triangles[:, corner]] for corner in range(3))
    clockwise = _turn(a, b, c) < 0.0
    across = found.neighbors.astype(np.int64)
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    across[clockwise] = across[clockwise][:, ::-1]
    starts, ends = triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]  # the side opposite each corner
    keys = np.sort(np.minimum(starts, ends) * count + np.maximum(starts, ends), axis=None)
    keys = np.unique(keys)
    pairs = np.column_stack([keys // count, keys % count])
    if len(found.coplanar):
        return None, _with_coincident(pairs, found.coplanar[:, [0, 2]].astype(np.int64), count)
    return _Mesh(triangles, _inner_edges(triangles, starts, ends, across), _rim(starts, ends, across)), pairs


def _inner_edges(triangles: Ints, starts: Ints, ends: Ints, across: Ints) -> Ints:
    """Return (e, 4) every inner edge once."""
    row, corner = np.nonzero(across > np.arange(len(triangles))[:, None])
    other = across[row, corner]
    a, b, c = starts[row, corner], ends[row, corner], triangles[row, corner]
    d = triangles[other].sum(axis=1) - a - b
    return np.column_stack([a, b, c, d])


def _rim(starts: Ints, ends: Ints, across: Ints) -> Ints:
    """Return (h, 3) the hull's corners with the one before and the one after."""
    row, corner = np.nonzero(across < 0)
    start, end = starts[row, corner], ends[row, corner]
    order = np.argsort(start)
    after = end[order][np.searchsorted(start[order], end)]
    return np.column_stack([start, end, after])


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


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return twice the signed area of the triangles a, b, c, each (k, 2)."""
    turn: Floats = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return turn


def _holds(mesh: _Mesh, position: Floats) -> bool:
    """Tell whether the triangulation is Delaunay for these positions."""
    x, y = position[:, 0], position[:, 1]
    a, b, c, d = mesh.edges.T
    xd, yd = x[d], y[d]
    ax, ay, bx, by, cx, cy = x[a] - xd, y[a] - yd, x[b] - xd, y[b] - yd, x[c] - xd, y[c] - yd
    ab, bc, ca = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
    inside = (ax * ax + ay * ay) * bc + (bx * bx + by * by) * ca + (cx * cx + cy * cy) * ab
    if (inside > 0.0).any():
        return False
    p, q, r = mesh.triangles.T
    turn: Bools = (x[q] - x[p]) * (y[r] - y[p]) - (y[q] - y[p]) * (x[r] - x[p]) > 0.0
    if not turn.all():
        return False
    p, q, r = mesh.rim.T
    convex: Bools = (x[q] - x[p]) * (y[r] - y[p]) - (y[q] - y[p]) * (x[r] - x[p]) >= 0.0
    return bool(convex.all())
