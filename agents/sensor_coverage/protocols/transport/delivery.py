"""The receiving end of the reliable mailbox, and of the limited flood that announces a vacated slot.

Acknowledgements and forwarded messages are sent in the order in which packets arrived.
"""

from collections.abc import Callable
from typing import Any, ClassVar

from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.messages.pushes import Segment, SegmentAck, SlotVacated
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.transport.mailbox import ReliableMailbox
from zwerm.agents.sensor_coverage.protocols.transport.vacancy import REPEAT_TICKS


class Delivery(Component):
    """Acknowledges each segment, dispatches its body once, and forwards announcements of vacated slots."""

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = (Segment, SlotVacated)

    def __init__(self, mailbox: ReliableMailbox, dispatch: Callable[[int, Any, int], object]) -> None:
        """Call `dispatch` with the sender and the body of each new segment, and the tick."""
        self._mailbox = mailbox
        self._dispatch = dispatch
        self._outbox: list[Outgoing] = []
        self._forward_at: dict[int, int] = {}  # push: tick from which its announcement is forwarded again

    def receive(self, sender: int, message: Segment | SlotVacated, tick: int) -> bool:
        """Take in a segment or an announcement; return False for an announcement that is not forwarded."""
        if isinstance(message, Segment):
            body = self._mailbox.accept(sender, message)
            self._outbox.append(Outgoing(sender, SegmentAck(message.number)))
            if body is not None:
                self._dispatch(sender, body, tick)
        elif message.hops and tick >= self._forward_at.get(message.push, 0):
            self._forward_at[message.push] = tick + 2 * REPEAT_TICKS
            self._outbox.append(Outgoing(None, SlotVacated(message.push, message.hops - 1)))
        else:
            return False
        return True

    def outgoing(self) -> list[Outgoing]:
        """Return the acknowledgements and forwarded announcements of this tick."""
        sent, self._outbox = self._outbox, []
        return sent
