"""The assignment of free frontiers to free robots: lines 4 to 7 of algorithm 1 of Ramaithitima and Bhattacharya 2018."""

from collections.abc import Iterator, Mapping, Sequence
from heapq import heappop, heappush
from typing import Final

from zwerm.agents.landmark_exploration.mapping.cost_utility import Choice, Offer, cost_utility
from zwerm.agents.landmark_exploration.mapping.frontier_status import pair_of
from zwerm.agents.landmark_exploration.mapping.guided_search import GuidedSearch, PivotCosts
from zwerm.agents.landmark_exploration.mapping.landmark_complex import LandmarkComplex

# Up to this many free frontiers the search for one is guided. With more, the nearest one is near.
GUIDED_MAX: Final = 48

# A free robot: the negative of its gain or of a bound of that, its id, the number of frontiers assigned when that was
# worked out, and its choice; None where its gain is only bounded.
Candidate = tuple[float, int, int, Choice | None]


class GreedyAssignment:
    """Assigns the best pair of a free robot and a frontier, then the best pair of the rest, and so on."""

    def __init__(self, complex_: LandmarkComplex, beta: float) -> None:
        self._complex, self._beta = complex_, beta
        self._policy = cost_utility(beta)
        self._pivot_costs = PivotCosts(complex_)

    def assigned(self, landmarks: Mapping[int, Sequence[int]], offer: Offer) -> Iterator[tuple[int, Choice | None]]:
        """Yield each robot with its frontier, or with None if it can reach no free one. `landmarks` are what each robot sees.

        A robot's best gain never rises while frontiers are assigned. So only the robot with the best gain is examined
        again, and one whose gain is only bounded is examined when no other can be better.
        """
        if not landmarks:
            return
        keys = offer.free_keys(GUIDED_MAX) if self._beta > 0.0 else None
        guide = GuidedSearch(self._complex, self._pivot_costs, offer, keys, self._beta) if keys else None
        given = 0
        given_at: dict[int, int] = {}  # landmark: the number of the last frontier with it that was assigned
        queue: list[Candidate] = []

        def chosen(node: int) -> Choice | None:
            """Return the best frontier of a robot, and queue it."""
            choice = (
                guide.best(landmarks[node])
                if guide is not None
                else self._policy(self._complex, landmarks[node], offer)
            )
            if choice is not None:
                heappush(queue, (-choice.gain, node, given, choice))
            return choice

        for node, seen in landmarks.items():
            bound = None if guide is None else guide.bound(seen)
            if bound is not None:
                heappush(queue, (-bound, node, given, None))
            elif chosen(node) is None:
                yield node, None
        while queue:
            _, node, at, choice = heappop(queue)
            # Frontiers without a landmark of this one change nothing: all others are worth the same as before, or less.
            if choice is None or any(given_at.get(landmark, 0) > at for landmark in pair_of(choice.key)):
                if chosen(node) is None:
                    yield node, None
                continue
            given += 1
            given_at.update(dict.fromkeys(pair_of(choice.key), given))
            offer.take(choice.key)
            if guide is not None:
                guide.take(choice.key)
            yield node, choice
