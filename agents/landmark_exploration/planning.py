"""The next frontier for a robot, and the way there: cost-utility over the navigation graph.

Section IV-C of Ramaithitima and Bhattacharya 2018: CU(S, <a, b>) = U(<a, b>) - beta C(S, <a, b>). The cost C is that of the
cheapest path from the present observation S to an observation with a and b; the utility U is the number of open frontiers
that share a landmark with <a, b>, divided by one more than the number of robots sent to a or b. The search ends as soon as
no frontier farther away can be better.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from typing import NamedTuple, Protocol

from zwerm.agents.landmark_exploration.frontier import Frontiers, pair_of
from zwerm.agents.landmark_exploration.landmark_complex import LandmarkComplex

# The vertex before the first of a path: the robot itself.
HERE = -1


class Reached(NamedTuple):
    """A vertex of the navigation graph and what it costs to get there. `before` HERE: from the present observation."""

    cost: float
    vertex: int
    before: int


class Choice(NamedTuple):
    """A frontier (its key), the vertices to pass on the way to it, in order, and what the robot gains."""

    key: int
    path: tuple[int, ...]
    gain: float


def reach(complex_: LandmarkComplex, landmarks: Sequence[int]) -> Iterator[Reached]:
    """Yield the vertices that can be navigated to from where `landmarks` are seen, the cheapest first (Dijkstra 1959)."""
    queue = [(1.0 / (shared - 1), vertex, HERE) for vertex, shared in complex_.adjacent(landmarks).items()]
    queue.sort()
    best = {vertex: cost for cost, vertex, _ in queue}
    done: set[int] = set()
    neighbours = complex_.neighbours
    while queue:
        cost, vertex, before = heappop(queue)
        if vertex in done:
            continue
        done.add(vertex)
        yield Reached(cost, vertex, before)
        for other, shared in neighbours[vertex].items():
            farther = cost + 1.0 / (shared - 1)
            if farther < best.get(other, 1e300):
                best[other] = farther
                heappush(queue, (farther, other, vertex))


def path_to(vertex: int, before: Mapping[int, int]) -> tuple[int, ...]:
    """Return the vertices from the present observation to `vertex`, given the vertex before each."""
    path = [vertex]
    while before[path[-1]] != HERE:
        path.append(before[path[-1]])
    return tuple(reversed(path))


def utilities(frontiers: Frontiers, taken: Collection[int], sent: Mapping[int, int]) -> dict[int, float]:
    """Return the utility of every open frontier that is not `taken`.

    `sent` maps a landmark to how many robots are sent to a frontier with it; both landmarks of one robot's count once.
    """
    # The robots sent to a or b: at most those of a and of b; those sent to both are in `taken` by the pair itself.
    found: dict[int, float] = {}
    for key in frontiers.open:
        if key in taken:
            continue
        a, b = pair_of(key)
        robots = sent.get(a, 0) + sent.get(b, 0)
        if robots and (b << 16 | a) in taken:
            robots -= 1
        found[key] = frontiers.sharing(key) / (1 + robots)
    return found


class Policy(Protocol):
    """Chooses a frontier for a robot that sees `landmarks`, given the utility of each one that is free."""

    def __call__(
        self, complex_: LandmarkComplex, landmarks: Sequence[int], utility: Mapping[int, float]
    ) -> Choice | None:
        """Return the choice, or None where no free frontier can be reached."""


def cost_utility(beta: float) -> Policy:
    """Return the policy of the paper: the greatest utility less `beta` times the cost."""

    def choose(complex_: LandmarkComplex, landmarks: Sequence[int], utility: Mapping[int, float]) -> Choice | None:
        return _best(complex_, landmarks, utility, lambda key, cost: utility[key] - beta * cost, beta)

    return choose


def nearest_frontier(
    complex_: LandmarkComplex, landmarks: Sequence[int], utility: Mapping[int, float]
) -> Choice | None:
    """Return the frontier that costs least to reach (Yamauchi 1997, greedily shared out among robots)."""
    return _best(complex_, landmarks, utility, lambda key, cost: -cost, 1.0, bound=0.0)


def _best(
    complex_: LandmarkComplex,
    landmarks: Sequence[int],
    utility: Mapping[int, float],
    gain: Callable[[int, float], float],
    slope: float,
    bound: float | None = None,
) -> Choice | None:
    """Return the frontier with the greatest gain, of equals the smallest key of those that were reached first.

    At a cost c no gain exceeds `bound` (the greatest utility, unless given) - `slope` c.
    """
    if not utility:
        return None
    most = max(utility.values()) if bound is None else bound
    best: tuple[float, int, int] | None = None  # gain, -key, vertex
    here = sorted(landmarks)
    best = _candidates(here, HERE, 0.0, utility, gain, best)
    before: dict[int, int] = {}
    for cost, vertex, previous in reach(complex_, landmarks):
        if best is not None and most - slope * cost <= best[0]:
            break
        before[vertex] = previous
        best = _candidates(complex_.simplices[vertex], vertex, cost, utility, gain, best)
    if best is None:
        return None
    value, negative_key, vertex = best
    return Choice(-negative_key, () if vertex == HERE else path_to(vertex, before), value)


def _candidates(
    simplex: Sequence[int],
    vertex: int,
    cost: float,
    utility: Mapping[int, float],
    gain: Callable[[int, float], float],
    best: tuple[float, int, int] | None,
) -> tuple[float, int, int] | None:
    for i, a in enumerate(simplex):
        for b in simplex[i + 1 :]:
            for key in (a << 16 | b, b << 16 | a):
                if key in utility:
                    candidate = gain(key, cost), -key, vertex
                    if best is None or candidate[:2] > best[:2]:
                        best = candidate
    return best
