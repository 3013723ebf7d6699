"""Line of sight: a wall between two robots stops a packet.

The result for a link is kept while neither of its nodes moves. Bodies do not block.
"""

from typing import ClassVar

import numpy as np

from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import BlockedPairs
from zwerm.world.radio.static_links import StaticLinkValues


class LineOfSightModel(RadioModel):
    """Drops packets whose line from sender to receiver crosses a wall at the time of sending."""

    cause: ClassVar[str] = "no-line-of-sight"
    needs_positions: ClassVar[bool] = True
    out_of_reach: ClassVar[bool] = True
    memoryless: ClassVar[bool] = True

    def __init__(self, parameters: RadioModelTable, context: ModelContext) -> None:
        self._never_blocks = context.arena.is_convex
        self._blocked = StaticLinkValues(
            context.links, lambda start, end: context.arena.blocked(start, end).astype(np.float64)
        )

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Test the segment between both positions against every wall."""
        if self._never_blocks:
            return Verdict()
        return Verdict(self._blocked.between(sent.scene, packets) > 0.0)

    @classmethod
    def network_rule(cls, parameters: RadioModelTable) -> BlockedPairs:
        """Return that the world computes the blocked pairs."""
        return BlockedPairs()
