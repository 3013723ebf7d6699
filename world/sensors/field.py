"""The scalar field where the robot stands: its value, and its gradient in the body frame.

The noise is Gaussian and independent for each tick and robot: `sd` of the value in the field's own unit,
`gradient_sd_per_m` of either part of the gradient. Robots neither cast shadows in the field nor change it.
"""

from typing import ClassVar

import numpy as np

from zwerm.scenario.types import NonNegative, Table
from zwerm.wire.messages import FieldSample
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings, in_body_frames


class FieldTable(Table):
    """Noise of the sensed field."""

    sd: NonNegative = 0.0
    gradient_sd_per_m: NonNegative = 0.0


class FieldSensor(Sensor):
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
        value, gradient = self._field.sample(here)
        along_x, along_y = gradient.T
        forward, left = in_body_frames(along_x, along_y, scene.heading, robots)
        if self._sd > 0.0:
            value = value + self._sd * scene.draws.normal("sensor.field.value", scene.tick, robots)
        if self._gradient_sd_per_m > 0.0:
            forward = forward + self._gradient_sd_per_m * scene.draws.normal("sensor.field.x", scene.tick, robots)
            left = left + self._gradient_sd_per_m * scene.draws.normal("sensor.field.y", scene.tick, robots)
        return list(map(FieldSample, value.tolist(), forward.tolist(), left.tolist()))

    @classmethod
    def rest(cls) -> FieldSample:
        """Return a field of zero."""
        return FieldSample(0.0, 0.0, 0.0)

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> FieldSample:
        """Return a random sample."""
        return FieldSample(*random.uniform(-1.0, 1.0, 3).tolist())

    @classmethod
    def extremes(cls) -> FieldSample:
        """Return a large sample."""
        return FieldSample(1e6, -1e6, 0.0)
