"""Cost-utility where few frontiers are free: a search for the best one that is guided towards them.

The choice is the same as that of `cost_utility`, down to the path. That search visits all vertices within the cost of
the best frontier. With few free frontiers these are most of a building. Here a vertex is visited only if a frontier
behind it can still be the best one (A*, Hart, Nilsson and Raphael 1968). The bound on the cost between two vertices is the
difference of their costs from a pivot (Goldberg and Harrelson 2005, "Computing the Shortest Path: A* Search Meets Graph
Theory"). No cost ever rises while a map grows: an observation is only replaced by one with more landmarks. So the costs from
pivots are kept up to date vertex by vertex.
"""

import math
from collections import deque
from collections.abc import Sequence
from heapq import heappop, heappush
from typing import Any, Final

import numpy as np

from zwerm.agents.landmark_exploration.mapping.cost_utility import HERE, Choice, Offer, path_to, reach
from zwerm.agents.landmark_exploration.mapping.frontier_status import pair_of
from zwerm.agents.landmark_exploration.mapping.landmark_complex import SHARED_MIN, LandmarkComplex

Floats = np.ndarray[Any, np.dtype[np.float64]]

# Pivots of a map. More make bounds tighter, and cost more.
PIVOTS: Final = 8
# Pivots are chosen anew when the map has grown by this factor.
GROWTH: Final = 1.5
# Margin of bounds, for rounding.
_ROUNDING: Final = 1e-6
# Improvements of a cost below this are rounding.
_LEAST_GAIN: Final = 1e-12


class PivotCosts:
    """The cost of the cheapest path from each pivot to each vertex: (PIVOTS, vertices), infinite where there is none.

    A pivot is an observation, one of `pivots`. A path leads from it through the navigation graph.
    """

    def __init__(self, complex_: LandmarkComplex) -> None:
        self._complex = complex_
        self.pivots: list[tuple[int, ...]] = []
        self._known = 0  # vertices below this number are in `costs`
        self._rebuild_at = 0
        self.costs: Floats = np.empty((PIVOTS, 0))

    def update(self) -> None:
        """Add the vertices that are new in the complex."""
        last = self._complex.vertices
        if last == self._known:
            return
        if last >= self._rebuild_at:
            self._rebuild()
        else:
            self._add([vertex for vertex in range(self._known, last) if vertex in self._complex.simplices])
        self._known = last

    def _rebuild(self) -> None:
        """Choose pivots that are far from each other, and search from each."""
        last = self._complex.vertices
        capacity = self._rebuild_at = math.ceil(GROWTH * last)
        self.costs = np.full((PIVOTS, capacity), np.inf)
        free = np.array(sorted(self._complex.simplices))
        pivot = self._complex.landmarks_of(int(free[0]))
        farthest = self._searched(pivot, capacity)[free]
        self.pivots = []
        for number in range(PIVOTS):
            pivot = self._complex.landmarks_of(int(free[np.argmax(farthest)]))
            self.pivots.append(pivot)
            self.costs[number] = self._searched(pivot, capacity)
            farthest = self.costs[: number + 1, free].min(axis=0)

    def _searched(self, pivot: tuple[int, ...], capacity: int) -> Floats:
        costs = np.full(capacity, np.inf)
        for cost, vertex, _ in reach(self._complex, pivot):
            costs[vertex] = cost
        return costs

    def _add(self, fresh: Sequence[int]) -> None:
        """Add vertices, and lower the costs to others where a path through these is cheaper."""
        for vertex in fresh:
            simplex = set(self._complex.simplices[vertex])
            for number, pivot in enumerate(self.pivots):
                shared = len(simplex.intersection(pivot))
                if shared >= SHARED_MIN:
                    self.costs[number, vertex] = 1.0 / (shared - 1)
            around, weights = self._around(vertex)
            if len(around):
                through = (self.costs[:, around] + weights).min(axis=1)
                self.costs[:, vertex] = np.minimum(self.costs[:, vertex], through)
        queue = deque(fresh)
        while queue:
            vertex = queue.popleft()
            around, weights = self._around(vertex)
            if not len(around):
                continue
            through, known = self.costs[:, vertex, None] + weights, self.costs[:, around]
            cheaper = through < known - _LEAST_GAIN
            if cheaper.any():
                self.costs[:, around] = np.where(cheaper, through, known)
                queue.extend(around[cheaper.any(axis=0)].tolist())

    def _around(self, vertex: int) -> tuple[np.ndarray[Any, np.dtype[np.int64]], Floats]:
        """Return the vertices next to a vertex, and the costs of the edges to them."""
        neighbours = self._complex.neighbours[vertex]
        shared = np.fromiter(neighbours.values(), np.float64, len(neighbours))
        return np.fromiter(neighbours, np.int64, len(neighbours)), 1.0 / (shared - 1.0)

    def at_least(self, vertices: Sequence[int]) -> Floats:
        """Return (vertices,) a lower bound of the cost from each vertex to the nearest of these; infinite if no path exists."""
        if not vertices:
            return np.full(self.costs.shape[1], np.inf)
        there = self.costs[:, vertices]
        low, high = there.min(axis=1)[:, None], there.max(axis=1)[:, None]
        with np.errstate(invalid="ignore"):  # infinite less infinite: this pivot tells nothing
            apart = np.fmax(low - self.costs, self.costs - high)
        least: Floats = np.fmax.reduce(apart, axis=0, initial=0.0)
        return least


class GuidedSearch:
    """The search of one assignment: for the frontiers of an offer that are free, and for all robots."""

    def __init__(
        self, complex_: LandmarkComplex, costs: PivotCosts, offer: Offer, keys: Sequence[int], beta: float
    ) -> None:
        costs.update()
        self._complex, self._costs, self._offer, self._beta = complex_, costs, offer, beta
        self._keys = list(keys)
        self._keys_of: dict[int, list[int]] = {}  # vertex: the frontiers that it contains
        vertices = [sorted(complex_.containing(*pair_of(key))) for key in keys]
        for key, some in zip(keys, vertices, strict=True):
            for vertex in some:
                self._keys_of.setdefault(vertex, []).append(key)
        self._loss = beta * np.array([costs.at_least(some) for some in vertices])
        self._gains: list[float] | None = None

    def take(self, key: int) -> None:
        """Record that a frontier is no longer free."""
        self._loss = np.delete(self._loss, self._keys.index(key), axis=0)
        self._keys.remove(key)
        self._gains = None

    def _gains_at_most(self) -> list[float]:
        """Return an upper bound of the gain of a robot at each vertex."""
        if self._gains is None:
            utility = np.array([self._offer.utility(key) for key in self._keys])
            self._gains = (utility[:, None] - self._loss).max(axis=0, initial=-np.inf).tolist()
        return self._gains

    def bound(self, landmarks: Sequence[int]) -> float | None:
        """Return an upper bound of the gain of a robot that sees `landmarks`; None if that needs a search."""
        here = [self._offer.utility(key) for key in self._keys if set(pair_of(key)) <= set(landmarks)]
        gains, adjacent = self._gains_at_most(), self._complex.adjacent(landmarks)
        if not np.isfinite(self._costs.costs[:, list(adjacent)]).any():
            return None
        there = [gains[vertex] - self._beta / (shared - 1) for vertex, shared in adjacent.items()]
        return max([*here, *there], default=-math.inf) + _ROUNDING

    def best(self, landmarks: Sequence[int]) -> Choice | None:
        """Return the free frontier with the greatest gain; of equals the smallest key."""
        beta, gains, utility, keys_of = self._beta, self._gains_at_most(), self._offer.utility, self._keys_of
        neighbours, is_free = self._complex.neighbours, self._offer.is_free
        # Gain, -key, -cost, -vertex.
        best = (-math.inf, 0, 0.0, 0)
        for key in self._keys:
            if set(pair_of(key)) <= set(landmarks):
                best = max(best, (utility(key) - 0.0, -key, 0.0, -HERE))
        cost = {vertex: 1.0 / (shared - 1) for vertex, shared in self._complex.adjacent(landmarks).items()}
        before = dict.fromkeys(cost, HERE)
        queue: list[tuple[float, float, int]] = []
        for vertex, here in cost.items():
            heappush(queue, (beta * here - gains[vertex], here, vertex))
        while queue:
            least, here, vertex = heappop(queue)
            if -least < best[0] - _ROUNDING or least == math.inf:
                break
            if here > cost[vertex]:
                continue
            for key in keys_of.get(vertex, ()):
                if is_free(key):
                    best = max(best, (utility(key) - beta * here, -key, -here, -vertex))
            for other, shared in neighbours[vertex].items():
                farther, known = here + 1.0 / (shared - 1), cost.get(other, math.inf)
                if farther < known:
                    if beta * farther - gains[other] <= _ROUNDING - best[0]:
                        cost[other], before[other] = farther, vertex
                        heappush(queue, (beta * farther - gains[other], farther, other))
                elif (
                    farther == known and before[other] != HERE and (here, vertex) < (cost[before[other]], before[other])
                ):
                    before[other] = (
                        vertex  # of equal paths that over the nearest vertex, as in a search without a guide
                    )
        if best[0] == -math.inf:
            return None
        gain, negative_key, _, negative_vertex = best
        vertex = -negative_vertex
        return Choice(-negative_key, () if vertex == HERE else path_to(vertex, before), gain)
