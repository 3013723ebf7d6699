"""A lamp above the floor."""

from typing import ClassVar

import numpy as np

from zwerm.scenario.types import Finite, Point, Positive, Table
from zwerm.world.fields import Field
from zwerm.world.scene import Floats


class LampTable(Table):
    """The lamp."""

    peak: Finite
    center_m: Point
    height_m: Positive


class Lamp(Field):
    """The light of a lamp `height_m` above `center_m`, on a sensor on the floor that faces the lamp.

    The value is `peak` directly below the lamp, and falls with the square of the distance from the lamp.
    """

    Parameters: ClassVar[type[Table]] = LampTable

    def __init__(self, peak: float, center_m: Point, height_m: float) -> None:
        self._peak, self._center, self._height2 = peak, np.array(center_m), height_m**2

    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""
        apart = points - self._center
        value: Floats = self._peak * self._height2 / (self._height2 + np.square(apart).sum(axis=1))
        return value

    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m] at points (k, 2) [m]."""
        apart = points - self._center
        distance2 = self._height2 + np.square(apart).sum(axis=1)
        gradient: Floats = (-2.0 * self._peak * self._height2 / distance2**2)[:, None] * apart
        return gradient
