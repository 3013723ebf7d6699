"""Pairs of things, by number."""

from functools import lru_cache

import numpy as np

from zwerm.world.scene import Ints


@lru_cache(maxsize=4)
def every_pair(count: int) -> tuple[Ints, Ints]:
    """Return the two rows of every unordered pair of `count` things, ascending; not to be written to."""
    first, second = np.triu_indices(count, 1)
    return first.astype(np.int64, copy=False), second.astype(np.int64, copy=False)
