"""The fence of a swarm: which sides of which edges are uncovered, and where a robot would go to cover them.

Algorithms 3 and 4 of Ramaithitima et al. 2015, from bearings alone. Every question is about one edge and what its two ends see,
or one robot and its neighbours: views are each in the robot's own frame, and only differences of bearings of one robot are
ever taken. Positive is to the left. The printed formula for a relative bearing is off by pi; here it is the plain difference.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from zwerm.maths.simplicial import Edge, FlagComplex, edge

Views = Mapping[int, Mapping[int, float]]

SIXTY_RAD = math.pi / 3.0


class Side(NamedTuple):
    """One uncovered side of an edge i < j: `sign` is +1 where it is on the left of the way from i to j.

    `angle_i_rad` and `angle_j_rad` are the magnitudes of the bearings, off the edge, at which a new robot shall be seen.
    """

    i: int
    j: int
    sign: int
    angle_i_rad: float = SIXTY_RAD
    angle_j_rad: float = SIXTY_RAD

    @property
    def edge(self) -> Edge:
        """The edge."""
        return self.i, self.j


class Fence(NamedTuple):
    """The uncovered sides, but for those at convex corners, and the edges that are obstacle edges because of a corner."""

    sides: tuple[Side, ...]
    corners: tuple[Edge, ...]


def relative(view: Mapping[int, float], j: int, k: int) -> float:
    """Return theta_jk [rad] in [-pi, pi]: the bearing to k from that to j, positive to the left."""
    return math.remainder(view[k] - view[j], math.tau)


def side_of(views: Views, i: int, j: int, k: int) -> int:
    """Return on which side of the way from i to j their common neighbour k is, by both ends' bearings."""
    return 1 if math.sin(relative(views[i], j, k)) - math.sin(relative(views[j], i, k)) > 0.0 else -1


def uncovered(views: Views, complex_: FlagComplex, i: int, j: int) -> tuple[int, ...]:
    """Return the sides of edge {i, j} without a triangle. Algorithm 3, line 4."""
    covered = {side_of(views, i, j, k) for k in complex_.common(i, j)}
    return tuple(sign for sign in (1, -1) if sign not in covered)


def is_exception(views: Views, complex_: FlagComplex, i: int, j: int) -> bool:
    """Tell whether {i, j} lies within other triangles of a common neighbour k. Section III-A.1.

    Seen from k, a chain of triangles leads from i to j without turning back. The chain's ends must be beyond the edge: else
    it passes this side of it and covers nothing behind.
    """
    for k in complex_.common(i, j):
        whole = relative(views[k], i, j)
        if whole == 0.0:  # all three stand along a wall, or two at one spot
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
    """Tell whether a robot is on the other side of edge {i, j} than `side`, by whichever of its ends sees it."""
    if edge(i, each) in complex_:
        return math.sin(relative(views[i], j, each)) * side < 0.0
    return -math.sin(relative(views[j], i, each)) * side < 0.0


def nearest_on_side(views: Views, complex_: FlagComplex, i: int, j: int, sign: int) -> int | None:
    """Return the neighbour of i next to j on one side of the ray from i to j. Algorithm 4, lines 3 to 6."""
    found = [
        (sign * relative(views[i], j, each), each)
        for each in complex_.neighbours[i]
        if each != j and sign * relative(views[i], j, each) > 0.0
    ]
    return min(found)[1] if found else None


def fence(views: Views, complex_: FlagComplex, corner_margin_rad: float, edges: Iterable[Edge] | None = None) -> Fence:
    """Return the fence, or what `edges` have of it. Algorithm 3 without the touch sensors.

    A corner narrower than 60 degrees and a margin is closed: its robots are so near to each other that they see all of it.
    The paper's margin is -2 beta, for a bearing error beta.
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
    """Yield (i, a, b, gap_rad) for every pair of neighbours a, b of i, b the next to the left of a, with no triangle iab.

    A robot with one neighbour has one such gap, all around: a is b. Together their edges are a closed chain around all
    that is uncovered, where the edges of the sign rule may not be.
    """
    for i in complex_.vertices if vertices is None else vertices:
        around = sorted(complex_.neighbours[i], key=lambda each: (math.remainder(views[i][each], math.tau), each))
        for a, b in zip(around, [*around[1:], *around[:1]], strict=True):
            gap = (views[i][b] - views[i][a]) % math.tau if a != b else math.tau
            if gap >= math.pi or edge(a, b) not in complex_:
                yield i, a, b, gap
