"""Bit corruption: every bit of a payload is flipped with the same probability, independently (binary symmetric channel).

A damaged packet is delivered: the receiver's decoder has to refuse it. Where the first error falls is geometric, and so is
every gap to the next; only packets with an error are looked at twice.
"""

import math
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from zwerm.maths.keyed_random import splitmix64, unit
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict


class CorruptionTable(LinkTable):
    """The probability that a bit is flipped."""

    bit_error_rate: Annotated[float, Field(ge=0, lt=1)]


class Corruption:
    """Flips bits of payloads; drops nothing."""

    kind: ClassVar[str] = "corruption"
    cause: ClassVar[str] = "corruption"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = CorruptionTable

    def __init__(self, parameters: CorruptionTable, place: ModelPlace) -> None:
        self._rate = parameters.bit_error_rate
        self._draws = place.link_draws()

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Draw where the first error of every packet falls, and damage those in which it does."""
        if not self._rate:
            return Verdict()
        bits = 8 * air.sizes()[packets.payload]
        words = self._draws.words(packets.link, packets.key)
        # P(no error in m bits) = (1 - rate)^m
        damaged = np.flatnonzero(unit(words) < -np.expm1(bits * math.log1p(-self._rate)))
        if not len(damaged):
            return Verdict()
        payload = packets.payload.copy()
        for row in damaged.tolist():
            sent = air.payloads[payload[row]]
            payload[row] = len(air.payloads)
            air.payloads.append(self._damage(sent, words[row : row + 1]))
        return Verdict(payload=payload)

    def _damage(self, payload: bytes, word: NDArray[np.uint64]) -> bytes:
        """Return `payload` with at least the bit flipped that `word` chooses."""
        flipped = bytearray(payload)
        bit = -1
        while (bit := bit + 1 + self._gap(word)) < 8 * len(payload):
            flipped[bit >> 3] ^= 1 << (bit & 7)
            word = splitmix64(word)
        return bytes(flipped)

    def _gap(self, word: NDArray[np.uint64]) -> int:
        """Return how many bits stay whole before the next error."""
        return int(min(math.log1p(-float(unit(word)[0])) / math.log1p(-self._rate), 2.0**40))
