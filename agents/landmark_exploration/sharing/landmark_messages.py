"""Messages of landmark-based exploration: under a checksum, and small.

With a cap of `SMALL_BYTES` every packet fits into a small radio frame. No entry is longer than such a packet (see
`log_entries`). Vectors, registers and paths are cut into packets, and each packet can be read without the others.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Final

from msgspec import Meta, Struct

from zwerm.wire.checksum import Sealed

# The smallest cap that is supported [bytes]: the frame of a small radio.
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
    if the robot found no open frontier in these logs. It then adds no entry.
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
    """To the coordinator: the newest task that the robot has, by the coordinator's incarnation and the task's number.

    `free`: the robot has finished the task. `reached` False: it did not reach the frontier. `entries`: the number of
    entries in its log. `landmarks`: the ids of the landmarks that it sees, 2 bytes each.
    """

    incarnation: Count
    coordinator_incarnation: Count
    task_number: Count
    free: bool
    reached: bool
    entries: Count
    landmarks: Bytes


class TaskPart(_MapMessage, frozen=True, tag="o"):
    """To a robot: part `part` of `parts` of the task `task_number`, in bytes.

    The module `exploration_tasks` defines the format of all parts together. `incarnation` is that of the receiver.
    """

    coordinator_incarnation: Count
    incarnation: Count
    task_number: Count
    part: Count
    parts: Count
    bytes_: Bytes


Message = Entries | Vector | RegisterBeacon | TaskReport | TaskPart

_sealed: Final = Sealed(Message)
write: Final[Callable[[Message], bytes]] = _sealed.write
# Many robots of one process receive the same broadcast.
read: Final[Callable[[bytes], Message | None]] = lru_cache(maxsize=1 << 11)(_sealed.read)
