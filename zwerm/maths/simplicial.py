"""Flag complexes of a graph up to dimension 2, and their homology over Z2.

A flag complex contains every triangle whose three edges it contains. It is the Vietoris-Rips complex of a swarm, built from
visibility alone (Ramaithitima et al. 2015, algorithm 2). Chains over Z2 are Python integers with one bit for each simplex,
so that the sum of two chains is one XOR. No function uses positions, and no result depends on the order of a set.

In dimension 2 the boundary of every tetrahedron is a 2-cycle, so H2 alone proves nothing. A relative cycle whose boundary is
on the fence proves coverage; `find_redundant` looks for such a cycle.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

Edge = tuple[int, int]
Triangle = tuple[int, int, int]


def edge(i: int, j: int) -> Edge:
    """Return the edge between two vertices, the smaller id first."""
    return (i, j) if i < j else (j, i)


class FlagComplex:
    """Vertices, edges and triangles, each in ascending order; `neighbours` maps a vertex to its neighbours."""

    def __init__(self, neighbours: Mapping[int, Iterable[int]]) -> None:
        """Take neighbour lists. There is an edge where both vertices list each other: the two robots see each other."""
        named = {vertex: frozenset(listed) for vertex, listed in sorted(neighbours.items())}
        self.neighbours: dict[int, tuple[int, ...]] = {
            i: tuple(j for j in sorted(listed) if j != i and j in named and i in named[j])
            for i, listed in named.items()
        }
        self.vertices: tuple[int, ...] = tuple(self.neighbours)
        self.edges: tuple[Edge, ...] = tuple((i, j) for i, each in self.neighbours.items() for j in each if i < j)
        self._known = frozenset(self.edges)

    @cached_property
    def triangles(self) -> tuple[Triangle, ...]:
        """All triangles, ascending; found when they are first needed."""
        return tuple((i, j, k) for i, j in self.edges for k in self.neighbours[j] if k > j and (i, k) in self._known)

    def __contains__(self, simplex: Edge) -> bool:
        """True if the complex contains the ordered simplex."""
        return simplex in self._known

    def triangles_at(self, i: int) -> tuple[Triangle, ...]:
        """Return the triangles that contain a vertex, ascending."""
        around = self.neighbours[i]
        beside = ((j, k) for n, j in enumerate(around) for k in around[n + 1 :] if (j, k) in self._known)
        return tuple(sorted((i, j, k) if i < j else (j, i, k) if i < k else (j, k, i) for j, k in beside))

    def common(self, i: int, j: int) -> tuple[int, ...]:
        """Return the vertices that see both i and j, ascending."""
        return tuple(k for k in self.neighbours[i] if edge(j, k) in self._known)

    def without(self, vertices: Iterable[int]) -> "FlagComplex":
        """Return the complex without some vertices and all simplices that contain them."""
        gone = frozenset(vertices)
        return FlagComplex({v: each for v, each in self.neighbours.items() if v not in gone})

    def components(self) -> list[tuple[int, ...]]:
        """Return the vertices of every connected component, ascending."""
        found: list[tuple[int, ...]] = []
        seen: dict[int, None] = {}
        for start in self.vertices:
            if start in seen:
                continue
            seen[start] = None
            reached = [start]
            for vertex in reached:
                for each in self.neighbours[vertex]:
                    if each not in seen:
                        seen[each] = None
                        reached.append(each)
            found.append(tuple(sorted(reached)))
        return found


# --- chains as bits -------------------------------------------------------------------------------------------------


def boundaries(complex_: FlagComplex) -> list[int]:
    """Return the boundary of every triangle, as bits over the edges."""
    number = {each: 1 << n for n, each in enumerate(complex_.edges)}
    return [number[i, j] | number[i, k] | number[j, k] for i, j, k in complex_.triangles]


def bits(chain: int) -> Iterator[int]:
    """Yield the positions of the set bits, ascending."""
    while chain:
        low = chain & -chain
        yield low.bit_length() - 1
        chain ^= low


def reduce_chain(chain: int, pivots: Mapping[int, int]) -> int:
    """Return `chain` reduced by columns keyed by their highest bit: 0 if and only if it is in their span."""
    while chain:
        column = pivots.get(chain.bit_length())
        if column is None:
            break
        chain ^= column
    return chain


def rank(columns: Iterable[int]) -> int:
    """Return the rank over Z2 of columns given as bits."""
    pivots: dict[int, int] = {}
    for column in columns:
        left = reduce_chain(column, pivots)
        if left:
            pivots[left.bit_length()] = left
    return len(pivots)


def betti(complex_: FlagComplex) -> tuple[int, int]:
    """Return the Betti numbers (b0, b1): the number of connected components, and the number of holes."""
    pieces = len(complex_.components())
    cycles = len(complex_.edges) - len(complex_.vertices) + pieces
    return pieces, cycles - rank(boundaries(complex_))


def hole_cycles(complex_: FlagComplex) -> list[tuple[int, ...]]:
    """Return one closed walk around each hole: a shortest basis of H1.

    From one of its vertices, every cycle of such a basis is two shortest paths and an edge (Erickson and Whittlesey 2005). Of
    two cycles around the same hole from the same vertex one is enough.
    """
    labels, count = _edge_labels(complex_)
    found: dict[tuple[int, ...], int] = {}
    for root in complex_.vertices if count else ():
        before, depth, label = {root: root}, {root: 0}, {root: 0}
        reached = [root]
        shortest: dict[int, tuple[int, Edge]] = {}  # hole: length of the cycle, and its edge opposite to the root
        for i in reached:
            for j in complex_.neighbours[i]:
                here = label[i] ^ labels[edge(i, j)]
                if j not in before:
                    before[j], depth[j], label[j] = i, depth[i] + 1, here
                    reached.append(j)
                elif around := here ^ label[j]:
                    known, length = shortest.get(around), depth[i] + depth[j] + 1
                    if known is None or (length, (i, j)) < known:
                        shortest[around] = length, (i, j)
        for around, (_, (i, j)) in sorted(shortest.items()):
            there, back = _ancestors(i, before), _ancestors(j, before)
            if not set(there[:-1]) & set(back[:-1]):
                found.setdefault((*reversed(there), *back[:-1]), around)
    pivots: dict[int, int] = {}
    chosen: list[tuple[int, ...]] = []
    for cycle, around in sorted(found.items(), key=lambda each: (len(each[0]), each)):
        left = reduce_chain(around, pivots)
        if left:
            pivots[left.bit_length()] = left
            chosen.append(cycle)
    return chosen


def _ancestors(vertex: int, before: Mapping[int, int]) -> list[int]:
    """Return the path from a vertex to the root, whose predecessor is itself."""
    found = [vertex]
    while before[found[-1]] != found[-1]:
        found.append(before[found[-1]])
    return found


def _edge_labels(complex_: FlagComplex) -> tuple[dict[Edge, int], int]:
    """Return b1 bits for every edge, and b1. The sum of the bits over a closed walk names the holes that it surrounds."""
    root = {vertex: vertex for vertex in complex_.vertices}

    def root_of(vertex: int) -> int:
        while root[vertex] != vertex:
            root[vertex] = vertex = root[root[vertex]]
        return vertex

    off_tree: dict[Edge, int] = {}
    for i, j in complex_.edges:
        if root_of(i) == root_of(j):
            off_tree[i, j] = 1 << len(off_tree)
        else:
            root[root_of(i)] = root_of(j)
    pivots: dict[int, int] = {}
    for i, j, k in complex_.triangles:
        left = reduce_chain(off_tree.get((i, j), 0) ^ off_tree.get((i, k), 0) ^ off_tree.get((j, k), 0), pivots)
        if left:
            pivots[left.bit_length()] = left
    free = [n for n in range(1, len(off_tree) + 1) if n not in pivots]
    # The leading edge of a column equals the sum of the column's other edges, which are lower and so come first.
    value = {n: 1 << at for at, n in enumerate(free)}
    for n in sorted(pivots):
        value[n] = 0
        for other in bits(pivots[n] ^ (1 << (n - 1))):
            value[n] ^= value[other + 1]
    labels = {each: value[column.bit_length()] for each, column in off_tree.items()}
    return {each: labels.get(each, 0) for each in complex_.edges}, len(free)


def relative_cycles(complex_: FlagComplex, fence: Iterable[Edge]) -> tuple[list[int], list[int]]:
    """Return a basis of the relative 2-cycles of (complex, fence), and their boundaries.

    The cycles are bits over the triangles, and the boundaries are bits over the edges. A boundary has fence edges only. The
    complex has no 3-simplices, so this is a basis of its relative H2.
    """
    on_fence = frozenset(fence)
    inner = sum(1 << n for n, each in enumerate(complex_.edges) if each not in on_fence)
    columns: dict[int, tuple[int, int]] = {}  # highest inner bit: (inner part, combination of triangles)
    whole = boundaries(complex_)
    cycles: list[int] = []
    for number, boundary in enumerate(whole):
        combination = _absorb(boundary & inner, 1 << number, columns)
        if combination:
            cycles.append(combination)
    return cycles, [_boundary(cycle, whole) for cycle in cycles]


def _absorb(chain: int, combination: int, columns: dict[int, tuple[int, int]]) -> int:
    """Reduce a chain by columns, which are keyed by their highest bit, and reduce its combination of triangles likewise.

    A remainder is stored as a new column, and 0 is returned. Without a remainder the combination is a cycle, and is returned.
    """
    while chain:
        known = columns.get(chain.bit_length())
        if known is None:
            columns[chain.bit_length()] = chain, combination
            return 0
        chain ^= known[0]
        combination ^= known[1]
    return combination


def _boundary(cycle: int, whole: list[int]) -> int:
    chain = 0
    for triangle in bits(cycle):
        chain ^= whole[triangle]
    return chain


# --- redundant vertices ---------------------------------------------------------------------------------------------


def may_leave(vertex: int, neighbours: Mapping[int, Iterable[int]]) -> bool:
    """Return whether a vertex can leave without changing b0 or b1: the link criterion.

    It can iff the flag complex of the graph that its neighbours induce is non-empty, connected and has no holes.
    """
    around = tuple(neighbours[vertex])
    if not around:
        return False
    seen = {each: frozenset(neighbours[each]) for each in around}
    if any(all(other in seen[each] for other in around if other != each) for each in around):
        return True  # one neighbour sees all others: the link is a cone
    return betti(FlagComplex({each: [other for other in around if other in seen[each]] for each in around})) == (1, 0)


class RedundantVertices(NamedTuple):
    """A relative 2-cycle through the fence, and the vertices that it does not need."""

    redundant: tuple[int, ...]
    cycle: tuple[Triangle, ...]
    boundary: tuple[Edge, ...]
    missed: tuple[int, ...]  # fence vertices of triangles that the boundary of the cycle does not pass


NONE_REDUNDANT = RedundantVertices((), (), (), ())


def find_redundant(
    complex_: FlagComplex,
    fence: Iterable[Edge],
    keep: Iterable[int] = (),
    missed_max: int = 0,
    order: Callable[[int], int] | None = None,
) -> RedundantVertices:
    """Return a relative 2-cycle with its boundary on the fence, and the vertices that a greedy search can remove.

    Vertices of the fence, those in `keep` and those in no triangle always stay. The others are tried one by one, in
    ascending `order`; by default the vertex with most neighbours first. `may_leave` decides: a removal keeps the homotopy
    type, and so the class of the cycle. The cycle must pass all fence vertices of triangles except `missed_max`; otherwise
    it certifies nothing (de Silva and Ghrist 2006), and no vertex is redundant.
    """
    on_fence = tuple(sorted(set(fence)))
    guarded = {vertex for each in on_fence for vertex in each} | set(keep)
    left = {vertex: set(each) for vertex, each in complex_.neighbours.items()}
    key = order or (lambda vertex: -len(complex_.neighbours[vertex]))
    removed: list[int] = []
    for vertex in sorted((v for v in complex_.vertices if v not in guarded), key=lambda v: (key(v), v)):
        if may_leave(vertex, {each: sorted(left[each]) for each in (vertex, *sorted(left[vertex]))}):
            for each in sorted(left.pop(vertex)):
                left[each].discard(vertex)
            removed.append(vertex)
    reduced = FlagComplex(left)
    cycles, edges = relative_cycles(reduced, on_fence)
    cycle, boundary = _widest(cycles, edges, reduced)
    passed = {vertex for n in bits(boundary) for vertex in reduced.edges[n]}
    fenced = {vertex for each in on_fence for vertex in each}
    solid = {vertex for each in reduced.triangles for vertex in each}
    missed = tuple(sorted((fenced & solid) - passed))
    if not boundary or len(missed) > missed_max:
        return NONE_REDUNDANT._replace(missed=missed)
    return RedundantVertices(
        tuple(sorted(removed)),
        tuple(reduced.triangles[n] for n in bits(cycle)),
        tuple(reduced.edges[n] for n in bits(boundary)),
        missed,
    )


def _widest(cycles: list[int], edges: list[int], complex_: FlagComplex) -> tuple[int, int]:
    """Return the sum of cycles whose boundary passes most vertices, found greedily, and that boundary."""
    incident = [(1 << i) | (1 << j) for i, j in complex_.edges]

    def passed(boundary: int) -> int:
        reached = 0
        for n in bits(boundary):
            reached |= incident[n]
        return reached.bit_count()

    pivots: dict[int, tuple[int, int]] = {}
    for cycle, boundary in zip(cycles, edges, strict=True):
        _absorb(boundary, cycle, pivots)
    best_boundary = best_cycle = 0
    best = (0, 0)
    for boundary, cycle in pivots.values():
        found = passed(best_boundary ^ boundary), (best_boundary ^ boundary).bit_count()
        if found > best:
            best, best_boundary, best_cycle = found, best_boundary ^ boundary, best_cycle ^ cycle
    return best_cycle, best_boundary
