"""The way to the nearest frontier robot, hop by hop, from what neighbours say of their own way.

A path vector: who says how far it is says by which places, so nobody's way leads through its own place, and when the
frontier is cut off nobody counts further than there are places. A way belongs to a place: while places change hands, what
was said of them holds until who stands there says something else.

Who is not at the frontier any more says so, and all ways that end there end with that word: else robots would try all longer
ways there, one after the other, before they knew.

Promised is that ways become the shortest once every neighbour's last word has come,
in whatever order, however often; who tells its way now and then gets it through at any loss below 1.
"""

from collections.abc import Mapping
from typing import Final

from zwerm.agents.sensor_coverage.messages.peers import NOWHERE, PathVector, Route

# The base is where ways begin: none leads through it.
BASE: Final = 0
# Who is at the frontier for long says so anew: who took the place over may not have heard that its way had ended.
RENEW_TICKS: Final = 600
# So many places that are not at the frontier any more are told of at a time.
ENDED_MAX: Final = 6


class PathVectorProtocol:
    """One robot's way, `route`, and its neighbours'. `version` counts what they said that was new."""

    def __init__(self) -> None:
        self.route: Route | None = None
        self.version = 0
        self.homes: dict[int, int] = {}  # place: how many hops it is to the base
        self._numbers: dict[int, int] = {}  # robot: the newest of its words
        self._ways: dict[int, Route | None] = {}  # place: the way that begins there
        self._ended: dict[int, int] = {}  # place: until when it was at the frontier, the newest last

    def hear(self, sender: int, way: PathVector) -> None:
        """Take in what a neighbour says; an old word, or a repeated one, says nothing."""
        if way.number <= self._numbers.get(sender, -1):
            return
        self._numbers[sender] = way.number
        for place, tick in way.ended:
            self._end(place, tick)
        self.homes[way.place] = way.home
        if way.place != NOWHERE and self._ways.get(way.place) != way.route:
            self._ways[way.place] = way.route
            self.version += 1

    def take_over(self, place: int, otherwise: Route | None) -> None:
        """Go on with the way that was told of a place, `otherwise` if none was."""
        self.route = self._ways[place] = self._ways.get(place) or otherwise

    def claim(self, place: int, cost: float | None, tick: int) -> None:
        """Have a way that ends at `place`, where it begins; or with None, none such any more."""
        own = self._own(place)
        if own is None or own.cost != cost:
            if own is not None:
                self._end(place, tick - 1)
            own = None if cost is None else Route(cost, (place,), tick)
        elif tick - own.since > RENEW_TICKS:
            own = Route(own.cost, (place,), tick)
        self.route = self._ways[place] = own

    @property
    def ended(self) -> tuple[tuple[int, int], ...]:
        """Places that are not at the frontier any more, to be told to others."""
        return tuple(self._ended.items())[-ENDED_MAX:]

    def choose(self, place: int, cost: float | None, weights: Mapping[int, float], tick: int) -> None:
        """Find the shortest way from `place`, by neighbouring places with the weights of the edges there.

        `cost` is that of going nowhere, at the frontier itself. Of equal ways that to the smallest place is taken.
        """
        self.claim(place, cost, tick)
        best = self.route
        for beside, weight in weights.items():
            way = self._ways.get(beside)
            if way is None or place in way.places or beside == BASE or not self._lasts(way):
                continue
            found = Route(way.cost + weight, (place, *way.places), way.since)
            if best is None or _key(found) < _key(best):
                best = found
        self.route = best

    def _own(self, place: int) -> Route | None:
        """Return the way that ends where it begins, if there is one at this place."""
        way = self._ways.get(place)
        return way if way is not None and len(way.places) == 1 and self._lasts(way) else None

    def _lasts(self, way: Route) -> bool:
        return way.since > self._ended.get(way.places[-1], -1)

    def _end(self, place: int, tick: int) -> None:
        if tick > self._ended.get(place, -1):
            self._ended.pop(place, None)
            self._ended[place] = tick
            self.version += 1


def _key(way: Route) -> tuple[float, int, tuple[int, ...]]:
    return way.cost, way.places[-1], way.places
