"""The route to the nearest frontier robot, hop by hop, from neighbours' routes.

A path vector protocol: a robot that announces a route names all its slots. So no robot takes a route through its own
slot, and when the frontier is cut off, costs stay bounded by the number of slots. A route belongs to a slot: while
slots change hands, the announced route holds until the new occupant announces another.

A robot that is no longer at the frontier announces that, and all routes that end there end with it. Otherwise robots
would try all longer routes there, one after the other. The claims of a slot to be at the frontier are numbered, and the
numbers pass from occupant to occupant with the slot. So claims are ordered without a clock. An occupant may receive a
claim of its slot that is newer than its own. Then it continues after that number. Neighbours end the claims of a slot
if its occupant is dead, or has lost its memory.

Routes become the shortest once every neighbour's latest message has arrived, in any order and any number of copies. A
robot that repeats its route gets it through at any loss below 1.
"""

from collections.abc import Mapping
from typing import Final

from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE, PathVector, Route

# Slot of the base, where pushes begin: no route leads through it.
BASE: Final = 0
# A robot at the frontier renews its claim after this many ticks of its own: others may have missed that it began.
RENEW_TICKS: Final = 600
# Bound of the ended slots that one message names.
ENDED_MAX: Final = 6


class PathVectorProtocol:
    """One robot's `route`, and those of its neighbours. `version` counts what was new in their messages.

    `homes` has the number of hops to the base, and the base's count that came that way, by slot.
    """

    def __init__(self) -> None:
        self.route: Route | None = None
        self.version = 0
        self.homes: dict[int, tuple[int, int]] = {}
        self._numbers: dict[int, int] = {}  # robot: number of its newest message
        self._routes: dict[int, Route | None] = {}  # slot: the route that begins there
        self._claims: dict[int, int] = {}  # slot: the newest claim that was received
        self._ended: dict[int, int] = {}  # slot: the newest claim that has ended, the latest news last
        self._claimed_at = 0  # tick of this robot's newest claim

    def receive(self, sender: int, message: PathVector) -> bool:
        """Take in a neighbour's route; return False for an old or repeated message, which changes nothing."""
        if message.number <= self._numbers.get(sender, -1):
            return False
        self._numbers[sender] = message.number
        for slot, claim in message.ended:
            self._end(slot, claim)
        self.homes[message.slot] = message.home, message.base_count
        if message.route is not None:
            self._hear(message.route)
        if message.slot != NOWHERE and self._routes.get(message.slot) != message.route:
            self._routes[message.slot] = message.route
            self.version += 1
        return True

    def forget(self, sender: int, slot: int) -> None:
        """Forget a neighbour that is dead or lost its memory, and end the claims of its slot."""
        self._numbers.pop(sender, None)
        if slot != NOWHERE:
            self._routes.pop(slot, None)
            self._end(slot, self.newest_claim(slot))
            self.version += 1

    def is_claimed(self, slot: int) -> bool:
        """Return whether a slot is at the frontier, or in doubt, by the latest news of it."""
        return self._own(slot) is not None

    def newest_claim(self, slot: int) -> int:
        """Return the number of the newest received claim of a slot."""
        return self._claims.get(slot, 0)

    def take_over(self, slot: int, default: Route | None, claims: int = 0) -> None:
        """Continue the route that was announced of a slot, or `default` if none was; it has made `claims` so far."""
        self._claims[slot] = max(claims, self.newest_claim(slot))
        self.route = self._routes[slot] = self._routes.get(slot) or default

    def claim(self, slot: int, cost: float | None, tick: int) -> None:
        """Claim that `slot` is at the frontier, at this cost; None ends the claim."""
        own, newest = self._own(slot), self.newest_claim(slot)
        if own is not None and own.cost == cost and own.claim == newest and tick - self._claimed_at <= RENEW_TICKS:
            self.route = own
            return
        if (own is None and newest > self._ended.get(slot, 0)) or (own is not None and own.cost != cost):
            self._end(slot, newest)
        self.route = self._routes[slot] = None if cost is None else Route(cost, (slot,), newest + 1)
        if cost is not None:
            self._claims[slot], self._claimed_at = newest + 1, tick

    @property
    def ended(self) -> tuple[tuple[int, int], ...]:
        """Slots with their newest claims that have ended, to announce to neighbours."""
        return tuple(self._ended.items())[-ENDED_MAX:]

    def choose(self, slot: int, cost: float | None, weights: Mapping[int, float], tick: int) -> None:
        """Find the shortest route from `slot`, by the weights of the edges to neighbouring slots.

        `cost` is the cost of the claim at this slot itself, or None. Of equal routes the one to the smallest slot is
        taken.
        """
        self.claim(slot, cost, tick)
        best: Route | None = None
        least = None if self.route is None else _key(self.route)
        for beside, weight in weights.items():
            route = self._routes.get(beside)
            if route is None or slot in route.slots or beside == BASE or not self._lasts(route):
                continue
            key = route.cost + weight, route.slots[-1], (slot, *route.slots)
            if least is None or key < least:
                best, least = route, key
        if best is not None and least is not None:
            self.route = Route(least[0], least[2], best.claim)

    def _own(self, slot: int) -> Route | None:
        """Return the claim at this slot, if there is one."""
        route = self._routes.get(slot)
        return route if route is not None and len(route.slots) == 1 and self._lasts(route) else None

    def _lasts(self, route: Route) -> bool:
        return route.claim > self._ended.get(route.slots[-1], -1)

    def _hear(self, route: Route) -> None:
        """Take in the number of a claim."""
        slot = route.slots[-1]
        self._claims[slot] = max(route.claim, self.newest_claim(slot))

    def _end(self, slot: int, claim: int) -> None:
        """Record that a claim of a slot, and all before it, have ended."""
        newest = self._claims.get(slot)
        if newest is None or claim > newest:
            self._claims[slot] = max(claim, 0)
        if claim > self._ended.get(slot, -1):
            self._ended.pop(slot, None)
            self._ended[slot] = claim
            self.version += 1


def _key(route: Route) -> tuple[float, int, tuple[int, ...]]:
    return route.cost, route.slots[-1], route.slots
