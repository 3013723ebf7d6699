"""Holonomic drive: the body moves in any direction and turns independently."""

from typing import ClassVar

import numpy as np

from zwerm.wire.messages import BodyVelocity, WheelSpeeds
from zwerm.world.bodies import Drive, Velocities
from zwerm.world.scene import Floats


class Holonomic(Drive):
    """Scales the velocity to `max_speed_m_s`, keeping its direction, and clamps the turn to `max_turn_rad_s`."""

    command: ClassVar[type[BodyVelocity] | type[WheelSpeeds]] = BodyVelocity
    memoryless: ClassVar[bool] = True

    def velocities(self, commanded: Floats) -> Velocities:
        """Return the velocities of (n, 3) commands: forward [m/s], left [m/s], turn [rad/s]."""
        speed = np.hypot(commanded[:, 0], commanded[:, 1])
        scale = np.minimum(1.0, self.body.max_speed_m_s / np.maximum(speed, 1e-300))
        turn = np.minimum(np.maximum(commanded[:, 2], -self.body.max_turn_rad_s), self.body.max_turn_rad_s)
        return commanded[:, 0] * scale, commanded[:, 1] * scale, turn
