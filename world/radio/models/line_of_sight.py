"""Line of sight: a wall between two robots stops a packet, as it stops light.

What was found for a link is kept while neither end moves. Bodies do not block.
"""

from typing import ClassVar

import numpy as np

from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict
from zwerm.world.radio.static_links import StaticLinkValues


class LineOfSightModel:
    """Drops what a wall stands in the way of, at the time of sending."""

    kind: ClassVar[str] = "line_of_sight"
    cause: ClassVar[str] = "no-line-of-sight"
    needs_positions: ClassVar[bool] = True
    out_of_reach: ClassVar[bool] = True
    Parameters: ClassVar[type[LinkTable]] = LinkTable

    def __init__(self, parameters: LinkTable, place: ModelPlace) -> None:
        self._blocked = StaticLinkValues(
            place.links, lambda start, end: place.arena.blocked(start, end).astype(np.float64)
        )

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Test the segment between the two positions against every wall."""
        return Verdict(self._blocked.between(air.scene, packets) > 0.0)
