"""The robot's heading in the frame of the arena: the only sensor that gives all robots a common direction.

The noise is Gaussian and independent for each tick and robot, plus one bias that all share.
"""

import math
from typing import ClassVar

import numpy as np

from zwerm.maths.angles import wrap
from zwerm.scenario.types import Finite, NonNegative, Table
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings


class CompassTable(Table):
    """Noise of the heading."""

    sd_rad: NonNegative = 0.0
    bias_rad: Finite = 0.0


class Compass(Sensor):
    """One heading [rad] in (-pi, pi] for each robot."""

    field: ClassVar[str] = "compass_rad"
    Parameters: ClassVar[type[Table]] = CompassTable

    def __init__(self, parameters: CompassTable, surroundings: Surroundings) -> None:
        self._sd_rad, self._bias_rad = parameters.sd_rad, parameters.bias_rad

    def read(self, scene: Scene, robots: Ints) -> list[float]:
        """Return the heading of each of `robots`."""
        heading = scene.heading[robots] + self._bias_rad
        if self._sd_rad > 0.0:
            heading += self._sd_rad * scene.draws.normal("sensor.compass", scene.tick, robots)
        answer: list[float] = wrap(heading).tolist()
        return answer

    @classmethod
    def rest(cls) -> float:
        """Return a heading of zero."""
        return 0.0

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> float:
        """Return a random heading."""
        return float(random.uniform(-math.pi, math.pi))

    @classmethod
    def extremes(cls) -> float:
        """Return the heading at the cut."""
        return math.pi
