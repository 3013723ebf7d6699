"""Search trees over points in the plane.

SciPy takes longer to import than a small swarm takes to run, and a small swarm needs no tree. So it is imported with the
first tree, or by `prepare` before a run that needs trees.
"""

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Up to this many robots, all pairs are measured: a search tree costs more.
FEW_ROBOTS: Final = 128


def tree_of(points: NDArray[np.float64]) -> "cKDTree":
    """Return a tree of points (k, 2)."""
    from scipy.spatial import cKDTree

    return cKDTree(points)


def prepare(robots: int) -> None:
    """Import what a swarm of so many robots needs, so that no tick waits for it."""
    if robots > FEW_ROBOTS:
        import scipy.spatial  # noqa: F401
