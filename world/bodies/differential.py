"""Differential drive: two wheels, each with a ground speed of its own."""

from typing import ClassVar

import numpy as np

from zwerm.wire.messages import BodyVelocity, WheelSpeeds
from zwerm.world.bodies import Drive, Velocities
from zwerm.world.scene import Floats


class Differential(Drive):
    """Clamps each wheel to `max_speed_m_s`; the turn follows from the wheel base."""

    command: ClassVar[type[BodyVelocity] | type[WheelSpeeds]] = WheelSpeeds
    has_wheels: ClassVar[bool] = True
    memoryless: ClassVar[bool] = True

    def velocities(self, commanded: Floats) -> Velocities:
        """Return forward speed and turn of (n, 2) wheel speeds, left and right [m/s]."""
        limit = self.body.max_speed_m_s
        wheels = np.minimum(np.maximum(commanded, -limit), limit)
        left, right = wheels[:, 0], wheels[:, 1]
        return (left + right) * 0.5, None, (right - left) / self.body.wheel_base_m
