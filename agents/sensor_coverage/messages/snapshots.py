"""Snapshots of sensor coverage: what its nodes report to the algorithm's own metrics and pictures, as `Command.snapshot`.

No node receives them. A coordinator reports the complex, a robot reports its own membership of it. Decoding is strict.
"""

from collections.abc import Callable
from typing import Final

import msgspec
from msgspec import Struct

Pairs = tuple[tuple[int, int], ...]


class ComplexSnapshot(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="complex"):
    """The complex of the swarm at one deployment cycle, by ids of robots.

    `frontier` and `obstacle` are edges among `edges`. Each of `paths` leads from a source to the robot that is pushed ahead.
    """

    cycle: int
    edges: Pairs
    frontier: Pairs
    obstacle: Pairs
    paths: tuple[tuple[int, ...], ...]


class MembershipSnapshot(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="membership"):
    """The sender has entered the complex, where `member` is true, or has left it."""

    member: bool


Snapshot = ComplexSnapshot | MembershipSnapshot

# Largest snapshot of a complex [bytes], so that packets fit into the same command: that of about 1,500 robots.
COMPLEX_BYTES_MAX: Final = 40_000

encode_snapshot: Final[Callable[[Snapshot], bytes]] = msgspec.msgpack.Encoder().encode
_decode: Final = msgspec.msgpack.Decoder(Snapshot).decode


def encode_complex(snapshot: ComplexSnapshot) -> bytes:
    """Return the encoded snapshot; of a larger complex than a command can hold, nothing: its pictures lack this cycle."""
    encoded = encode_snapshot(snapshot)
    return encoded if len(encoded) <= COMPLEX_BYTES_MAX else b""


def decode_snapshot(payload: bytes) -> Snapshot | None:
    """Return the snapshot in `payload`, or None where it holds none."""
    try:
        found: Snapshot = _decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None
    return found
