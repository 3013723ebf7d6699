"""Collision: a receiver that hears two transmissions at once understands neither.

Pure ALOHA (Abramson: The ALOHA system. AFIPS 1970): each transmission starts at a random moment of its tick and lasts
`airtime_s`, or its size at `rate_bytes_s` if that is given. Two that overlap destroy each other wherever the interfering
sender is within `range_m` of the receiver; a robot that transmits itself at that time hears nothing (half duplex). With T
transmissions a tick in range the chance to get through is about exp(-2 T airtime_s / dt_s). There is no capture, and no
carrier sense. Every transmission of the tick interferes, also where another model drops its packets.
"""

import math
from typing import ClassVar

import numpy as np

from zwerm.scenario.types import Positive
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict
from zwerm.world.scene import Bools, Floats, Ints


class CollisionTable(LinkTable):
    """How long a transmission lasts [s], or the rate it is sent at [bytes/s]; how far it interferes [m]."""

    airtime_s: Positive | None = None
    rate_bytes_s: Positive | None = None
    range_m: Positive | None = None


class Collision:
    """Drops what another transmission overlaps where it is received."""

    kind: ClassVar[str] = "collision"
    cause: ClassVar[str] = "collision"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = CollisionTable

    def __init__(self, parameters: CollisionTable, place: ModelPlace) -> None:
        if (parameters.airtime_s is None) == (parameters.rate_bytes_s is None):
            raise ValueError("expected either airtime_s or rate_bytes_s")
        self._table = parameters
        self._place = place

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Find the transmissions that overlap, and then the receivers that hear both."""
        draws, purpose = self._place.draws, self._place.purpose
        start_s = air.dt_s * draws.uniform(purpose, air.sender, air.tick, air.rank)
        lasts_s = self._airtimes_s(air)
        first, second = _overlaps(start_s, lasts_s)
        if not len(first):
            return Verdict()
        # For every transmission those that overlap it, as ends in one array.
        order = np.argsort(first, kind="stable")
        first, second = first[order], second[order]
        ends = np.searchsorted(first, np.arange(len(start_s) + 1))
        begin = ends[packets.transmission]
        many = ends[packets.transmission + 1] - begin
        packet = np.repeat(np.arange(len(packets)), many)
        other = second[np.arange(len(packet)) + np.repeat(begin - np.cumsum(many) + many, many)]
        heard = self._hears(air, packets.receiver[packet], air.sender[other])
        # A sender's own transmissions wait for each other.
        heard &= air.sender[packets.transmission[packet]] != air.sender[other]
        drop = np.zeros(len(packets), dtype=np.bool_)
        drop[packet[heard]] = True
        return Verdict(drop)

    def _airtimes_s(self, air: Air) -> Floats:
        """Return (t,) how long each transmission lasts [s]."""
        if self._table.airtime_s is not None:
            return np.full(len(air.sender), self._table.airtime_s)
        rate_bytes_s = self._table.rate_bytes_s or math.inf
        lasts_s: Floats = air.sizes()[: len(air.sender)] / rate_bytes_s
        return lasts_s

    def _hears(self, air: Air, receiver: Ints, sender: Ints) -> Bools:
        """Tell of each pair whether the receiver hears the sender, be it itself."""
        position = air.scene.position
        bodies = (receiver < len(position)) & (sender < len(position))
        if self._table.range_m is None:
            return np.ones(len(receiver), dtype=np.bool_)
        offset = position[np.where(bodies, receiver, 0)] - position[np.where(bodies, sender, 0)]
        near: Bools = np.hypot(offset[:, 0], offset[:, 1]) <= self._table.range_m
        return near | ~bodies


def _overlaps(start_s: Floats, lasts_s: Floats) -> tuple[Ints, Ints]:
    """Return all ordered pairs (o,), (o,) of transmissions that overlap in time."""
    order = np.argsort(start_s, kind="stable")
    start, end = start_s[order], start_s[order] + lasts_s[order]
    # Each overlaps those that start after it and before it ends.
    until = np.searchsorted(start, end, side="left")
    many = np.maximum(until - np.arange(len(start)) - 1, 0)
    first = np.repeat(np.arange(len(start)), many)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(many) - many, many)
    a, b = order[first], order[second]
    return np.concatenate([a, b]), np.concatenate([b, a])
