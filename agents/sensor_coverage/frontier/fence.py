"""The fence of a swarm: the uncovered sides of its edges, and the bearings at which a new robot covers them.

Algorithms 3 and 4 of Ramaithitima et al. 2015, from bearings alone. Each function needs the views of one edge's two
ends, or of one robot and its neighbours. A view is in its robot's own frame, so only differences of one robot's
bearings are used. Positive angles are to the left. The printed formula for a relative bearing is off by pi; here it is
the plain difference.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from zwerm.maths.simplicial import Edge, FlagComplex, edge

# The bearing [rad] of each visible slot, by the slot that sees it.
Views = Mapping[int, Mapping[int, float]]

SIXTY_RAD = math.pi / 3.0
# A deployment into a gap around one slot keeps at least this angle [rad] to both neighbours beside the gap.
VERTEX_BESIDE_RAD = math.radians(75.0)


class Side(NamedTuple):
    """One uncovered side of an edge i < j: `sign` is +1 on the left of the direction from i to j, and -1 on the right.

    `angle_i_rad` and `angle_j_rad` are the angles between the edge and the new robot, as i and j see it.
    """

    i: int
    j: int
    sign: int
    angle_i_rad: float = SIXTY_RAD
    angle_j_rad: float = SIXTY_RAD

    @property
    def edge(self) -> Edge:
        """The edge (i, j)."""
        return self.i, self.j


class Fence(NamedTuple):
    """The uncovered sides that are not at convex corners, and the edges that a corner makes obstacle edges."""

    sides: tuple[Side, ...]
    corners: tuple[Edge, ...]


def relative(view: Mapping[int, float], j: int, k: int) -> float:
    """Return theta_jk [rad] in [-pi, pi]: the bearing to k minus the bearing to j, positive to the left."""
    return math.remainder(view[k] - view[j], math.tau)


def side_of(views: Views, i: int, j: int, k: int) -> int:
    """Return +1 if the common neighbour k is on the left of the direction from i to j, else -1, by both ends' bearings."""
    return 1 if math.sin(relative(views[i], j, k)) - math.sin(relative(views[j], i, k)) > 0.0 else -1


def uncovered(views: Views, complex_: FlagComplex, i: int, j: int) -> tuple[int, ...]:
    """Return the signs of the sides of edge {i, j} that have no triangle. Algorithm 3, line 4."""
    covered = {side_of(views, i, j, k) for k in complex_.common(i, j)}
    return tuple(sign for sign in (1, -1) if sign not in covered)


def is_exception(views: Views, complex_: FlagComplex, i: int, j: int) -> bool:
    """Return whether {i, j} lies within other triangles of a common neighbour k. Section III-A.1.

    Seen from k, a chain of triangles leads from i to j without turning back. The chain's ends must be beyond the edge.
    Otherwise the chain passes on the near side of the edge and covers nothing behind it.
    """
    for k in complex_.common(i, j):
        whole = relative(views[k], i, j)
        if whole == 0.0:  # all three stand in one line along a wall, or two at the same point
            continue
        side = side_of(views, i, j, k)
        between = [
            each
            for each in complex_.neighbours[k]
            if each not in (i, j) and 0.0 < relative(views[k], i, each) / whole < 1.0
        ]
        between.sort(key=lambda each: abs(relative(views[k], i, each)))
        reached = [each for each in between if edge(i, each) in complex_ and _beyond(views, complex_, i, j, each, side)]
        for each in between:
            if each not in reached and any(
                edge(other, each) in complex_ and abs(relative(views[k], i, other)) < abs(relative(views[k], i, each))
                for other in reached
            ):
                reached.append(each)
        if any(edge(j, each) in complex_ and _beyond(views, complex_, i, j, each, side) for each in reached):
            return True
    return False


def _beyond(views: Views, complex_: FlagComplex, i: int, j: int, each: int, side: int) -> bool:
    """Return whether a robot is on the side of edge {i, j} opposite to `side`, by the bearing of an end that sees it."""
    if edge(i, each) in complex_:
        return math.sin(relative(views[i], j, each)) * side < 0.0
    return -math.sin(relative(views[j], i, each)) * side < 0.0


def nearest_on_side(views: Views, complex_: FlagComplex, i: int, j: int, sign: int) -> int | None:
    """Return the neighbour of i with the smallest angle to j on one side of edge {i, j}. Algorithm 4, lines 3 to 6."""
    found = [
        (sign * relative(views[i], j, each), each)
        for each in complex_.neighbours[i]
        if each != j and sign * relative(views[i], j, each) > 0.0
    ]
    return min(found)[1] if found else None


def fence(views: Views, complex_: FlagComplex, corner_margin_rad: float, edges: Iterable[Edge] | None = None) -> Fence:
    """Return the fence, or the part of it on `edges`. Algorithm 3 without the touch sensors.

    A corner narrower than 60 degrees plus the margin is closed: its robots are so close that they cover it. The paper's
    margin is -2 beta, for a bearing error beta.
    """
    sides: list[Side] = []
    corners: dict[Edge, None] = {}
    for i, j in complex_.edges if edges is None else edges:
        open_signs = uncovered(views, complex_, i, j)
        if not open_signs or is_exception(views, complex_, i, j):
            continue
        for sign in open_signs:
            angles = [SIXTY_RAD, SIXTY_RAD]
            closed = False
            for end, (a, b, left) in enumerate(((i, j, sign), (j, i, -sign))):
                other = nearest_on_side(views, complex_, a, b, left)
                if other is None:
                    continue
                gap = abs(relative(views[a], b, other))
                if gap < SIXTY_RAD + corner_margin_rad:
                    corners[edge(a, other)] = corners[edge(a, b)] = None
                    closed = True
                angles[end] = min(SIXTY_RAD, gap / 2.0)
            if not closed:
                sides.append(Side(i, j, sign, angles[0], angles[1]))
    return Fence(tuple(sides), tuple(sorted(corners)))


def wedges(
    views: Views, complex_: FlagComplex, vertices: Iterable[int] | None = None
) -> Iterable[tuple[int, int, int, float]]:
    """Yield (i, a, b, gap_rad) for all neighbours a and b of i that form no triangle iab. b is the next to the left of a.

    A robot with one neighbour has one gap of a full turn, and a equals b. The edges of all wedges contain a closed
    chain around all uncovered space. The edges of the sign rule alone may not.
    """
    for i in complex_.vertices if vertices is None else vertices:
        around = sorted(complex_.neighbours[i], key=lambda each: (math.remainder(views[i][each], math.tau), each))
        for a, b in zip(around, [*around[1:], *around[:1]], strict=True):
            gap = (views[i][b] - views[i][a]) % math.tau if a != b else math.tau
            if gap >= math.pi or edge(a, b) not in complex_:
                yield i, a, b, gap
