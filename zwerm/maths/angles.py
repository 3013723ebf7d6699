"""Angles, in radians."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Just inside the open end of (-pi, pi].
_LEAST_RAD = np.nextafter(-np.pi, 0.0)


def wrap(angle_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the same direction in (-pi, pi], elementwise."""
    # Rounding in np.mod takes an angle just above pi to -pi itself.
    wrapped = np.pi - np.mod(np.pi - np.asarray(angle_rad, dtype=np.float64), 2.0 * np.pi)
    return np.maximum(wrapped, _LEAST_RAD)
