"""The beacon: every robot broadcasts a numbered packet at even intervals, and counts the packets that it receives from others.

The counts are statistics of links: number 7 after number 4 means that two packets are lost or late.
"""

from struct import Struct as Layout
from typing import Annotated, Any, ClassVar, Final

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ProtocolError
from zwerm.wire.checksum import HEAD_BYTES, seal, unseal
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission, WheelSpeeds

_LAYOUT: Final = Layout(">II")


class BeaconTable(Struct, frozen=True, forbid_unknown_fields=True):
    """A beacon every `every_ticks`, each of `payload_bytes` in all; the robot drives straight on at `speed_m_s`."""

    every_ticks: Annotated[int, Meta(ge=1)] = 1
    payload_bytes: Annotated[int, Meta(ge=HEAD_BYTES + _LAYOUT.size, le=1_024)] = 16
    speed_m_s: Annotated[float, Meta(ge=0.0)] = 0.0


class Beacon(Controller):
    """Broadcasts (id, number); `received` and `missed` count packets by sender."""

    Parameters: ClassVar[type[Struct]] = BeaconTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.received: dict[int, int] = {}
        self.missed: dict[int, int] = {}
        self.refused = 0
        self._next: dict[int, int] = {}
        self._number = 0
        self._drive = _straight_on(setup, self.parameters)

    def step(self, observation: Observation) -> Command:
        """Count received packets, and send the next beacon if it is due."""
        received, missed, following = self.received, self.missed, self._next
        for packet in observation.inbox:
            try:
                sender, number = _LAYOUT.unpack_from(unseal(packet.payload))
            except ProtocolError:
                self.refused += 1
                continue
            received[sender] = received.get(sender, 0) + 1
            expected = following.get(sender, number)
            if number >= expected:
                missed[sender] = missed.get(sender, 0) + number - expected
                following[sender] = number + 1
        table: Any = self.parameters
        if observation.tick % table.every_ticks:
            return Command(drive=self._drive)
        numbered = _LAYOUT.pack(self.setup.node, self._number)
        self._number += 1
        frame = seal(numbered.ljust(table.payload_bytes - HEAD_BYTES, b"\0"))
        return Command(
            drive=self._drive, outbox=tuple([Transmission(channel, frame) for channel in self.setup.channels])
        )


def _straight_on(setup: Setup, table: Any) -> BodyVelocity | WheelSpeeds | None:
    """Return the drive, or None if the node does not move."""
    speed: float = table.speed_m_s
    if setup.body is None or not speed:
        return None
    return BodyVelocity(speed) if setup.body.kind == "holonomic" else WheelSpeeds(speed, speed)
