"""Keyed random numbers: a draw is a function of (seed, purpose, ids), and independent of the number of draws before it.

An additional robot, sensor or fault changes no other draw, and neither does the order of draws. The counter-based
generator is the finaliser of SplitMix64 (Steele, Lea, Flood 2014), chained over the parts of the key and vectorised
over arrays of ids. Controllers receive a numpy Generator over Philox, keyed in the same way. It is not fit for
cryptography.
"""

from collections.abc import Sequence
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_ONE = np.uint64(1)
_TO_UNIT = 2.0**-53
_WORD = 2**64 - 1
# Up to this many words are computed one by one, without the overhead of arrays.
_FEW_WORDS = 8
_GOLDEN_INT, _MIX_1_INT, _MIX_2_INT = int(_GOLDEN), int(_MIX_1), int(_MIX_2)


def splitmix64(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return SplitMix64's output for each state: the finaliser applied to state + golden gamma."""
    z = state + _GOLDEN
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


def _mixed(state: int) -> int:
    """Return what `splitmix64` returns, for one state."""
    z = (state + _GOLDEN_INT) & _WORD
    z = ((z ^ (z >> 30)) * _MIX_1_INT) & _WORD
    z = ((z ^ (z >> 27)) * _MIX_2_INT) & _WORD
    return z ^ (z >> 31)


def key_part(part: ArrayLike) -> NDArray[np.uint64]:
    """Return one part of a key (non-negative integers) as the words that are mixed into the state."""
    return splitmix64(np.atleast_1d(np.asarray(part, dtype=np.uint64)) * _GOLDEN)


def unit(words: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Return the 64-bit words as numbers in [0, 1)."""
    return (words >> _S11).astype(np.float64) * _TO_UNIT


def gaussian(words: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Return the 64-bit words as standard normal numbers (Box and Muller 1958)."""
    # The first number is in (0, 1], so that the logarithm is finite.
    return _normal(np.asarray(((words >> _S11) + _ONE) * _TO_UNIT, np.float64), unit(splitmix64(words)))


def _normal(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    draw: NDArray[np.float64] = np.sqrt(-2.0 * np.log(first)) * np.cos(2.0 * np.pi * second)
    return draw


class Draws:
    """The random numbers of one run."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self._roots: dict[str, int] = {}

    def _digest(self, purpose: str, *ids: int) -> bytes:
        key = f"{self.seed}/{purpose}/{'/'.join(map(str, ids))}"
        return blake2b(key.encode(), digest_size=16, person=b"zwerm-draws").digest()

    def states(self, purpose: str, *ids: ArrayLike) -> NDArray[np.uint64]:
        """Return the states of the chain after `ids`, at least one-dimensional, for many draws with a common head of
        the key.

        `splitmix64(splitmix64(states(purpose, a) ^ key_part(b)))` is `bits(purpose, a, b)`.
        """
        # Single numbers at the head of the key, such as the tick, are mixed without the overhead of arrays.
        head = next((at for at, part in enumerate(ids) if type(part) is not int), len(ids))
        state = np.array([self._head(purpose, ids[:head])], dtype=np.uint64)
        for each in ids[head:]:
            state = splitmix64(state ^ key_part(each))
        return state

    def _head(self, purpose: str, ids: Sequence[Any]) -> int:
        """Return the state of the chain after single numbers."""
        word = self._roots.get(purpose)
        if word is None:
            word = self._roots[purpose] = int.from_bytes(self._digest(purpose)[:8], "little")
        for part in ids:
            if part < 0:
                raise OverflowError(f"expected a non-negative id, got {part}")
            word = _mixed(word ^ _mixed(part * _GOLDEN_INT & _WORD))
        return word

    def _few(self, purpose: str, ids: Sequence[Any]) -> list[int] | None:
        """Return the words for a key that ends with a short array of ids, after single numbers; None for any other
        key."""
        if not ids:
            return None
        *first, last = ids
        if type(last) is not np.ndarray or last.ndim != 1 or last.size > _FEW_WORDS:
            return None
        if any(type(part) is not int for part in first):
            return None
        head = self._head(purpose, first)
        return [_mixed(_mixed(head ^ _mixed(int(each) * _GOLDEN_INT & _WORD))) for each in last.tolist()]

    def bits(self, purpose: str, *ids: ArrayLike) -> NDArray[np.uint64]:
        """Return one 64-bit word per broadcast element of `ids` (non-negative integers)."""
        few = self._few(purpose, ids)
        if few is not None:
            return np.array(few, dtype=np.uint64)
        shape = np.broadcast_shapes(*(np.shape(part) for part in ids))
        return splitmix64(self.states(purpose, *ids)).reshape(shape)

    def uniform(self, purpose: str, *ids: ArrayLike) -> NDArray[np.float64]:
        """Return draws in [0, 1), one per broadcast element of `ids`."""
        return unit(self.bits(purpose, *ids))

    def normal(self, purpose: str, *ids: ArrayLike) -> NDArray[np.float64]:
        """Return standard normal draws, one per broadcast element of `ids`."""
        few = self._few(purpose, ids)
        if few is not None:
            return _normal(
                np.array([((word >> 11) + 1) * _TO_UNIT for word in few]),
                np.array([(_mixed(word) >> 11) * _TO_UNIT for word in few]),
            )
        draw = gaussian(np.atleast_1d(self.bits(purpose, *ids)))
        return draw.reshape(np.broadcast_shapes(*(np.shape(part) for part in ids)))

    def stream_key(self, purpose: str, *ids: int) -> bytes:
        """Return the 16-byte key of a separate stream, which another process may use."""
        return self._digest(purpose, *ids)

    def generator(self, purpose: str, *ids: int) -> np.random.Generator:
        """Return a separate numpy Generator for this purpose and these ids."""
        return stream(self.stream_key(purpose, *ids))


def stream(key: bytes) -> np.random.Generator:
    """Return the numpy Generator over Philox with this key (16 bytes)."""
    return np.random.Generator(np.random.Philox(key=np.frombuffer(key, dtype="<u8")))
