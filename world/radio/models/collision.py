"""Collision: a receiver loses all transmissions that overlap at its place.

Pure ALOHA (Abramson: The ALOHA system. AFIPS 1970): each transmission starts at a random moment of its tick and lasts
`airtime_s`, or its size at `rate_bytes_s` if that is given. Two that overlap destroy each other wherever the interfering
sender is within `range_m` of the receiver. A robot receives nothing while it transmits (half duplex). With T transmissions a
tick in range the probability of reception is about exp(-2 T airtime_s / dt_s). There is no capture, and no carrier sense. Every
transmission of the tick interferes, also where another model drops its packets.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.types import Positive
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.scene import Bools, Floats, Ints


class CollisionTable(RadioModelTable):
    """The duration of a transmission [s] or its rate [bytes/s], and the range of interference [m]."""

    airtime_s: Positive | None = None
    rate_bytes_s: Positive | None = None
    range_m: Positive | None = None


class Collision(RadioModel):
    """Drops packets that overlap with another transmission at their receiver."""

    cause: ClassVar[str] = "collision"
    memoryless: ClassVar[bool] = True
    Parameters: ClassVar[type[RadioModelTable]] = CollisionTable
    example: ClassVar[Mapping[str, Any]] = {"airtime_s": 0.02}

    def __init__(self, parameters: CollisionTable, context: ModelContext) -> None:
        if (parameters.airtime_s is None) == (parameters.rate_bytes_s is None):
            raise ValueError("expected either airtime_s or rate_bytes_s")
        self._table = parameters
        self._context = context

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Find the transmissions that overlap, then the receivers in range of both."""
        draws, purpose = self._context.draws, self._context.purpose
        start_s = sent.dt_s * draws.uniform(purpose, sent.sender, sent.tick, sent.rank)
        lasts_s = self._airtimes_s(sent)
        first, second = _overlaps(start_s, lasts_s)
        if not len(first):
            return Verdict()
        # The transmissions that overlap with each, as ends in one array.
        order = np.argsort(first, kind="stable")
        first, second = first[order], second[order]
        ends = np.searchsorted(first, np.arange(len(start_s) + 1))
        begin = ends[packets.transmission]
        many = ends[packets.transmission + 1] - begin
        packet = np.repeat(np.arange(len(packets)), many)
        other = second[np.arange(len(packet)) + np.repeat(begin - np.cumsum(many) + many, many)]
        heard = self._hears(sent, packets.receiver[packet], sent.sender[other])
        # Transmissions of one sender never overlap: its radio sends one after the other.
        heard &= sent.sender[packets.transmission[packet]] != sent.sender[other]
        drop = np.zeros(len(packets), dtype=np.bool_)
        drop[packet[heard]] = True
        return Verdict(drop)

    def _airtimes_s(self, sent: Transmissions) -> Floats:
        """Return (t,) the duration of each transmission [s]."""
        if self._table.airtime_s is not None:
            return np.full(len(sent.sender), self._table.airtime_s)
        rate_bytes_s = self._table.rate_bytes_s or math.inf
        lasts_s: Floats = sent.sizes()[: len(sent.sender)] / rate_bytes_s
        return lasts_s

    def _hears(self, sent: Transmissions, receiver: Ints, sender: Ints) -> Bools:
        """Return for each pair whether the receiver is in range of the sender, which may be itself."""
        position = sent.scene.position
        bodies = (receiver < len(position)) & (sender < len(position))
        if self._table.range_m is None:
            return np.ones(len(receiver), dtype=np.bool_)
        offset = position[np.where(bodies, receiver, 0)] - position[np.where(bodies, sender, 0)]
        near: Bools = np.hypot(offset[:, 0], offset[:, 1]) <= self._table.range_m
        return near | ~bodies

    @classmethod
    def network_rule(cls, parameters: CollisionTable) -> None:
        """Raise ValueError: a wired network has no collisions."""
        raise ValueError("cables do not collide")


def _overlaps(start_s: Floats, lasts_s: Floats) -> tuple[Ints, Ints]:
    """Return all ordered pairs (o,), (o,) of transmissions that overlap in time."""
    order = np.argsort(start_s, kind="stable")
    start, end = start_s[order], start_s[order] + lasts_s[order]
    # Each overlaps with the transmissions that start after it and before its end.
    until = np.searchsorted(start, end, side="left")
    many = np.maximum(until - np.arange(len(start)) - 1, 0)
    first = np.repeat(np.arange(len(start)), many)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(many) - many, many)
    a, b = order[first], order[second]
    return np.concatenate([a, b]), np.concatenate([b, a])
