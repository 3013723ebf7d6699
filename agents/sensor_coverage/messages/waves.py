"""Messages of the census that detects the end of the deployment."""

from typing import Annotated

from msgspec import Meta, Struct

Count = Annotated[int, Meta(ge=0, le=2**62)]


class CensusWave(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="wave"):
    """The sender has joined this wave by `parent` (None at the base), and waits for the neighbours in `missing`.

    With `again` the neighbours in `missing` that have joined shall send their wave or tally once more.
    """

    number: Count
    parent: Count | None
    missing: tuple[Count, ...]
    again: bool


class CensusTally(Struct, frozen=True, array_like=True, forbid_unknown_fields=True, tag="tally"):
    """To the parent: the counted robots, their frontier claims, and the latest wave in which one of them was disturbed.

    `incarnations` is the sum of the robots' random incarnation numbers.
    """

    number: Count
    robots: Count
    claims: Count
    disturbed: Count
    incarnations: Count


CensusMessage = CensusWave | CensusTally
