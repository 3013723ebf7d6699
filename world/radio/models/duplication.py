"""Duplication: some packets arrive more than once, as behind a link layer whose acknowledgements get lost.

A copy is judged by the models that follow with draws of its own. It counts as sent, and as a copy.
"""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from zwerm.scenario.types import Fraction
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict


class DuplicationTable(LinkTable):
    """The fraction of packets that are copied, and how many copies arrive besides the packet."""

    fraction: Fraction
    copies: Annotated[int, Field(ge=1, le=15)] = 1


class Duplication:
    """Copies each packet with probability `fraction`; drops nothing."""

    kind: ClassVar[str] = "duplication"
    cause: ClassVar[str] = "duplication"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = DuplicationTable

    def __init__(self, parameters: DuplicationTable, place: ModelPlace) -> None:
        self._fraction = parameters.fraction
        self._copies = parameters.copies
        self._draws = place.link_draws()

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Draw once for every packet."""
        copied = self._draws.uniform(packets.link, packets.key) < self._fraction
        return Verdict(copies=copied.astype(np.int64) * self._copies)
