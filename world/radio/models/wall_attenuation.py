"""Wall attenuation: every wall between two robots takes some decibels, by what it is made of.

The multi-wall model of COST 231 (Digital mobile radio towards future generation systems, 1999, section 4.7) without its
floors. Losses are for one wall at 2.4 GHz, about the middle of what is published (COST 231; ITU-R P.2040; ITU-R P.1238).
The arena knows no materials: the walls within a rectangle are given one here, all others have `material`.

Without `margin_db` nothing is dropped: what the walls take is left to a `path_loss` that follows. With it, a packet passes
if the walls take no more than that.
"""

from typing import ClassVar, Final, Literal

import numpy as np
from pydantic import Field

from zwerm.scenario.types import NonNegative, Rectangle, Table
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict
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

# Lines and walls are compared a block at a time: about 1 MB an array.
_PAIRS_MAX: Final = 131_072


class WallRegion(Table):
    """The walls whose middle is in a rectangle [xmin, ymin, xmax, ymax] [m] are of `material`, or take `loss_db` each."""

    rectangle_m: Rectangle
    material: Material = "brick"
    loss_db: NonNegative | None = None


class WallAttenuationTable(LinkTable):
    """What walls are made of, or what each takes [dB], and how much a packet stands [dB]."""

    material: Material = "brick"
    loss_db: NonNegative | None = None
    regions: list[WallRegion] = Field(default=[])
    margin_db: NonNegative | None = None


class WallAttenuation:
    """Attenuates what walls stand in the way of; with a margin, drops what is too weak then."""

    kind: ClassVar[str] = "walls"
    cause: ClassVar[str] = "walls"
    needs_positions: ClassVar[bool] = True
    out_of_reach: ClassVar[bool] = True
    Parameters: ClassVar[type[LinkTable]] = WallAttenuationTable

    def __init__(self, parameters: WallAttenuationTable, place: ModelPlace) -> None:
        self._margin_db = parameters.margin_db
        self._segments = place.arena.segments
        whole = LOSS_DB[parameters.material] if parameters.loss_db is None else parameters.loss_db
        self._loss_db = np.full(len(self._segments), whole)
        x, y = (self._segments[:, 0:2] + self._segments[:, 2:4]).T / 2.0
        for region in parameters.regions:
            xmin, ymin, xmax, ymax = region.rectangle_m
            inside = (xmin <= x) & (x <= xmax) & (ymin <= y) & (y <= ymax)
            self._loss_db[inside] = LOSS_DB[region.material] if region.loss_db is None else region.loss_db
        self._standing = StaticLinkValues(place.links, self._attenuation_db)

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Add up what the walls between take."""
        loss_db = self._standing.between(air.scene, packets)
        if self._margin_db is None:
            return Verdict(attenuation_db=loss_db)
        return Verdict(loss_db > self._margin_db, attenuation_db=loss_db)

    def _attenuation_db(self, start: Floats, end: Floats) -> Floats:
        """Return (k,) what the walls between start (k, 2) and end (k, 2) take [dB]."""
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
        # A wall's second end belongs to its neighbour, so that a line through a corner meets one wall.
        crossed = (side_a * side_b < 0.0) & ((side_p > 0.0) != (side_q > 0.0))
        return np.asarray(crossed @ self._loss_db)
