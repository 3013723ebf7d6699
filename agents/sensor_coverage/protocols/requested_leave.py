"""A robot's departure from the complex on the coordinator's request, by agreement with its neighbours.

A robot that has left stays in body where it is until the coordinator commands a move. Then it belongs to the complex
again.
"""

from collections.abc import Iterable
from typing import Any, ClassVar, Final

import numpy as np

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.messages.snapshots import MembershipSnapshot, encode_snapshot
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation

# Ticks after its last drive until a body stands still.
STILL_TICKS: Final = 2


class RequestedLeave(Component):
    """The negotiation of a robot under a coordinator.

    `wanted`: the robot must leave if it can. `driving`: it carries out a drive. `has_left`: it has left the complex.
    `snapshot` is a change of membership that is not reported yet.
    """

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = LeaveNegotiation.accepts

    def __init__(self, setup: Setup, random: np.random.Generator) -> None:
        first_incarnation = setup.incarnation == 1
        self.negotiation = LeaveNegotiation(setup.node, setup.dt_s, random, first_incarnation)
        self.wanted = False
        self.driving = False
        self.has_left = False
        self.snapshot = b"" if first_incarnation else encode_snapshot(MembershipSnapshot(True))
        self._driven_at = 0

    def observe(self, tick: int, visible: Iterable[int]) -> None:
        """Take in the visible robots; first in every tick."""
        self.negotiation.observe(tick, visible)
        self.negotiation.update(self._stands(tick))

    def driven(self, tick: int) -> None:
        """Record that the robot drives in this tick."""
        self._driven_at = tick

    def rejoin(self) -> None:
        """Belong to the complex again."""
        if self.has_left:
            self.has_left, self.snapshot = False, encode_snapshot(MembershipSnapshot(True))

    def receive(self, sender: int, message: Any, tick: int) -> None:
        """Take in a message about neighbour lists and locks."""
        self.negotiation.receive(sender, message, tick)

    def poll(self, tick: int) -> None:
        """Negotiate on the coordinator's request, and leave once all neighbours have agreed."""
        negotiation = self.negotiation
        negotiation.update(self._stands(tick))
        negotiation.wanted = self.wanted
        negotiation.poll(tick)
        if negotiation.left:
            self.has_left, self.snapshot = True, encode_snapshot(MembershipSnapshot(False))
            negotiation.update(stands=False)

    def outgoing(self) -> list[Outgoing]:
        """Return the messages of the negotiation."""
        return self.negotiation.outgoing()

    def next_wake(self) -> int | None:
        """Return the next tick of the negotiation."""
        return self.negotiation.next_wake()

    def _stands(self, tick: int) -> bool:
        return not (self.has_left or self.driving or tick <= self._driven_at + STILL_TICKS)
