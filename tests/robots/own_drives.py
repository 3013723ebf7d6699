"""A drive as a user would write it."""

import numpy as np

from zwerm import Drive, WheelSpeeds


class Tracked(Drive):
    """Two tracks that slip: the turn is a fraction of what the wheels ask for."""

    command = WheelSpeeds
    has_wheels = True

    def velocities(self, commanded):
        tracks = np.clip(commanded, -self.body.max_speed_m_s, self.body.max_speed_m_s)
        left, right = tracks[:, 0], tracks[:, 1]
        return (left + right) / 2.0, None, 0.5 * (right - left) / self.body.wheel_base_m


class NoCommand(Drive):
    """A drive that takes no command."""

    def velocities(self, commanded):
        return commanded[:, 0], None, commanded[:, 0]
