"""Duplication: some packets arrive more than once, as on a link layer that loses acknowledgements.

The models that follow judge a copy with random numbers of its own. It counts as sent, and as a copy.
"""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from zwerm.scenario.types import Fraction
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict


class DuplicationTable(RadioModelTable):
    """The fraction of packets that are copied, and the number of copies that arrive besides the packet."""

    fraction: Fraction
    copies: Annotated[int, Field(ge=1, le=15)] = 1


class Duplication(RadioModel):
    """Copies each packet with probability `fraction`; drops nothing."""

    Parameters: ClassVar[type[RadioModelTable]] = DuplicationTable
    example: ClassVar[Mapping[str, Any]] = {"fraction": 0.5, "copies": 2}

    def __init__(self, parameters: DuplicationTable, context: ModelContext) -> None:
        self._fraction = parameters.fraction
        self._copies = parameters.copies
        self._random = context.link_random()

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Compare one random number of each packet with the fraction."""
        copied = self._random.uniform(packets.link, packets.key) < self._fraction
        return Verdict(copies=copied.astype(np.int64) * self._copies)

    @classmethod
    def network_rule(cls, parameters: DuplicationTable) -> None:
        """Raise ValueError: no duplicate passes Zenoh."""
        raise ValueError("Zenoh drops duplicates by their sequence number")
