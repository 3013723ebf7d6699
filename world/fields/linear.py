"""A plane."""

from typing import ClassVar

import numpy as np

from zwerm.scenario.types import Finite, Point, Table
from zwerm.world.fields import Field
from zwerm.world.scene import Floats


class LinearTable(Table):
    """The plane."""

    offset: Finite = 0.0
    gradient_per_m: Point


class Linear(Field):
    """A plane: `offset` at the origin, rising by `gradient_per_m`."""

    Parameters: ClassVar[type[Table]] = LinearTable

    def __init__(self, offset: float, gradient_per_m: Point) -> None:
        self._offset, self._gradient = offset, np.array(gradient_per_m)

    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""
        value: Floats = self._offset + points[:, 0] * self._gradient[0] + points[:, 1] * self._gradient[1]
        return value

    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m], the same everywhere."""
        return np.broadcast_to(self._gradient, points.shape)
