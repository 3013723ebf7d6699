"""Unordered pairs of indices."""

from functools import lru_cache

import numpy as np

from zwerm.world.scene import Ints


@lru_cache(maxsize=4)
def every_pair(count: int) -> tuple[Ints, Ints]:
    """Return the first and second index of every pair of `count` items, ascending. The arrays are shared: do not write."""
    first, second = np.triu_indices(count, 1)
    return first.astype(np.int64, copy=False), second.astype(np.int64, copy=False)
