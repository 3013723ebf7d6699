"""Average consensus: every robot moves its value towards the mean of the values that it receives.

With symmetric links and enough steps all values become equal (Olfati-Saber, Fax, Murray 2007). Each part of a partitioned swarm
agrees on a value of its own; after the partition they agree again. Lost packets move the common value.
"""

from struct import Struct as Layout
from typing import Annotated, Any, ClassVar, Final

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ProtocolError
from zwerm.maths.sums import added
from zwerm.wire.checksum import seal, unseal
from zwerm.wire.messages import Command, Observation, Transmission

_LAYOUT: Final = Layout(">d")


class AveragingTable(Struct, frozen=True, forbid_unknown_fields=True):
    """The size of a step towards the mean of the values received, and the ticks between two broadcasts."""

    gain: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.3
    every_ticks: Annotated[int, Meta(ge=1)] = 1


class Averaging(Controller):
    """Broadcasts its value, at first its id."""

    Parameters: ClassVar[type[Struct]] = AveragingTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.value = float(setup.node)
        self.refused = 0

    def step(self, observation: Observation) -> Command:
        """Move towards the mean of the values received, and broadcast the own value."""
        received = []
        for packet in observation.inbox:
            try:
                received.append(_LAYOUT.unpack(unseal(packet.payload))[0])
            except ProtocolError:
                self.refused += 1
        table: Any = self.parameters
        if received:
            self.value += table.gain * (added(received) / len(received) - self.value)
        outbox: tuple[Transmission, ...] = ()
        if observation.tick % table.every_ticks == 0:
            frame = seal(_LAYOUT.pack(self.value))
            outbox = tuple([Transmission(channel, frame) for channel in self.setup.channels])
        return Command(outbox=outbox, telemetry={"value": self.value})
