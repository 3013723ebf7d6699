"""Messages between decentralised robots and a coordinator that only finds redundant robots.

All of them cross the uplink under a checksum, and may be lost, late or repeated. A robot repeats its report until it is
noted. Advice names versions of neighbour lists, and a version never occurs twice. So an old message is either still
true, or the neighbours with the lists that it names detect that it is not. No receiver needs to know which incarnation
of the coordinator sent it.
"""

from collections.abc import Callable
from typing import Annotated, Final

from msgspec import Meta, Struct

from zwerm.wire.checksum import Sealed

CHANNEL: Final = "uplink"

Count = Annotated[int, Meta(ge=0, le=2**62)]


class _AdviceMessage(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, which begins with its tag."""


class StandingReport(_AdviceMessage, frozen=True, tag="standing"):
    """The sender's part of the complex.

    `number` grows with every new report. `listed` are the robots that the sender sees, ascending, in its neighbour list
    of that `version`. The sender shares a boundary edge with the robots in `fenced`. `stands`: it is in the complex.
    `willing`: it has no frontier, is no base station, and opens no side if it leaves, as far as it knows.
    """

    number: Count
    version: Count
    listed: tuple[Count, ...]
    fenced: tuple[Count, ...]
    stands: bool
    willing: bool


class ReportNoted(_AdviceMessage, frozen=True, tag="noted"):
    """The coordinator has noted the receiver's report of this number."""

    number: Count


class CollectReports(_AdviceMessage, frozen=True, tag="collect"):
    """The coordinator lacks the receiver's report."""


class RedundantAdvice(_AdviceMessage, frozen=True, tag="redundant"):
    """The receiver is redundant while it sees exactly these neighbours, and each has its list of this version."""

    versions: tuple[tuple[Count, Count], ...]


AdviceMessage = StandingReport | ReportNoted | CollectReports | RedundantAdvice

_sealed: Final = Sealed(AdviceMessage)
write: Final[Callable[[AdviceMessage], bytes]] = _sealed.write
read: Final[Callable[[bytes], AdviceMessage | None]] = _sealed.read
