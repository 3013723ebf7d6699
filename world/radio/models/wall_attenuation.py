"""Wall attenuation: every wall between two robots attenuates a packet by some decibels, according to its material.

The multi-wall model of COST 231 (Digital mobile radio towards future generation systems, 1999, section 4.7) without its
floors. Losses are for one wall at 2.4 GHz, near the middle of published values (COST 231; ITU-R P.2040; ITU-R P.1238).
The arena has no materials: `regions` give one to the walls within a rectangle, all others have `material`.

Without `margin_db` the model drops nothing, and a `path_loss` that follows uses the attenuation. With `margin_db`, a
packet passes if the walls attenuate it by at most that.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field

from zwerm.scenario.types import NonNegative, Rectangle, Table
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import BlockedPairs
from zwerm.world.radio.static_links import StaticLinkValues
from zwerm.world.scene import Floats

Material = Literal["plasterboard", "glass", "wood", "brick", "concrete", "metal"]

# One wall at 2.4 GHz [dB].
LOSS_DB: Final[dict[str, float]] = {
    "plasterboard": 3.0,
    "glass": 2.0,
    "wood": 4.0,
    "brick": 8.0,
    "concrete": 15.0,
    "metal": 30.0,
}

# Largest number of (line, wall) pairs to compare at a time: about 1 MB an array.
_PAIRS_MAX: Final = 131_072


class WallRegion(Table):
    """Walls with their middle in a rectangle [xmin, ymin, xmax, ymax] [m] have this `material`, or attenuate by `loss_db`."""

    rectangle_m: Rectangle
    material: Material = "brick"
    loss_db: NonNegative | None = None


class WallAttenuationTable(RadioModelTable):
    """The material of walls or the attenuation of each [dB], and the greatest attenuation of a packet that passes [dB]."""

    material: Material = "brick"
    loss_db: NonNegative | None = None
    regions: list[WallRegion] = Field(default=[])
    margin_db: NonNegative | None = None


class WallAttenuation(RadioModel):
    """Attenuates packets that cross walls; with a margin, drops packets that are attenuated by more."""

    cause: ClassVar[str] = "walls"
    needs_positions: ClassVar[bool] = True
    out_of_reach: ClassVar[bool] = True
    memoryless: ClassVar[bool] = True
    Parameters: ClassVar[type[RadioModelTable]] = WallAttenuationTable
    example: ClassVar[Mapping[str, Any]] = {"material": "glass", "margin_db": 1.0}

    def __init__(self, parameters: WallAttenuationTable, context: ModelContext) -> None:
        self._margin_db = parameters.margin_db
        self._segments = context.arena.segments
        whole = LOSS_DB[parameters.material] if parameters.loss_db is None else parameters.loss_db
        self._loss_db = np.full(len(self._segments), whole)
        x, y = (self._segments[:, 0:2] + self._segments[:, 2:4]).T / 2.0
        for region in parameters.regions:
            xmin, ymin, xmax, ymax = region.rectangle_m
            inside = (xmin <= x) & (x <= xmax) & (ymin <= y) & (y <= ymax)
            self._loss_db[inside] = LOSS_DB[region.material] if region.loss_db is None else region.loss_db
        self._standing = StaticLinkValues(context.links, self._attenuation_db)

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Add the attenuation of all walls between both nodes."""
        loss_db = self._standing.between(sent.scene, packets)
        if self._margin_db is None:
            return Verdict(attenuation_db=loss_db)
        return Verdict(loss_db > self._margin_db, attenuation_db=loss_db)

    def _attenuation_db(self, start: Floats, end: Floats) -> Floats:
        """Return (k,) the attenuation by walls between start (k, 2) and end (k, 2) [dB]."""
        if not len(self._segments):
            return np.zeros(len(start))
        block = max(1, _PAIRS_MAX // len(self._segments))
        parts = [self._block_db(start[at : at + block], end[at : at + block]) for at in range(0, len(start), block)]
        return np.concatenate(parts)

    def _block_db(self, start: Floats, end: Floats) -> Floats:
        px, py, qx, qy = self._segments.T
        (ax, ay), (bx, by) = start.T[:, :, None], end.T[:, :, None]
        side_p = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
        side_q = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
        side_a = (qx - px) * (ay - py) - (qy - py) * (ax - px)
        side_b = (qx - px) * (by - py) - (qy - py) * (bx - px)
        # The second end of a wall belongs to the next wall, so that a line through a corner crosses one wall.
        crossed = (side_a * side_b < 0.0) & ((side_p > 0.0) != (side_q > 0.0))
        return np.asarray(crossed @ self._loss_db)

    @classmethod
    def network_rule(cls, parameters: WallAttenuationTable) -> BlockedPairs:
        """Return that the world computes the blocked pairs. Raises ValueError without a margin."""
        if parameters.margin_db is None:
            raise ValueError("without margin_db nothing is dropped")
        return BlockedPairs()
