"""Paths to push along: Dijkstra's algorithm on the 1-skeleton, from several sources at once.

Edges beside obstacles cost more, because driving there is harder (Ramaithitima et al. 2015, section III-B). Equal costs
are decided by the slots' numbers, so a path is a function of the graph.
"""

import heapq
from collections.abc import Collection, Mapping
from typing import NamedTuple

from zwerm.maths.simplicial import Edge, FlagComplex, edge


class CheapestRoutes(NamedTuple):
    """The cost of the cheapest route to every reachable vertex, and the vertex before it (None at a source)."""

    cost: dict[int, float]
    before: dict[int, int | None]

    def path(self, vertex: int) -> tuple[int, ...]:
        """Return the vertices from a source to `vertex`, both included."""
        found = [vertex]
        while (previous := self.before[found[-1]]) is not None:
            found.append(previous)
        return tuple(reversed(found))


def cheapest_routes(
    complex_: FlagComplex,
    sources: Mapping[int, float],
    obstacle: Collection[Edge],
    obstacle_cost: float,
    shut: Collection[int] = (),
) -> CheapestRoutes:
    """Return the cheapest routes from `sources` (vertex: cost to start there).

    An edge costs 1, and an edge of `obstacle` costs `obstacle_cost`. A route may begin at a vertex in `shut` but does
    not lead through one.
    """
    cost: dict[int, float] = {}
    before: dict[int, int | None] = {}
    heap: list[tuple[float, int, int]] = [(start, vertex, -1) for vertex, start in sorted(sources.items())]
    heapq.heapify(heap)
    while heap:
        spent, vertex, previous = heapq.heappop(heap)
        if vertex in cost or vertex not in complex_.neighbours:
            continue
        cost[vertex], before[vertex] = spent, previous if previous >= 0 else None
        for each in complex_.neighbours[vertex]:
            if each not in cost and each not in shut:
                step = obstacle_cost if edge(vertex, each) in obstacle else 1.0
                heapq.heappush(heap, (spent + step, each, vertex))
    return CheapestRoutes(cost, before)


class Dijkstra:
    """The path service of a node that knows the whole graph."""

    def __init__(self, obstacle_cost: float) -> None:
        self._obstacle_cost = obstacle_cost

    def routes(
        self,
        complex_: FlagComplex,
        sources: Mapping[int, float],
        obstacle: Collection[Edge],
        shut: Collection[int] = (),
    ) -> CheapestRoutes:
        """Return the cheapest routes from `sources` (slot: cost to start there); none leads through a slot in `shut`."""
        return cheapest_routes(complex_, sources, obstacle, self._obstacle_cost, shut)
