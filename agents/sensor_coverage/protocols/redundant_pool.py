"""Robots that have left the complex, and how the base calls them: before it lets another one out, it pushes from there.

    offer   spare robot to base, hop by hop, each to the neighbour that is nearest to the base
    call    base to spare robot: by the places that the offer came through, whoever holds them now
    end     rear of the push to base: what came of it

Each hop is a letter, acknowledged and sent again; who passes one on keeps nothing. The base has one push at a time, its own or
one that it called for, and gives the new place its id: no place has two names, and no name two places. An offer or a call
that is lost costs time. A base that never hears of an end goes on after a while.
"""

from typing import Final, Protocol

from zwerm.agents.sensor_coverage.messages.peers import (
    FAR,
    Errand,
    PushAborted,
    PushDone,
    RedundantCall,
    RedundantOffer,
    RedundantPushEnd,
)
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.push_host import PushHost
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush

# When to offer, and again, at first and at most [ticks].
SOON_TICKS: Final = 10
OFFER_TICKS: Final = 200
OFFER_TICKS_MAX: Final = 3200
# Ways longer than this are none.
HOPS_MAX: Final = 64


class PoolHost(PushHost, Protocol):
    """The robot that offers itself, or passes on."""

    @property
    def ready(self) -> bool:
        """Whether it can take part in a push."""

    def begin(self, push: int) -> None:
        """Be the rear of a push."""


class RedundantPool:
    """One robot's part in offers, calls and ends."""

    def __init__(self, robot: PoolHost) -> None:
        self._robot = robot
        self._pending: list[Errand] = []
        self._offer_at: int | None = None
        self._wait_ticks = OFFER_TICKS
        self._called: int | None = None

    def read(self, errand: Errand) -> None:
        """Take in a letter, and pass it on."""
        match errand:
            case RedundantOffer():
                place = self._robot.vicinity.place
                if place not in errand.places and len(errand.places) < HOPS_MAX:
                    self._pending.append(RedundantOffer(errand.push, (*errand.places, place)))
            case RedundantCall():
                self._take_call(errand)
            case RedundantPushEnd():
                self._pending.append(errand)
        self.turn()

    def lost(self, errand: Errand) -> None:
        """A letter was never acknowledged: try another way."""
        self._pending.append(
            RedundantPushEnd(errand.push, False, False) if isinstance(errand, RedundantCall) else errand
        )

    def over(self, push: TokenPush) -> None:
        """A push is over that this robot was part of."""
        if push.id != self._called:
            return
        self._called = None
        done = isinstance(push.end, PushDone)
        tried = done or (isinstance(push.end, PushAborted) and push.end.tried)
        self._pending.append(RedundantPushEnd(push.id, tried, done))
        if tried:
            self._offer_at = self._robot.tick + SOON_TICKS

    def turn(self) -> None:
        """Offer, if it is time to, and send what waits for a way."""
        robot, vicinity = self._robot, self._robot.vicinity
        vicinity.home = _home(vicinity)
        if not vicinity.spare:
            self._offer_at, self._wait_ticks = None, OFFER_TICKS
        elif self._offer_at is None:
            self._offer_at = robot.tick + SOON_TICKS
        elif self._offers(self._offer_at):
            self._offer_at = robot.tick + self._wait_ticks
            self._wait_ticks = min(2 * self._wait_ticks, OFFER_TICKS_MAX)
            self._pending.append(RedundantOffer(0, (vicinity.place,)))
        towards = _homeward(vicinity) if self._pending else None
        if towards is not None:
            for each in self._pending:
                robot.post.write(towards, each)
            self._pending = []

    def next_tick(self) -> int | None:
        """Return when to be looked after, at the latest."""
        if self._pending:
            return self._robot.tick + 1
        wanted = self._offer_at is None or self._robot.vicinity.leads
        return self._offer_at if wanted and self._called is None else None

    def _offers(self, at: int) -> bool:
        """Tell whether it is time to offer, and there is anything to be called for."""
        return self._robot.tick >= at and self._called is None and self._robot.vicinity.leads

    def _take_call(self, call: RedundantCall) -> None:
        robot, vicinity = self._robot, self._robot.vicinity
        if len(call.places) > 1:
            node = vicinity.at(call.places[-2])
            if node is not None and node in robot.bearings:
                robot.post.write(node, RedundantCall(call.push, call.places[:-1]))
                return
        elif vicinity.spare and vicinity.place == call.places[0] and robot.ready and self._called is None:
            self._called = call.push
            robot.begin(call.push)
            return
        self._pending.append(RedundantPushEnd(call.push, False, False))


def _home(vicinity: LocalMap) -> int:
    """Return how many hops it is to the base, by what neighbours said last."""
    homes = vicinity.gradient.homes
    return 0 if vicinity.place == 0 else min([FAR, *(1 + homes.get(s.place, FAR) for s in vicinity.mutual().values())])


def _homeward(vicinity: LocalMap) -> int | None:
    """Return the neighbour that is nearest to the base."""
    homes = vicinity.gradient.homes
    found = min(((homes.get(state.place, FAR), node) for node, state in vicinity.mutual().items()), default=None)
    return found[1] if found is not None and found[0] < FAR else None
