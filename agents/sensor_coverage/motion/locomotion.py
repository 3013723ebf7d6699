"""The state that all drives of one robot share: odometry, averaged bearings, their noise, and the point of rest.

A drive is a generator that yields one velocity a tick. It decides from local readings only: bearings, touch and
odometry. The robot never turns on purpose, and its frame is its own.
"""

import math
from collections.abc import Callable, Generator
from typing import Final

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.frontier.directions import DISPLACED_M_MIN
from zwerm.agents.sensor_coverage.motion.homing import Vector, slide
from zwerm.agents.sensor_coverage.motion.motion_parameters import RobotParameters
from zwerm.agents.sensor_coverage.motion.odometry_frame import OdometryFrame
from zwerm.wire.messages import BodyVelocity

STOP: Final = BodyVelocity()

Drive = Generator[BodyVelocity, None, None]

# Bearings with a standard deviation below this [rad] count as exact.
EXACT_RAD = 1e-5
# A robot that was pushed this far [m] sees the walls close to it in other directions.
FAR_M: Final = 0.05
# Ticks that a displaced robot may take to return before it reports: a scan waits for it.
RETURN_TICKS_MAX = 20


class Locomotion:
    """Readings and means of driving of one robot.

    `rest` is the point where the robot must stand, in its odometry frame, or None if it never drove. `pushed` is the way [m] by
    which other robots have pushed it away for good since.
    `bearing_noise_rad` is the standard deviation of a bearing, which the robot measures itself, or None before that.
    """

    def __init__(self, parameters: RobotParameters, setup: Setup) -> None:
        self.parameters = parameters
        self.hop_m = parameters.link_m - parameters.margin_m
        self.step_m = setup.body.max_speed_m_s * setup.dt_s if setup.body is not None else 0.0
        self.radius_m = setup.body.radius_m if setup.body is not None else 0.0
        self.frame = OdometryFrame()
        self.rest: Vector | None = None
        self.pushed: Vector = 0.0, 0.0
        self.bearing_noise_rad: float | None = None
        self._dt_s = setup.dt_s

    @property
    def position(self) -> Vector:
        """Position [m] by odometry."""
        return self.frame.x_m, self.frame.y_m

    @property
    def samples(self) -> int:
        """Number of readings in an average: one is enough if bearings are exact."""
        if self.bearing_noise_rad is None:
            return int(self.parameters.first_samples)
        return int(self.parameters.samples) if self.bearing_noise_rad > EXACT_RAD else 1

    def velocity(self, x_m: float, y_m: float) -> BodyVelocity:
        """Return the velocity that moves the robot by (x, y) [m] within one tick, or as far as its speed allows."""
        length = math.hypot(x_m, y_m)
        scale = min(1.0, self.step_m / length) / self._dt_s if length > 0.0 else 0.0
        cos, sin = math.cos(self.frame.turned_rad), math.sin(self.frame.turned_rad)
        return BodyVelocity((cos * x_m + sin * y_m) * scale, (cos * y_m - sin * x_m) * scale)

    def settle(self) -> None:
        """End a drive: the robot rests here, and earlier averages no longer hold."""
        self.frame.forget()
        self.rest, self.pushed = self.position, (0.0, 0.0)

    def rest_at(self, rest: Vector, on_far: Callable[[], None] | None = None) -> None:
        """Rest at a point to which other robots have pushed this one.

        Call `on_far`, if given, if they have pushed it so far that it sees other walls close by, and count anew.
        """
        x_m, y_m = rest if self.rest is None else self.rest
        self.rest, self.pushed = rest, (self.pushed[0] + rest[0] - x_m, self.pushed[1] + rest[1] - y_m)
        if on_far is not None and math.hypot(*self.pushed) > FAR_M:
            self.pushed = 0.0, 0.0
            on_far()

    def average(self, enough: Callable[[int], bool]) -> Drive:
        """Stand still and average bearings until `enough(samples)` holds, or for twice as many ticks as samples."""
        samples = self.samples
        for _ in range(2 * samples):
            self.frame.average()
            if enough(samples):
                break
            yield STOP
        if self.bearing_noise_rad is None:
            self.bearing_noise_rad = self.frame.spread()

    def drive_to(self, goal: Vector, near_m: float | None = None, ticks_max: int | None = None) -> Drive:
        """Drive by odometry until the robot is within `near_m` of a point of its frame, or for `ticks_max`."""
        near_m = self.parameters.tolerance_m if near_m is None else near_m
        for _ in range(self.parameters.drive_ticks_max if ticks_max is None else ticks_max):
            dx, dy = goal[0] - self.frame.x_m, goal[1] - self.frame.y_m
            if math.hypot(dx, dy) < near_m:
                return
            yield self.velocity(dx, dy)

    def is_displaced(self) -> bool:
        """Return whether another robot has pushed this one away from its point of rest."""
        if self.rest is None:
            return False
        away_m = math.hypot(self.frame.x_m - self.rest[0], self.frame.y_m - self.rest[1])
        return away_m > 2.0 * self.parameters.tolerance_m

    def return_to_rest(
        self, rest: Vector, on_displaced: Callable[[], None] = lambda: None
    ) -> Generator[BodyVelocity, None, Vector]:
        """Drive back to the point of rest if the robot was displaced; return the new point of rest, if a wall is there.

        Call `on_displaced` once if the robot is so far away that it does not see what it saw there.
        """
        is_known = False
        tolerance_m = self.parameters.tolerance_m
        for _ in range(RETURN_TICKS_MAX):
            dx, dy = rest[0] - self.frame.x_m, rest[1] - self.frame.y_m
            if math.hypot(dx, dy) < tolerance_m:
                return rest
            if math.hypot(dx, dy) > DISPLACED_M_MIN and not is_known:
                is_known = True
                on_displaced()
            dx, dy = slide(dx, dy, self.frame.touched)
            if math.hypot(dx, dy) < tolerance_m:
                break
            yield self.velocity(dx, dy)
        return self.position
