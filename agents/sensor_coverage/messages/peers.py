"""All messages between neighbours on the robots' radio channel, in envelopes that are sealed under a checksum."""

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Final

from msgspec import Meta, Struct

from zwerm.agents.sensor_coverage.messages.beacons import PathVector, StateBeacon, StateRequest
from zwerm.agents.sensor_coverage.messages.incarnations import ANY, Incarnation
from zwerm.agents.sensor_coverage.messages.locks import ListRequest, LockProtocolMessage
from zwerm.agents.sensor_coverage.messages.pushes import Segment, SegmentAck, SlotVacated
from zwerm.agents.sensor_coverage.messages.walls import WalkMessage
from zwerm.agents.sensor_coverage.messages.waves import CensusMessage
from zwerm.wire.checksum import Sealed

CHANNEL: Final = "robots"

PeerMessage = (
    CensusMessage
    | StateBeacon
    | PathVector
    | StateRequest
    | ListRequest
    | SlotVacated
    | Segment
    | SegmentAck
    | LockProtocolMessage
    | WalkMessage
)


Number = Annotated[int, Meta(ge=0, le=2**62)]


class Envelope(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A message with the incarnation of its sender, and that of its receiver (ANY: unknown, or many receivers).

    `number` counts the sender's broadcasts; a message to one robot has 0. Each message is sent in `copies` equal packets.
    """

    sender: Incarnation
    receiver: Incarnation
    number: Number
    copies: Number
    message: PeerMessage


# Packets whose message is kept: inline, all receivers of a broadcast read the same one at the same tick.
_KEPT: Final = 64

_sealed: Final = Sealed(Envelope)
read_envelope: Final[Callable[[bytes], Envelope | None]] = lru_cache(_KEPT)(_sealed.read)


def write(message: PeerMessage, sender: int = 1, receiver: int = ANY, number: int = 0, copies: int = 1) -> bytes:
    """Return the packet with a message from an incarnation of its sender to one of its receiver."""
    return _sealed.write(Envelope(sender, receiver, number, copies, message))


def read(payload: bytes) -> PeerMessage | None:
    """Return the message in a packet of any incarnation, or None if it is corrupt."""
    envelope = read_envelope(payload)
    return None if envelope is None else envelope.message
