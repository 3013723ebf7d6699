"""Messages of the census that detects the end of the deployment."""

from typing import Annotated

from msgspec import Meta, Struct

Count = Annotated[int, Meta(ge=0, le=2**62)]


class CensusWave(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="wave"):
    """The sender has joined this wave by `parent` (None at the base), and waits for the neighbours in `missing`.

    With `again` the neighbours in `missing` that have joined must send their wave or tally again. `roster` are all
    robots that were ever let out. `search` counts the times that the base has all robots try again what had failed. `dead` are
    the robots that the tally before had as dead: what they saw of walls counts no more.
    """

    number: Count
    parent: Count | None
    missing: tuple[Count, ...]
    again: bool
    roster: bytes = b""
    search: Count = 0
    dead: bytes = b""


class CensusTally(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="tally"):
    """To the parent: the counted robots, their frontier claims, and the latest wave in which one of them was disturbed.

    `incarnations` is the sum of the robots' random incarnation numbers. `present` are the counted robots, and `dead` those
    that one of them sees and that do not answer it. `roster` has robots that were let out, if the wave lacked any.
    `unproven` counts the open arcs around the robots that are left after all attempts to follow a wall there.
    """

    number: Count
    robots: Count
    claims: Count
    disturbed: Count
    incarnations: Count
    present: bytes = b""
    dead: bytes = b""
    roster: bytes = b""
    unproven: Count = 0


CensusMessage = CensusWave | CensusTally
