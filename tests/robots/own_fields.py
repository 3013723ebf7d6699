"""A field as a user would write it."""

import numpy as np

from zwerm.scenario.types import Positive, Table
from zwerm.world.fields import Field


class Waves(Field):
    """A sine along x."""

    class Parameters(Table):
        length_m: Positive

    def __init__(self, length_m):
        self._k = 2.0 * np.pi / length_m

    def value(self, points):
        return np.sin(self._k * points[:, 0])

    def gradient(self, points):
        return np.column_stack([self._k * np.cos(self._k * points[:, 0]), np.zeros(len(points))])
