"""Disc range: a packet reaches all nodes within `range_m` and no others, the unit disc model.

Clark, Colbourn, Johnson: Unit disk graphs. Discrete Mathematics 86 (1990).
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.types import Positive
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import BlockedPairs


class RangeTable(RadioModelTable):
    """The greatest distance that a packet travels [m]."""

    range_m: Positive


class DiscRange(RadioModel):
    """Drops packets over more than `range_m`, by the positions of both nodes at the time of sending."""

    cause: ClassVar[str] = "out-of-range"
    needs_positions: ClassVar[bool] = True
    out_of_reach: ClassVar[bool] = True
    memoryless: ClassVar[bool] = True
    Parameters: ClassVar[type[RadioModelTable]] = RangeTable
    example: ClassVar[Mapping[str, Any]] = {"range_m": 1.5}

    def __init__(self, parameters: RangeTable, context: ModelContext) -> None:
        self.range_max_m = parameters.range_m

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Compare the distance of each packet with the range."""
        offset = sent.scene.position[packets.sender] - sent.scene.position[packets.receiver]
        return Verdict(np.asarray(np.hypot(offset[:, 0], offset[:, 1]) > self.range_max_m))

    @classmethod
    def network_rule(cls, parameters: RangeTable) -> BlockedPairs:
        """Return that the world computes the blocked pairs."""
        return BlockedPairs()
