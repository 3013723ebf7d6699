"""The position and heading of the robot in the frame of the arena, as from a positioning system.

The noise is Gaussian and independent for each tick and robot: `sd_m` in x and in y, `sd_rad` in the heading. For
algorithms that assume localisation.
"""

import math
from typing import ClassVar

import numpy as np

from zwerm.maths.angles import wrap
from zwerm.scenario.types import NonNegative, Table
from zwerm.wire.messages import Pose
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings


class PoseTable(Table):
    """Noise of the pose."""

    sd_m: NonNegative = 0.0
    sd_rad: NonNegative = 0.0


class PoseSensor(Sensor):
    """One pose for each robot."""

    field: ClassVar[str] = "pose"
    Parameters: ClassVar[type[Table]] = PoseTable

    def __init__(self, parameters: PoseTable, surroundings: Surroundings) -> None:
        self._sd_m, self._sd_rad = parameters.sd_m, parameters.sd_rad

    def read(self, scene: Scene, robots: Ints) -> list[Pose]:
        """Return the pose of each of `robots`."""
        x, y = scene.position[robots].T
        heading = scene.heading[robots]
        if self._sd_m > 0.0:
            x = x + self._sd_m * scene.draws.normal("sensor.pose.x", scene.tick, robots)
            y = y + self._sd_m * scene.draws.normal("sensor.pose.y", scene.tick, robots)
        if self._sd_rad > 0.0:
            heading = heading + self._sd_rad * scene.draws.normal("sensor.pose.heading", scene.tick, robots)
        return list(map(Pose, x.tolist(), y.tolist(), wrap(heading).tolist()))

    @classmethod
    def rest(cls) -> Pose:
        """Return the origin."""
        return Pose(0.0, 0.0, 0.0)

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> Pose:
        """Return a random pose."""
        x, y, turn = random.uniform(-1.0, 1.0, 3).tolist()
        return Pose(x, y, math.pi * turn)

    @classmethod
    def extremes(cls) -> Pose:
        """Return a pose far away."""
        return Pose(-1e6, 1e6, math.pi)
