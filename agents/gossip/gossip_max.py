"""Gossip: every robot learns the largest id in the swarm. It broadcasts the largest id that it has received.

The maximum is idempotent, commutative and associative. So lost, copied, late and reordered packets cost time and never
change the result. A checksum refuses damaged packets. A restarted robot begins with its own id, and receives the largest id
again.
"""

from struct import Struct as Layout
from typing import Annotated, Any, ClassVar, Final

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ProtocolError
from zwerm.wire.checksum import seal, unseal
from zwerm.wire.messages import Command, Observation, Transmission

_LAYOUT: Final = Layout(">I")


class GossipTable(Struct, frozen=True, forbid_unknown_fields=True):
    """A robot broadcasts every `every_ticks`. It is done once it has received `done_at` or a larger id."""

    every_ticks: Annotated[int, Meta(ge=1)] = 1
    done_at: Annotated[int, Meta(ge=0)] | None = None


class GossipMax(Controller):
    """Broadcasts the largest id that it has received, at first its own."""

    Parameters: ClassVar[type[Struct]] = GossipTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.largest = setup.node
        self.refused = 0
        self._reported = -1
        self._channels = setup.channels

    def step(self, observation: Observation) -> Command:
        """Take the largest received id, and broadcast it."""
        before = self._reported
        for packet in observation.inbox:
            try:
                (received,) = _LAYOUT.unpack(unseal(packet.payload))
            except ProtocolError:
                self.refused += 1
                continue
            if received > self.largest:
                self.largest = received
        table: Any = self.parameters
        outbox: tuple[Transmission, ...] = ()
        if observation.tick % table.every_ticks == 0:
            frame = seal(_LAYOUT.pack(self.largest))
            outbox = tuple([Transmission(channel, frame) for channel in self._channels])
        self._reported = self.largest
        news = {"largest": float(self.largest)} if self.largest != before else {}
        return Command(outbox=outbox, done=table.done_at is not None and self.largest >= table.done_at, telemetry=news)
