"""The way to the nearest frontier robot, hop by hop, from what neighbours say of their own way.

A path vector: who says how far it is says by which places, so nobody's way leads through its own place, and when the
frontier is cut off nobody counts further than there are places. A way belongs to a place: while places change hands, what
was said of them holds until who stands there says something else.

Promised is that ways become the shortest once every neighbour's last word has come, in whatever order, however often; who
tells its way now and then gets it through at any loss below 1.
"""

from collections.abc import Mapping

from zwerm.agents.sensor_coverage.words import NOWHERE, Route, Way

# The base is where ways begin: none leads through it.
BASE = 0


class Gradient:
    """One robot's way, `route`, and its neighbours'. `version` counts what they said that was new."""

    def __init__(self) -> None:
        self.route: Route | None = None
        self.version = 0
        self._numbers: dict[int, int] = {}  # robot: the newest of its words
        self._ways: dict[int, Route | None] = {}  # place: the way that begins there

    def hear(self, sender: int, way: Way) -> None:
        """Take in what a neighbour says; an old word, or a repeated one, says nothing."""
        if way.number <= self._numbers.get(sender, -1):
            return
        self._numbers[sender] = way.number
        if way.place != NOWHERE and self._ways.get(way.place) != way.route:
            self._ways[way.place] = way.route
            self.version += 1

    def take_over(self, place: int, otherwise: Route | None) -> None:
        """Go on with the way that was told of a place, `otherwise` if none was."""
        self.route = self._ways.get(place) or otherwise

    def choose(self, place: int, cost: float | None, weights: Mapping[int, float]) -> None:
        """Find the shortest way from `place`, by neighbouring places with the weights of the edges there.

        `cost` is that of going nowhere, at the frontier itself. Of equal ways that to the smallest place is taken.
        """
        best: tuple[float, tuple[int, ...]] | None = None if cost is None else (cost, (place,))
        for beside, weight in weights.items():
            way = self._ways.get(beside)
            if way is None or place in way.places or beside == BASE:
                continue
            found = way.cost + weight, (place, *way.places)
            if best is None or (found[0], found[1][-1], found[1]) < (best[0], best[1][-1], best[1]):
                best = found
        self.route = None if best is None else Route(*best)
