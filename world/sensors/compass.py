"""The robot's heading in the frame of the arena: the one sensor that lets robots agree on a direction.

The noise is Gaussian and independent for each tick and robot, plus one bias that all share.
"""

from typing import ClassVar

from zwerm.maths.angles import wrap
from zwerm.scenario.tables import Finite, NonNegative, Table
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Surroundings


class CompassTable(Table):
    """How well the heading is known."""

    sd_rad: NonNegative = 0.0
    bias_rad: Finite = 0.0


class Compass:
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
