"""The scalar field where the robot stands: its value, and its gradient in the body frame.

The noise is Gaussian and independent for each tick and robot: `sd` of the value in the field's own unit,
`gradient_sd_per_m` of either part of the gradient. Robots neither cast shadows in the field nor change it.
"""

from typing import ClassVar

import numpy as np

from zwerm.protocol import FieldSample
from zwerm.scenario import NonNegative, Table
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Surroundings


class FieldTable(Table):
    """How well the field is sensed."""

    sd: NonNegative = 0.0
    gradient_sd_per_m: NonNegative = 0.0


class FieldSensor:
    """One sample of the field for each robot."""

    field: ClassVar[str] = "field"
    Parameters: ClassVar[type[Table]] = FieldTable

    def __init__(self, parameters: FieldTable, surroundings: Surroundings) -> None:
        if surroundings.field is None:
            raise ValueError("the field sensor needs a field, and the scenario has none")
        self._sd, self._gradient_sd_per_m = parameters.sd, parameters.gradient_sd_per_m
        self._field = surroundings.field

    def read(self, scene: Scene, robots: Ints) -> list[FieldSample]:
        """Return what each of `robots` senses of the field."""
        here = scene.position[robots]
        value = self._field.value(here)
        gx, gy = self._field.gradient(here).T
        cos, sin = np.cos(scene.heading[robots]), np.sin(scene.heading[robots])
        forward, left = cos * gx + sin * gy, cos * gy - sin * gx
        if self._sd > 0.0:
            value = value + self._sd * scene.draws.normal("sensor.field.value", scene.tick, robots)
        if self._gradient_sd_per_m > 0.0:
            forward += self._gradient_sd_per_m * scene.draws.normal("sensor.field.x", scene.tick, robots)
            left += self._gradient_sd_per_m * scene.draws.normal("sensor.field.y", scene.tick, robots)
        return list(map(FieldSample, value.tolist(), forward.tolist(), left.tolist()))
