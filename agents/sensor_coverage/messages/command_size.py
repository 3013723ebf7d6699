"""How many packets fit into one command: a longer command is refused, and ends its node."""

from collections.abc import Sequence
from typing import Final

from zwerm.wire.messages import MESSAGE_BYTES_MAX, Transmission

# Bytes of a command that are kept free for everything but packets and snapshot, and bytes of a packet beside its payload.
COMMAND_BYTES_FREE: Final = 2_048
PACKET_BYTES: Final = 40


def fitting(packets: Sequence[Transmission], bytes_taken: int) -> int:
    """Return how many of the first packets, one at least, fit into a command of which `bytes_taken` are in use."""
    left = MESSAGE_BYTES_MAX - COMMAND_BYTES_FREE - bytes_taken
    for number, packet in enumerate(packets):
        left -= len(packet.payload) + PACKET_BYTES
        if left < 0:
            return max(1, number)
    return len(packets)
