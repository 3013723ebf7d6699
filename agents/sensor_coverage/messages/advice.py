"""What robots that find their way by themselves, and a coordinator that finds only who can be spared, say to each other.

All of it crosses the uplink, under a checksum, and may get lost, come late, or twice. A robot says how it stands until it
hears that this was noted. What it is told to rely on are versions of lists, which never come again: so an old word is either
still true or is found out by those whose lists it names; nobody needs to know which life of the coordinator spoke.
"""

from collections.abc import Callable
from typing import Annotated, Final

from msgspec import Meta, Struct

from zwerm.wire.checksum import Sealed

CHANNEL: Final = "uplink"

Count = Annotated[int, Meta(ge=0, le=2**62)]


class _Message(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, led by its name."""


class StandingReport(_Message, frozen=True, tag="standing"):
    """How the sender stands in the complex.

    `number` grows with everything new that it says. It sees those in `listed`, ascending, as its list of that version has it,
    and shares an edge of the rim of what is covered with those in `fenced`. `stands`: it is one of the complex. `willing`: it
    has no frontier, no place at a base station, and no side that would come open without it, as far as it knows.
    """

    number: Count
    version: Count
    listed: tuple[Count, ...]
    fenced: tuple[Count, ...]
    stands: bool
    willing: bool


class ReportNoted(_Message, frozen=True, tag="noted"):
    """What the receiver said under this number has been noted."""

    number: Count


class CollectReports(_Message, frozen=True, tag="collect"):
    """The sender lacks the receiver's word."""


class RedundantAdvice(_Message, frozen=True, tag="spare"):
    """The receiver can be spared as long as each of its neighbours' lists is of this version; it sees nobody else."""

    versions: tuple[tuple[Count, Count], ...]


Word = StandingReport | ReportNoted | CollectReports | RedundantAdvice

_sealed: Final = Sealed(Word)
write: Final[Callable[[Word], bytes]] = _sealed.write
read: Final[Callable[[bytes], Word | None]] = _sealed.read
