"""Cuts entries and version vectors into messages that fit into a packet."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from msgspec.structs import astuple

from zwerm.agents.landmark_exploration.sharing.landmark_messages import Entries, Register, Vector
from zwerm.agents.landmark_exploration.sharing.replica import Stretch

# Overhead of a packet of entries [bytes]: checksum, tag, origin, number; and of each entry in it.
_ENTRIES_BYTES: Final = 4 + 3 + 5 + 5 + 3
_ENTRY_BYTES: Final = 2
# The same for a vector, and the largest size of an (origin, count) pair.
_VECTOR_BYTES: Final = 4 + 3 + 5 + 5 + 3 + 1
_PAIR_BYTES: Final = 10

# An upper bound of all origins.
ORIGINS_END: Final = 1 << 32


def pack_entries(stretch: Stretch, bytes_max: int) -> Iterator[Entries]:
    """Yield a stretch in messages of at most `bytes_max` bytes. An entry that is longer has a message of its own."""
    first, size = 0, _ENTRIES_BYTES
    for number, entry in enumerate(stretch.entries):
        needed = len(entry) + _ENTRY_BYTES
        if number > first and size + needed > bytes_max:
            yield Entries(stretch.origin, stretch.first + first, stretch.entries[first:number])
            first, size = number, _ENTRIES_BYTES
        size += needed
    if first < len(stretch.entries):
        yield Entries(stretch.origin, stretch.first + first, stretch.entries[first:])


def register_bytes(register: Register) -> int:
    """Return the encoded size of a register in a message [bytes]."""
    node, incarnation, stamp, claim, frozen = astuple(register)
    return 1 + sum(_integer_bytes(each) for each in (node, incarnation, stamp, claim, frozen))


def _integer_bytes(value: int) -> int:
    """Return the size of a non-negative integer in MessagePack [bytes]."""
    return 1 if value < 1 << 7 else 2 if value < 1 << 8 else 3 if value < 1 << 16 else 5 if value < 1 << 32 else 9


def pack_vector(vector: Mapping[int, int], bytes_max: int, ask: bool) -> list[Vector]:
    """Return a version vector in messages of at most `bytes_max` bytes, which together cover all origins."""
    origins = sorted(vector)
    most = max(1, (bytes_max - _VECTOR_BYTES) // _PAIR_BYTES)
    starts = range(0, max(len(origins), 1), most)
    lows = [0, *(origins[start] for start in starts[1:]), ORIGINS_END]
    return [
        Vector(lows[n], lows[n + 1], _flat(origins[start : start + most], vector), ask)
        for n, start in enumerate(starts)
    ]


def _flat(origins: Sequence[int], vector: Mapping[int, int]) -> tuple[int, ...]:
    return tuple(number for origin in origins for number in (origin, vector[origin]))


def counts_of(vector: Vector) -> dict[int, int]:
    """Return the counts in a message, by origin."""
    return dict(zip(vector.counts[::2], vector.counts[1::2], strict=False))
