"""Disc range: a packet carries `range_m` and not a step further, the unit disc model of the literature.

Clark, Colbourn, Johnson: Unit disk graphs. Discrete Mathematics 86 (1990).
"""

from typing import ClassVar

import numpy as np

from zwerm.scenario.types import Positive
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict


class RangeTable(LinkTable):
    """How far a packet carries [m]."""

    range_m: Positive


class DiscRange:
    """Drops what is sent further than `range_m`, by the two positions at the time of sending."""

    kind: ClassVar[str] = "range"
    cause: ClassVar[str] = "out-of-range"
    needs_positions: ClassVar[bool] = True
    out_of_reach: ClassVar[bool] = True
    Parameters: ClassVar[type[LinkTable]] = RangeTable

    def __init__(self, parameters: RangeTable, place: ModelPlace) -> None:
        self._range_m = parameters.range_m

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Compare distances."""
        offset = air.scene.position[packets.sender] - air.scene.position[packets.receiver]
        return Verdict(np.asarray(np.hypot(offset[:, 0], offset[:, 1]) > self._range_m))
