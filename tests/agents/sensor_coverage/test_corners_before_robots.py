"""A walking robot turns round the end of a wall, where a robot comes into sight behind it in the direction of the contact."""

import math
from typing import cast

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.frontier.wall_proof import BLIND_MAX
from zwerm.agents.sensor_coverage.motion.locomotion import Locomotion
from zwerm.agents.sensor_coverage.motion.motion_parameters import RobotParameters
from zwerm.agents.sensor_coverage.motion.odometry_frame import ROBOT_BESIDE_RAD, OdometryFrame, Touched
from zwerm.agents.sensor_coverage.motion.walls.touched_robots import RobotsInReach
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import WallWalk
from zwerm.wire.messages import BodyVelocity

RADIUS_M, REACH_M, STEP_M = 0.07, 0.01, 0.05
SWITCHES = 12
NOISE_RAD = math.pi / 72.0
# The wall fills the quadrant of x < 0 and y < 0. A robot at the first place is visible from the east of x = 0 only, and one at
# the second from everywhere.
BEHIND, NORTH = (0.02, -0.9), (0.3, 0.9)


class AtCorner:
    """A robot that follows the north side of a wall to the east, with the wall at its right, to the corner at (0, 0)."""

    step_m = STEP_M
    radius_m = RADIUS_M
    parameters = RobotParameters()

    def __init__(self, seed: int, noise_rad: float) -> None:
        self._random = np.random.Generator(np.random.Philox(seed))
        self._noise_rad = noise_rad
        # A switch beside the direction of the wall closes, too: the way bends towards the wall by different angles.
        self._turn = self._random.uniform(0.0, math.tau / SWITCHES)
        self.frame = OdometryFrame()
        self.position = -0.3 - self._random.uniform(0.0, STEP_M), RADIUS_M
        self.blind: list[bool] = []
        self._read()

    def velocity(self, x_m: float, y_m: float) -> BodyVelocity:
        """Move, and slide along the wall."""
        x, y = self.position[0] + x_m, self.position[1] + y_m
        near = min(0.0, x), min(0.0, y)
        if near == (x, y):  # inside: the nearest side is that of the step before
            near = (x, 0.0) if self.position[1] > 0.0 else (0.0, y)
            x, y = (x, RADIUS_M) if self.position[1] > 0.0 else (RADIUS_M, y)
        away_m = math.dist(near, (x, y))
        if away_m < RADIUS_M:
            x, y = (each + (at - each) * RADIUS_M / away_m for each, at in zip(near, (x, y), strict=True))
        self.position = x, y
        self._read()
        self.blind.append(not self.frame.contacts)
        return BodyVelocity(x_m, y_m)

    def _read(self) -> None:
        x, y = self.frame.x_m, self.frame.y_m = self.position
        bearing = math.atan2(BEHIND[1] - y, BEHIND[0] - x) + self._random.normal(0.0, self._noise_rad)
        self.frame.seen = {8: math.atan2(NORTH[1] - y, NORTH[0] - x)}
        if x > 0.0 and (y < 0.0 or x > -BEHIND[0] * y / BEHIND[1]):
            self.frame.seen[9] = bearing
        near = min(0.0, x), min(0.0, y)
        self.frame.contacts = ()
        if math.dist(near, (x, y)) <= RADIUS_M + REACH_M:
            width = math.tau / SWITCHES
            switch = round((math.atan2(near[1] - y, near[0] - x) - self._turn) / width) * width + self._turn
            faced = (
                9 in self.frame.seen
                and abs(math.remainder(bearing - switch, math.tau)) < width / 2.0 + ROBOT_BESIDE_RAD
            )
            self.frame.contacts = (Touched(bearing, 9, switch) if faced else Touched(switch, None, switch),)


def longest_blind(seed: int, noise_rad: float) -> int:
    """Return the most steps in a row without a contact, while the robot turns round the corner and drives 0.4 m on."""
    robot = AtCorner(seed, noise_rad)
    walk = WallWalk(cast(Locomotion, robot))
    for _ in walk.along(-1, 1.0, (), (), 0.05):
        if robot.position[1] < -0.4:
            break
    return max(len(run) for run in "".join("b" if each else " " for each in robot.blind).split(" "))


@pytest.mark.parametrize("noise_rad", [0.0, NOISE_RAD])
def test_a_robot_stays_in_touch_at_a_corner_before_a_robot(noise_rad: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the wall would count as followed up to the corner only, and an arc beside it would stay open."""
    seeds = range(60)
    assert max(longest_blind(seed, noise_rad) for seed in seeds) <= BLIND_MAX
    monkeypatch.setattr(RobotsInReach, "steered_by", lambda self, contacts: list(contacts))
    assert max(longest_blind(seed, noise_rad) for seed in seeds) > BLIND_MAX, "the control: a contact with that robot"


def reach_of(
    way: list[tuple[float, float]], robot: tuple[float, float], hidden: int = 0, touched: int = 0
) -> tuple[bool, bool]:
    """Return whether a robot counts as out of reach, and as beyond a wall, at the end of a way.

    It is hidden before the point `hidden`, and in the direction of a contact from the point `touched` on.
    """
    reach = RobotsInReach(RADIUS_M)
    seen = [{} if number < hidden else {9: math.atan2(robot[1] - y, robot[0] - x)} for number, (x, y) in enumerate(way)]
    for number in range(1, len(way)):
        nodes = (9,) if seen[number] and number >= touched else ()
        reach.take(way[number - 1], seen[number - 1], way[number], seen[number], nodes)
    contact = Touched(1.0, 9, 0.9)
    return 9 in reach.out_of_reach, reach.steered_by([contact]) == [Touched(0.9, None, 0.9)]


def test_a_robot_in_touch_is_in_reach() -> None:
    assert reach_of([(-0.1, 0.0), (-0.05, 0.0), (0.0, 0.0)], (0.0, 0.14)) == (False, False)


def test_a_robot_far_away_counts_as_a_wall() -> None:
    assert reach_of([(-0.1, 0.0), (-0.05, 0.0), (0.0, 0.0)], (0.0, 0.8)) == (True, True)


def test_a_robot_that_has_just_come_into_sight_counts_as_a_wall_once() -> None:
    way = [(-0.1, 0.0), (-0.05, 0.0), (0.0, 0.0), (0.05, 0.0)]
    assert reach_of(way[:3], (0.0, 0.14), hidden=2) == (False, True)
    assert reach_of(way, (0.0, 0.14), hidden=2) == (False, False)


def test_several_short_steps_show_a_distance_that_one_does_not() -> None:
    assert reach_of([(-0.02, 0.0), (0.0, 0.0)], (0.0, 0.8)) == (False, False)
    assert reach_of([(-0.06, 0.0), (-0.04, 0.0), (-0.02, 0.0), (0.0, 0.0)], (0.0, 0.8), touched=3) == (False, True)


def test_a_body_that_is_pushed_counts_as_no_wall() -> None:
    """It moves as the walking robot does, and so its bearing stays the same."""
    reach, bearings = RobotsInReach(RADIUS_M), list[float]()
    for number in range(5):
        bearings.append(math.atan2(0.12, 0.12 - 0.05 * number) if number < 3 else bearings[-1])
    for number in range(1, 5):
        before, after = ({9: each} for each in bearings[number - 1 : number + 1])
        nodes = (9,) if number >= 2 else ()
        reach.take((0.05 * (number - 1), 0.0), before, (0.05 * number, 0.0), after, nodes)
    assert reach.out_of_reach == {9}
    assert reach.steered_by([Touched(1.5, 9, 1.4)]) == [Touched(1.5, 9, 1.4)]


def test_no_robot_counts_as_a_wall_for_long() -> None:
    way = [(0.05 * number, 0.0) for number in range(8)]
    assert reach_of(way[:4], (0.2, 0.9)) == (True, True)
    assert reach_of(way, (0.2, 0.9)) == (True, False)
