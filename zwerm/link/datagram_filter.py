"""Makes the kernel drop the datagrams that come to a UDP port of this process from given addresses (Linux).

All sessions of QUIC share one socket, so none can be shut down. A filter of the classic BPF on that socket needs no rights, and
drops a datagram before this process reads it. A session that is filtered ends when its lease does.
"""

import ctypes
import socket
import struct
import sys
from collections.abc import Collection, Sequence
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import Final

# The memory that the kernel grants the options of a socket, 20 kB, holds the old and the new filter of so many addresses.
ADDRESSES_MAX: Final = 16

_ATTACH_FILTER: Final = 26  # SO_ATTACH_FILTER
_INSTRUCTION: Final = struct.Struct("HBBI")  # operation, jump if true, jump if false, value
_LOAD_WORD, _LOAD_HALF, _LOAD_BYTE, _SHIFT_RIGHT, _JUMP_EQUAL, _RETURN = 0x20, 0x28, 0x30, 0x74, 0x15, 0x06
_IP_HEADER: Final = 0xFFF00000  # SKF_NET_OFF: offsets from here are those in the header of IP
_SOURCE_OFFSET: Final = {4: 12, 6: 8}  # of the address in the header of IP, by its version
_SOURCE_PORT: Final = 0  # offset in the header of UDP
_WHOLE: Final = 0xFFFFFFFF

Instruction = tuple[int, int, int, int]


def drop_datagrams(receiver: socket.socket, sources: Collection[tuple[str, int]]) -> bool:
    """Drop what comes to a UDP socket from `sources` (IP address and port), and from no others; return whether it can.

    The last call counts. Of more than ADDRESSES_MAX sources it drops those of the last ones. Raises ValueError for a host
    that is no IP address.
    """
    program = _program([(ip_address(host), port) for host, port in list(sources)[-ADDRESSES_MAX:]])
    if sys.platform != "linux":
        return False
    code = ctypes.create_string_buffer(b"".join(_INSTRUCTION.pack(*each) for each in program))
    described = struct.pack("HP", len(program), ctypes.addressof(code))
    try:
        receiver.setsockopt(socket.SOL_SOCKET, _ATTACH_FILTER, described)
    except OSError:
        return False
    return True


def _program(sources: Sequence[tuple[IPv4Address | IPv6Address, int]]) -> list[Instruction]:
    """Return a filter that drops datagrams from these sources."""
    found: list[Instruction] = []
    for address, port in sources:
        offset, words = _SOURCE_OFFSET[address.version], struct.unpack(f"!{len(address.packed) // 4}I", address.packed)
        compared: list[tuple[list[Instruction], int]] = [
            ([(_LOAD_BYTE, 0, 0, _IP_HEADER), (_SHIFT_RIGHT, 0, 0, 4)], address.version),
            *(([(_LOAD_WORD, 0, 0, _IP_HEADER + offset + 4 * at)], word) for at, word in enumerate(words)),
            ([(_LOAD_HALF, 0, 0, _SOURCE_PORT)], port),
        ]
        block: list[Instruction] = [(_RETURN, 0, 0, 0)]
        for loads, value in reversed(compared):
            block = [*loads, (_JUMP_EQUAL, 0, len(block), value), *block]
        found += block
    return [*found, (_RETURN, 0, 0, _WHOLE)]
