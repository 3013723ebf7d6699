"""A 64-bit mix of small numbers, for digests that robots compare (SplitMix64's finaliser; Steele, Lea, Flood 2014)."""

from functools import lru_cache
from typing import Final

_MASK: Final = (1 << 64) - 1


@lru_cache(maxsize=1 << 14)
def mix(*parts: int) -> int:
    """Return 64 bits that depend on all of `parts` (non-negative integers) and their order; never 0."""
    state = 0
    for part in parts:
        z = ((state ^ part) * 0x9E3779B97F4A7C15 + 0x9E3779B97F4A7C15) & _MASK
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
        state = z ^ (z >> 31)
    return state or 1
