"""Robots that have left the complex, and how the base calls them: it pushes from there before it releases another robot.

    offer   redundant robot to base, hop by hop, each to the neighbour that is nearest to the base
    call    base to redundant robot: through the slots of the offer's path, with the robots that occupy them now end
    rear of the push to base: the outcome; also of a push from the base, if its rear does not see the base

Each hop is a reliable message, and a robot that forwards one keeps nothing. The base has one push at a time, its own or
one that it called for, and gives the new slot its number. So no slot has two numbers, and no number two slots. An offer
or a call that is lost costs time. A base that never receives an end continues after a while.
"""

from collections.abc import Callable
from typing import ClassVar, Final

from zwerm.agents.sensor_coverage.messages.beacons import FAR
from zwerm.agents.sensor_coverage.messages.pushes import (
    Body,
    PushAborted,
    PushDone,
    RedundantCall,
    RedundantOffer,
    RedundantPushEnd,
    RelayedMessage,
)
from zwerm.agents.sensor_coverage.neighbourhood.situation import Situation
from zwerm.agents.sensor_coverage.protocols.component import Component

# Ticks before the first offer, and between offers, at first and at most.
FIRST_OFFER_TICKS: Final = 10
OFFER_TICKS: Final = 200
OFFER_TICKS_MAX: Final = 3200
# Bound of the hops of an offer.
HOPS_MAX: Final = 64


class RedundantPool(Component):
    """One robot's part in offers, calls and ends. `begin_push` makes the robot the rear of a push."""

    accepts: ClassVar[tuple[type, ...]] = (RedundantOffer, RedundantCall, RedundantPushEnd)

    def __init__(self, situation: Situation, begin_push: Callable[[int], None]) -> None:
        self._situation = situation
        self._begin_push = begin_push
        self._pending: list[RelayedMessage] = []
        self._offer_at: int | None = None
        self._wait_ticks = OFFER_TICKS
        self._called: int | None = None

    def receive(self, sender: int, message: RelayedMessage, tick: int) -> None:
        """Take in a message, and forward it."""
        match message:
            case RedundantOffer(push, slots):
                slot = self._situation.local_map.slot
                if slot not in slots and len(slots) < HOPS_MAX:
                    self._pending.append(RedundantOffer(push, (*slots, slot)))
            case RedundantCall():
                self._take_call(message)
            case RedundantPushEnd():
                self._pending.append(message)
        self.poll(tick)

    def lost(self, body: Body) -> None:
        """Send a message that was never acknowledged by another neighbour; a lost call ends its push."""
        match body:
            case RedundantCall(push):
                self._pending.append(RedundantPushEnd(push, False, False))
            case RedundantOffer() | RedundantPushEnd():
                self._pending.append(body)
            case _:
                pass

    def push_over(self, push: int, end: Body | None, untold: bool) -> None:
        """Report the outcome of a push, if this robot was called for it, or is its rear and does not see the base."""
        called = push == self._called
        if not (called or untold):
            return
        done = isinstance(end, PushDone)
        tried = done or (isinstance(end, PushAborted) and end.tried)
        self._pending.append(RedundantPushEnd(push, tried, done))
        if not called:
            return
        self._called = None
        if tried:
            self._offer_at = self._situation.tick + FIRST_OFFER_TICKS

    def poll(self, tick: int) -> None:
        """Offer if it is time, and send the pending messages to the neighbour that is nearest to the base."""
        local_map = self._situation.local_map
        if not local_map.redundant:
            self._offer_at, self._wait_ticks = None, OFFER_TICKS
        elif self._offer_at is None:
            self._offer_at = tick + FIRST_OFFER_TICKS
        elif tick >= self._offer_at and self._called is None and local_map.has_route:
            self._offer_at = tick + self._wait_ticks
            self._wait_ticks = min(2 * self._wait_ticks, OFFER_TICKS_MAX)
            self._pending.append(RedundantOffer(0, (local_map.slot,)))
        towards = _neighbour_nearest_to_base(self._situation) if self._pending else None
        if towards is not None:
            for each in self._pending:
                self._situation.mailbox.write(towards, each)
            self._pending = []

    def next_wake(self) -> int | None:
        """Return the tick of the next offer, or the next tick if messages are pending."""
        if self._pending:
            return self._situation.tick + 1
        wanted = self._offer_at is None or self._situation.local_map.has_route
        return self._offer_at if wanted and self._called is None else None

    def _take_call(self, call: RedundantCall) -> None:
        """Forward a call, be the rear of its push, or report that neither is possible."""
        situation, local_map = self._situation, self._situation.local_map
        if len(call.slots) > 1:
            node = local_map.at(call.slots[-2])
            if node is not None and node in situation.bearings:
                situation.mailbox.write(node, RedundantCall(call.push, call.slots[:-1]))
                return
        elif local_map.redundant and local_map.slot == call.slots[0] and situation.free and self._called is None:
            self._called = call.push
            self._begin_push(call.push)
            return
        self._pending.append(RedundantPushEnd(call.push, False, False))


def _neighbour_nearest_to_base(situation: Situation) -> int | None:
    found = min(((hops, node) for node, (hops, _) in situation.homes.items()), default=None)
    return found[1] if found is not None and found[0] < FAR else None
