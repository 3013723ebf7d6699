"""All messages between neighbours on the robots' radio channel, and how they are sealed under a checksum."""

from collections.abc import Callable
from typing import Final

from zwerm.agents.sensor_coverage.messages.beacons import PathVector, StateBeacon, StateRequest
from zwerm.agents.sensor_coverage.messages.locks import ListRequest, LockProtocolMessage
from zwerm.agents.sensor_coverage.messages.pushes import Segment, SegmentAck, SlotVacated
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
)

_sealed: Final = Sealed(PeerMessage)
write: Final[Callable[[PeerMessage], bytes]] = _sealed.write
read: Final[Callable[[bytes], PeerMessage | None]] = _sealed.read
