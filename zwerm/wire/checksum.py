"""Frames: a payload with a checksum, for radios that damage bits.

A frame is the CRC-32 of the payload (zlib's polynomial; 4 bytes, big-endian) followed by the payload. It detects every error of
up to 3 bits in payloads of this length, and all other errors but one in 4e9. It does not authenticate the sender.
"""

from struct import Struct
from typing import Any, Final
from zlib import crc32

import msgspec

from zwerm.errors import ProtocolError
from zwerm.wire.messages import REFUSABLE

_HEAD: Final = Struct(">I")
HEAD_BYTES: Final = _HEAD.size


def seal(payload: bytes) -> bytes:
    """Return the frame that holds `payload`."""
    return _HEAD.pack(crc32(payload)) + payload


def unseal(frame: bytes) -> bytes:
    """Return the payload of `frame`. Raises ProtocolError, reason `damaged`, where the checksum does not fit."""
    if len(frame) < HEAD_BYTES:
        raise ProtocolError("damaged", f"a frame of {len(frame)} bytes, at least {HEAD_BYTES}")
    payload = frame[HEAD_BYTES:]
    if _HEAD.unpack_from(frame)[0] != crc32(payload):
        raise ProtocolError("damaged", "the checksum does not fit")
    return payload


class Sealed:
    """A codec for messages of the types `messages` (a struct or a union) on a radio that damages bits."""

    def __init__(self, messages: Any) -> None:
        self._encode = msgspec.msgpack.Encoder().encode
        self._decode = msgspec.msgpack.Decoder(messages).decode

    def write(self, message: Any) -> bytes:
        """Return the payload of a packet with this message."""
        return seal(self._encode(message))

    def read(self, payload: bytes) -> Any:
        """Return the message in a packet, or None where it was damaged or is of another type."""
        try:
            return self._decode(unseal(payload))
        except (ProtocolError, *REFUSABLE):
            return None
