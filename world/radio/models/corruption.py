"""Bit corruption: every bit of a payload is flipped with the same probability, independently (binary symmetric channel).

A damaged packet is delivered: the decoder of the receiver has to refuse it. The position of the first error is geometric,
and so is every gap to the next.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from zwerm.maths.keyed_random import splitmix64, unit
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict


class CorruptionTable(RadioModelTable):
    """The probability that a bit is flipped."""

    bit_error_rate: Annotated[float, Field(ge=0, lt=1)]


class Corruption(RadioModel):
    """Flips bits of payloads; drops nothing."""

    memoryless: ClassVar[bool] = True
    Parameters: ClassVar[type[RadioModelTable]] = CorruptionTable
    example: ClassVar[Mapping[str, Any]] = {"bit_error_rate": 0.02}

    def __init__(self, parameters: CorruptionTable, context: ModelContext) -> None:
        self._rate = parameters.bit_error_rate
        self._random = context.link_random()

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Choose the position of the first error of every packet, and damage packets that are longer than that."""
        if not self._rate:
            return Verdict()
        bits = 8 * sent.sizes()[packets.payload]
        words = self._random.words(packets.link, packets.key)
        # P(no error in m bits) = (1 - rate)^m
        damaged = np.flatnonzero(unit(words) < -np.expm1(bits * math.log1p(-self._rate)))
        if not len(damaged):
            return Verdict()
        payload = packets.payload.copy()
        for row in damaged.tolist():
            clean = sent.payloads[payload[row]]
            payload[row] = len(sent.payloads)
            sent.payloads.append(self._damage(clean, words[row : row + 1]))
        return Verdict(payload=payload)

    def _damage(self, payload: bytes, word: NDArray[np.uint64]) -> bytes:
        """Return `payload` with flipped bits, at least the one that `word` chooses."""
        flipped = bytearray(payload)
        bit = -1
        while (bit := bit + 1 + self._gap(word)) < 8 * len(payload):
            flipped[bit >> 3] ^= 1 << (bit & 7)
            word = splitmix64(word)
        return bytes(flipped)

    def _gap(self, word: NDArray[np.uint64]) -> int:
        """Return the number of correct bits before the next error."""
        return int(min(math.log1p(-float(unit(word)[0])) / math.log1p(-self._rate), 2.0**40))

    @classmethod
    def network_rule(cls, parameters: CorruptionTable) -> None:
        """Raise ValueError: a kernel drops damaged packets."""
        raise ValueError("the kernel drops packets with a wrong checksum")
