"""The next frontier for a robot, and the path there: cost-utility over the navigation graph.

Section IV-C of Ramaithitima and Bhattacharya 2018: CU(S, <a, b>) = U(<a, b>) - beta C(S, <a, b>). The cost C is that of
the cheapest path from the present observation S to an observation that contains a and b. The utility U is n / (m + 1).
n is the number of open frontiers that share a landmark with <a, b>. m is the number of robots sent to a or b. The
search ends as soon as no frontier farther away can be better.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from typing import Final, NamedTuple, Protocol

from zwerm.agents.landmark_exploration.mapping.frontier_status import Frontiers, pair_of
from zwerm.agents.landmark_exploration.mapping.landmark_complex import LandmarkComplex

# The vertex before the first of a path: the robot itself.
HERE = -1

# Margin of a cost limit, so that rounding excludes no vertex of equal gain.
_ROUNDING: Final = 1e-6


class Reached(NamedTuple):
    """A vertex of the navigation graph, the cost of the path to it, and the vertex before it on that path, or HERE."""

    cost: float
    vertex: int
    before: int


class Choice(NamedTuple):
    """A frontier (its key), the vertices of the path to it, in order, and its gain."""

    key: int
    path: tuple[int, ...]
    gain: float


class CostLimit:
    """The largest cost of a wanted vertex. A caller may lower it during a search."""

    def __init__(self) -> None:
        self.cost = math.inf


def reach(complex_: LandmarkComplex, landmarks: Sequence[int], limit: CostLimit | None = None) -> Iterator[Reached]:
    """Yield the vertices that can be navigated to from where `landmarks` are seen, the cheapest first (Dijkstra 1959).

    Vertices that cost more than `limit` may be left out.
    """
    queue = [(1.0 / (shared - 1), vertex, HERE) for vertex, shared in complex_.adjacent(landmarks).items()]
    queue.sort()
    best = {vertex: cost for cost, vertex, _ in queue}
    neighbours, limit = complex_.neighbours, limit or CostLimit()
    while queue:
        cost, vertex, before = heappop(queue)
        if cost > best[vertex]:
            continue  # a cheaper path to it was found meanwhile
        yield Reached(cost, vertex, before)
        cost_max = limit.cost
        for other, shared in neighbours[vertex].items():
            farther = cost + 1.0 / (shared - 1)
            if farther <= cost_max and farther < best.get(other, math.inf):
                best[other] = farther
                heappush(queue, (farther, other, vertex))


def path_to(vertex: int, before: Mapping[int, int]) -> tuple[int, ...]:
    """Return the vertices from the present observation to `vertex`, given the vertex before each."""
    path = [vertex]
    while before[path[-1]] != HERE:
        path.append(before[path[-1]])
    return tuple(reversed(path))


class Offer:
    """The open frontiers that are free, and what each is worth: its utility, worked out when it is asked for.

    `taken` are the keys of frontiers that robots are sent to, `avoided` others that are not to be chosen.
    """

    def __init__(self, frontiers: Frontiers, taken: Iterable[int], avoided: Collection[int] = ()) -> None:
        self._frontiers = frontiers
        self._taken: dict[int, None] = {}
        self._avoided = avoided
        self._sent: dict[int, int] = {}  # landmark: robots sent to a frontier with it
        self._utility: dict[int, float] = {}
        self._most: float | None = None
        for key in taken:
            self.take(key)

    def take(self, key: int) -> None:
        """Record that a robot is sent to a frontier."""
        self._taken[key] = None
        for landmark in pair_of(key):
            self._sent[landmark] = self._sent.get(landmark, 0) + 1
        self._utility.clear()

    def most(self) -> float:
        """Return an upper bound of all utilities, now and later."""
        if self._most is None:
            self._most = self._bound()
        return self._most

    def _bound(self) -> float:
        """Return the greatest (n_a + n_b) / (1 + m) of all free <a, b>; n_a is the number of open frontiers with landmark a.

        Landmarks come by descending n_a. So a frontier not seen before has n_b <= n_a, and the bound 2 n_a / (1 + m_a).
        """
        open_of, sent, taken, best = self._frontiers.open_of, self._sent, self._taken, 0.0
        count = dict(zip(open_of, map(len, open_of.values()), strict=True))
        for landmark in sorted(count, key=count.__getitem__, reverse=True):
            twice = 2 * count[landmark]
            if twice <= best:
                break
            if twice <= best * (1 + sent.get(landmark, 0)):
                continue
            for key in open_of[landmark]:
                a, b = key >> 16, key & 0xFFFF
                robots = sent.get(a, 0) + sent.get(b, 0)
                if robots:
                    if key in taken:
                        continue
                    robots -= (b << 16 | a) in taken
                best = max(best, (count[a] + count[b]) / (1 + robots))
        return best

    def is_empty(self) -> bool:
        """Return whether no frontier is free."""
        return not any(self.is_free(key) for key in self._frontiers.open)

    def free_keys(self, most: int) -> list[int] | None:
        """Return all free frontiers, ascending; None where there are more than `most`."""
        open_ = self._frontiers.open
        if len(open_) - len(self._taken) - len(self._avoided) > most:
            return None
        found = sorted(key for key in open_ if self.is_free(key))
        return found if len(found) <= most else None

    def is_free(self, key: int) -> bool:
        """Return whether a frontier is open and may be chosen."""
        return key in self._frontiers.open and key not in self._taken and key not in self._avoided

    def utility(self, key: int) -> float:
        """Return U(<a, b>) of a frontier that is free."""
        known = self._utility.get(key)
        if known is None:
            a, b = pair_of(key)
            robots = self._sent.get(a, 0) + self._sent.get(b, 0)
            if robots and (b << 16 | a) in self._taken:
                robots -= 1  # that one is sent to both
            known = self._utility[key] = self._frontiers.sharing(key) / (1 + robots)
        return known

    def best_in(
        self, simplex: Sequence[int], vertex: int, price: float, useful: bool, best: tuple[float, int, int] | None
    ) -> tuple[float, int, int] | None:
        """Return the better of `best` and the best free frontier among the landmarks of an observation.

        Each is (gain, -key, vertex). The gain is the utility, if it is to be `useful`, less `price`.
        """
        open_of = self._frontiers.open_of
        live = [landmark for landmark in simplex if open_of.get(landmark)]
        if len(live) < 2:
            return best
        if best is not None and useful:
            counts = sorted([len(open_of[landmark]) for landmark in live])
            if counts[-1] + counts[-2] - price < best[0]:
                return best
        open_ = self._frontiers.open
        for i, a in enumerate(live):
            for b in live[i + 1 :]:
                for key in (a << 16 | b, b << 16 | a):
                    if key in open_ and self.is_free(key):
                        candidate = (self.utility(key) - price if useful else -price), -key, vertex
                        if best is None or candidate[:2] > best[:2]:
                            best = candidate
        return best


class Policy(Protocol):
    """Chooses a frontier of an offer for a robot that sees `landmarks`."""

    def __call__(self, complex_: LandmarkComplex, landmarks: Sequence[int], offer: Offer) -> Choice | None:
        """Return the choice, or None where no free frontier can be reached."""


def cost_utility(beta: float) -> Policy:
    """Return the policy of the paper: the greatest utility less `beta` times the cost."""

    def choose(complex_: LandmarkComplex, landmarks: Sequence[int], offer: Offer) -> Choice | None:
        return _best(complex_, landmarks, offer, beta, offer.most())

    return choose


def nearest_frontier(complex_: LandmarkComplex, landmarks: Sequence[int], offer: Offer) -> Choice | None:
    """Return the frontier that costs least to reach (Yamauchi 1998: robots share the map, and do not coordinate)."""
    return _best(complex_, landmarks, offer, 1.0, None)


class Costs(NamedTuple):
    """The cost of each open frontier, its vertex, and the predecessor of each vertex on the path."""

    cost: dict[int, float]
    vertex: dict[int, int]
    before: dict[int, int]

    def path(self, key: int) -> tuple[int, ...]:
        """Return the vertices of the path to a frontier."""
        vertex = self.vertex[key]
        return () if vertex == HERE else path_to(vertex, self.before)


def frontier_costs(complex_: LandmarkComplex, landmarks: Sequence[int], frontiers: Frontiers) -> Costs:
    """Return the cost of every open frontier that can be reached from where `landmarks` are seen."""
    found = Costs({}, {}, {})
    _note_costs(sorted(landmarks), HERE, 0.0, frontiers, found)
    for cost, vertex, before in reach(complex_, landmarks):
        found.before[vertex] = before
        _note_costs(complex_.simplices[vertex], vertex, cost, frontiers, found)
        if len(found.cost) == len(frontiers.open):
            break
    return found


def _note_costs(simplex: Sequence[int], vertex: int, cost: float, frontiers: Frontiers, found: Costs) -> None:
    live = [landmark for landmark in simplex if frontiers.open_of.get(landmark)]
    for i, a in enumerate(live):
        for b in live[i + 1 :]:
            for key in (a << 16 | b, b << 16 | a):
                if key in frontiers.open and key not in found.cost:
                    found.cost[key], found.vertex[key] = cost, vertex


def min_pos(mine: Costs, others: Sequence[Costs]) -> Choice | None:
    """Return the frontier towards which fewest robots are better placed; of equals the nearest (Bautin et al. 2012).

    The rank of a robot towards a frontier is the number of robots to which it costs less to get there.
    """
    best: tuple[int, float, int] | None = None
    for key, cost in mine.cost.items():
        rank = sum(other.cost.get(key, math.inf) < cost for other in others)
        if best is None or (rank, cost, key) < best:
            best = rank, cost, key
    return None if best is None else Choice(best[2], mine.path(best[2]), -float(best[0]))


def _best(
    complex_: LandmarkComplex, landmarks: Sequence[int], offer: Offer, slope: float, most: float | None
) -> Choice | None:
    """Return the free frontier with the greatest gain; of equals the smallest key.

    The gain is the utility, at most `most`, less `slope` times the cost; without `most` it is the cost alone.
    """
    if offer.is_empty():
        return None
    best: tuple[float, int, int] | None = None  # gain, -key, vertex
    best = offer.best_in(sorted(landmarks), HERE, 0.0, most is not None, best)
    before: dict[int, int] = {}
    simplices, bound, limit = complex_.simplices, most or 0.0, CostLimit()
    for cost, vertex, previous in reach(complex_, landmarks, limit):
        if best is not None and bound - slope * cost < best[0]:
            break
        if best is not None and slope > 0.0:
            limit.cost = (bound - best[0]) / slope + _ROUNDING
        before[vertex] = previous
        best = offer.best_in(simplices[vertex], vertex, slope * cost, most is not None, best)
    if best is None:
        return None
    value, negative_key, vertex = best
    return Choice(-negative_key, () if vertex == HERE else path_to(vertex, before), value)
