"""Angles, in radians."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def wrap(angle_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the same direction in (-pi, pi], elementwise."""
    return np.pi - np.mod(np.pi - np.asarray(angle_rad, dtype=np.float64), 2.0 * np.pi)
