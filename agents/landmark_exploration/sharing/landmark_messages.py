"""Messages of landmark-based exploration: under a checksum, and small.

With a cap of `SMALL_BYTES` every packet fits into a small radio frame. Entries are never longer than one such packet (see
`entries`); vectors, registers and paths are cut into packets that each make sense alone.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Final

from msgspec import Meta, Struct

from zwerm.wire.checksum import Sealed

# The smallest cap that is supported [bytes]; a radio of tens of bytes at a time has this much.
SMALL_BYTES: Final = 64

# Without a cap no packet is longer than about this [bytes].
LARGE_BYTES: Final = 1_000

Count = Annotated[int, Meta(ge=0, le=2**53)]
Digest = Annotated[int, Meta(ge=0, le=2**62)]
Bytes = Annotated[bytes, Meta(max_length=LARGE_BYTES)]


class _MapMessage(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, led by its tag."""


# --- the map ---------------------------------------------------------------------------------------------------------


class Entries(_MapMessage, frozen=True, tag="e"):
    """Successive entries of a log, from number `first` on."""

    origin: Count
    first: Count
    entries: tuple[Bytes, ...]


class Vector(_MapMessage, frozen=True, tag="v"):
    """The sender's version vector for all origins in [low, high): origin, count, origin, count, ...

    An origin that is not named has no entries. With `ask` the receiver sends the entries that the sender lacks.
    """

    low: Count
    high: Count
    counts: tuple[Count, ...]
    ask: bool


class Register(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """The state that a robot announces; the register with the greatest (incarnation, stamp) counts.

    `claim`: the key of the frontier that it explores, plus 1; 0: none. `frozen`: 0, or the digest of the logs plus 1,
    if the robot found nothing left to explore in these logs. It then adds no entry.
    """

    node: Count
    incarnation: Count
    stamp: Count
    claim: Count = 0
    frozen: Digest = 0


class RegisterBeacon(_MapMessage, frozen=True, tag="b"):
    """The digest of the sender's version vector, and registers, the sender's own first."""

    digest: Digest
    registers: tuple[Register, ...]


# --- robots and coordinator --------------------------------------------------------------------------------------------


class TaskReport(_MapMessage, frozen=True, tag="r"):
    """To the coordinator: the robot has the order `order` of the coordinator's incarnation `coordinator_incarnation`, and, if
    `free`, has finished it.

    `reached` False: it did not get to the frontier. `entries`: how many its log has. `landmarks`: those it sees, 2 bytes each.
    """

    incarnation: Count
    coordinator_incarnation: Count
    order: Count
    free: bool
    reached: bool
    entries: Count
    landmarks: Bytes


class TaskPart(_MapMessage, frozen=True, tag="o"):
    """To a robot: part `part` of `parts` of the order number `order`, in bytes.

    The module `orders` defines the format of all parts together. `incarnation` is that of the robot it is meant for.
    """

    coordinator_incarnation: Count
    incarnation: Count
    order: Count
    part: Count
    parts: Count
    bytes_: Bytes


Message = Entries | Vector | RegisterBeacon | TaskReport | TaskPart

_sealed: Final = Sealed(Message)
write: Final[Callable[[Message], bytes]] = _sealed.write
# Many robots of one process hear the same broadcast.
read: Final[Callable[[bytes], Message | None]] = lru_cache(maxsize=1 << 11)(_sealed.read)
