"""Displacement of the robot since its previous observation, in the body frame of that observation.

The displacement is the straight line between the two poses, not the path between them. The turn is in (-pi, pi]. A
robot's first reading, and the first after it was out of the arena, is zero motion. The noise is Gaussian, on the length
of the displacement and on the turn, independent for each robot and tick. Its variance is (fraction x motion)^2, as of a
badly calibrated wheel, plus motion x (sd per root)^2, as of many small slips. So a robot that stands still has no
noise.
"""

import math
from typing import ClassVar, Final

import numpy as np

from zwerm.maths.angles import wrap
from zwerm.scenario.types import NonNegative, Table
from zwerm.wire.messages import Displacement
from zwerm.world.scene import Floats, Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings, in_body_frames

# Keeps a division by a distance of zero finite.
_TINY: Final = np.finfo(np.float64).tiny


class OdometryTable(Table):
    """The noise: of the distance in 1 and m per root m, of the turn in 1 and rad per root rad."""

    distance_sd_fraction: NonNegative = 0.0
    distance_sd_per_root_m: NonNegative = 0.0
    turn_sd_fraction: NonNegative = 0.0
    turn_sd_per_root_rad: NonNegative = 0.0


class Odometry(Sensor):
    """One displacement for each robot."""

    field: ClassVar[str] = "odometry"
    Parameters: ClassVar[type[Table]] = OdometryTable

    def __init__(self, parameters: OdometryTable, surroundings: Surroundings) -> None:
        self._distance_noise = (parameters.distance_sd_fraction, parameters.distance_sd_per_root_m)
        self._turn_noise = (parameters.turn_sd_fraction, parameters.turn_sd_per_root_rad)
        self._tick = -1  # of the newest reading
        self._known = np.zeros(surroundings.count, dtype=np.bool_)
        self._position = np.zeros((surroundings.count, 2))
        self._heading = np.zeros(surroundings.count)
        # The robots of the newest reading, and their poses before it.
        no_robots = np.zeros(0, dtype=np.int64)
        self._before = (no_robots, self._known[no_robots], self._position[no_robots], self._heading[no_robots])

    def read(self, scene: Scene, robots: Ints) -> list[Displacement]:
        """Return the motion of each of `robots` since it was last read."""
        if scene.tick == self._tick:  # a second reading of the same tick replaces the first
            last, *before = self._before
            self._known[last], self._position[last], self._heading[last] = before
        self._tick = scene.tick
        self._known &= scene.present
        known = self._known[robots]
        position, heading = self._position[robots], self._heading[robots]
        self._before = (robots, known, position, heading)
        if np.count_nonzero(known) < len(robots):
            new = robots[~known]
            self._position[new], self._heading[new], self._known[new] = scene.position[new], scene.heading[new], True
            position, heading = self._position[robots], self._heading[robots]
        here, now = scene.position[robots], scene.heading[robots]
        moved = here - position
        dx, dy = moved[:, 0], moved[:, 1]
        forward, left = in_body_frames(dx, dy, self._heading, robots)
        turn = now - heading
        self._position[robots], self._heading[robots] = here, now
        if any(self._distance_noise) and moved.any():
            distance = np.hypot(dx, dy)
            draw = scene.draws.normal("sensor.odometry.distance", scene.tick, robots)
            # 1 + error / distance, finite also where there was no motion.
            scale = 1.0 + draw * _sd(distance, *self._distance_noise) / np.maximum(distance, _TINY)
            forward, left = forward * scale, left * scale
        if any(self._turn_noise) and turn.any():
            draw = scene.draws.normal("sensor.odometry.turn", scene.tick, robots)
            turn = turn + draw * _sd(np.abs(turn), *self._turn_noise)
        return list(map(Displacement, forward.tolist(), left.tolist(), wrap(turn).tolist()))

    @classmethod
    def rest(cls) -> Displacement:
        """Return no motion."""
        return Displacement(0.0, 0.0, 0.0)

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> Displacement:
        """Return a small random motion."""
        forward, left, turn = random.uniform(-1.0, 1.0, 3).tolist()
        return Displacement(0.01 * forward, 0.01 * left, 0.1 * turn)

    @classmethod
    def extremes(cls) -> Displacement:
        """Return a large motion."""
        return Displacement(-1e3, 1e3, math.pi)


def _sd(motion: Floats, fraction: float, per_root: float) -> Floats:
    sd: Floats = np.sqrt((fraction * motion) ** 2 + per_root**2 * motion)
    return sd
