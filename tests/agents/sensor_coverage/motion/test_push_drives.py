"""Drives of a push beside obstacles: the robot reaches its slot past a corner, and stays close to one that it cannot reach."""

import math
from typing import Final

import pytest
import shapely

from zwerm.agents.runtime.contract import Body, Setup
from zwerm.agents.sensor_coverage.messages.commands import Landmark
from zwerm.agents.sensor_coverage.motion.locomotion import Locomotion
from zwerm.agents.sensor_coverage.motion.motion_parameters import RobotParameters
from zwerm.agents.sensor_coverage.motion.odometry_frame import Touched
from zwerm.agents.sensor_coverage.motion.push_drives import DriveToResult, drive_back, move, regain
from zwerm.agents.sensor_coverage.motion.trail import Trail
from zwerm.wire.messages import BodyVelocity

RADIUS_M: Final = 0.07
SWITCH_RAD: Final = math.tau / 12
# A switch is closed by a wall in a direction within this angle [rad].
CLOSED_RAD: Final = math.radians(25.0)
START: Final = 1.58, 1.58
STOPPED: Final = 1.37, 2.0
GOAL: Final = 1.3, 2.48
CORNER: Final = shapely.Polygon([(1.34, 2.12), (1.07, 1.84), (0.5, 1.84), (0.5, 2.6), (1.08, 2.36)])
ROBOTS: Final = {8: (1.47, 3.36), 9: (1.83, 2.33), 13: START}


class BesideCorner(Locomotion):
    """A robot without noise of odometry, among robots that stand, beside a thing that its body does not pass.

    `at` is its true position [m]. Its switches are turned by `switches_rad`.
    """

    def __init__(
        self, thing: shapely.Polygon, noise_rad: float, switches_rad: float, at: tuple[float, float] = START
    ) -> None:
        body = Body("holonomic", RADIUS_M, 0.5, 0.0)
        super().__init__(RobotParameters(), Setup(1, "robot", 0.1, ("bearings",), b"", body))
        self.bearing_noise_rad = noise_rad
        self.at = at
        self._thing = thing
        self._switches_rad = switches_rad
        self._read()

    def go(self, velocity: BodyVelocity) -> None:
        """Move for one tick."""
        x, y = (self.at[0] + 0.1 * velocity.forward_m_s, self.at[1] + 0.1 * velocity.left_m_s)
        nearest = self._nearest((x, y))
        apart_m = math.dist((x, y), nearest)
        if apart_m < RADIUS_M:
            x, y = (c + (each - c) * RADIUS_M / apart_m for c, each in zip(nearest, (x, y), strict=True))
        self.frame.x_m += x - self.at[0]
        self.frame.y_m += y - self.at[1]
        self.at = x, y
        self._read()

    def _read(self) -> None:
        self.frame.seen = {
            node: bearing(self.at, there) for node, there in ROBOTS.items() if math.dist(self.at, there) < 1.0
        }
        nearest = self._nearest(self.at)
        normal_rad = bearing(self.at, nearest)
        is_near = math.dist(self.at, nearest) < RADIUS_M + 0.01
        switches = (self._switches_rad + number * SWITCH_RAD for number in range(12))
        self.frame.touched = tuple(
            each for each in switches if is_near and abs(math.remainder(each - normal_rad, math.tau)) < CLOSED_RAD
        )
        self.frame.contacts = tuple(Touched(each, None) for each in self.frame.touched)

    def _nearest(self, here: tuple[float, float]) -> tuple[float, float]:
        there = shapely.shortest_line(self._thing, shapely.Point(here)).coords[0]
        return float(there[0]), float(there[1])


def bearing(here: tuple[float, float], there: tuple[float, float]) -> float:
    return math.atan2(there[1] - here[1], there[0] - here[0])


def end_of_move(robot: BesideCorner, hop_m: float) -> tuple[float, float]:
    """Return the place [m] where a move to the goal ends, `hop_m` away by the memory of the slot."""
    landmarks = [Landmark(node, bearing(GOAL, there), True) for node, there in ROBOTS.items()]
    for velocity in move(robot, bearing(START, GOAL), hop_m, landmarks):
        robot.go(velocity)
    return robot.at


@pytest.mark.parametrize("switches_deg", [0.0, 25.0])
def test_a_robot_that_a_corner_stops_passes_it_on_its_straight_way(switches_deg: float) -> None:
    """The bearings alone lead it to the wall beside the corner."""
    robot = BesideCorner(CORNER, 0.0, math.radians(switches_deg))
    assert math.dist(end_of_move(robot, math.dist(START, GOAL)), GOAL) < 0.05


def test_a_slot_does_not_drift_while_robots_pass_through_it() -> None:
    """Each robot comes from the same side, and drives to where the one before it saw the others."""
    start, slot = (1.6, 2.2), (1.6, 2.8)
    here = slot
    for _ in range(40):
        robot = BesideCorner(CORNER, 0.0, 0.0, start)
        landmarks = [Landmark(node, bearing(here, ROBOTS[node]), True) for node in (8, 9)]
        for velocity in move(robot, bearing(start, slot), math.dist(start, slot), landmarks):
            robot.go(velocity)
        here = robot.at
    assert math.dist(here, slot) < 0.002


def test_a_robot_that_stands_far_from_its_slot_moves_there_in_short_steps() -> None:
    """Bearings show the direction of a goal, and not how far it is: one long step could end out of sight."""
    end = end_of_move(BesideCorner(CORNER, math.pi / 72, 0.0, STOPPED), 0.0)
    assert math.dist(end, STOPPED) < 0.5
    assert math.dist(end, GOAL) < 0.2


@pytest.mark.parametrize("switches_deg", [0.0, 25.0])
def test_a_robot_goes_round_a_corner_on_its_straight_way(switches_deg: float) -> None:
    start, goal = (1.55, 1.79), (1.1, 2.46)
    robot = BesideCorner(CORNER, 0.0, math.radians(switches_deg), start)
    for velocity in move(
        robot, bearing(start, goal), math.dist(start, goal), [Landmark(13, bearing(goal, START), True)]
    ):
        robot.go(velocity)
    assert math.dist(robot.at, goal) < 0.05


class BesideDoor(BesideCorner):
    """A robot that sees robot 9, in a room behind a wall, only from a place at most `sight_m` from the point (0, 0)."""

    def __init__(self, at: tuple[float, float], sight_m: float) -> None:
        self.sight_m = sight_m
        super().__init__(shapely.box(9.0, 9.0, 9.1, 9.1), 0.0, 0.0, at)
        self.frame.x_m, self.frame.y_m = at

    def _read(self) -> None:
        self.frame.seen = {9: bearing(self.at, (-0.9, 0.0))} if math.dist(self.at, (0.0, 0.0)) <= self.sight_m else {}


def carry_out(robot: BesideDoor, drive: DriveToResult) -> bool:
    while True:
        try:
            robot.go(next(drive))
        except StopIteration as end:
            return bool(end.value.ok)


@pytest.mark.parametrize("still", [False, True])
def test_a_robot_of_a_single_file_homes_again_by_one_average(still: bool) -> None:
    """By single readings it would go to and fro until one of them is small by chance."""
    slot, aside = (1.65, 2.845), (0.945, 0.327)
    robot = BesideCorner(CORNER, math.pi / 72.0, 0.0, (slot[0] + 0.04 * aside[0], slot[1] + 0.04 * aside[1]))
    landmarks = tuple(Landmark(node, bearing(slot, ROBOTS[node]), still) for node in (8, 9))
    drive, ticks = move(robot, 0.0, 0.0, landmarks), 0
    while True:
        try:
            robot.go(next(drive))
        except StopIteration as end:
            result = end.value
            break
        error_rad = 0.08 * (-1) ** ticks
        robot.frame.seen |= {8: robot.frame.seen[8] + error_rad, 9: robot.frame.seen[9] - error_rad}
        ticks += 1
    assert ticks < 20
    assert (result.ok, result.used_odometry, result.used_moving_landmarks) == (True, True, not still)
    assert abs((robot.at[0] - slot[0]) * aside[0] + (robot.at[1] - slot[1]) * aside[1]) < 0.035


def test_a_robot_that_stopped_before_its_slot_looks_for_the_robot_ahead() -> None:
    robot = BesideDoor((0.15, 0.0), 0.1)
    assert carry_out(robot, regain(robot, 9, (0.0, 0.0)))
    assert robot.at[0] == pytest.approx(0.1 - robot.parameters.margin_m, abs=2.0 * robot.parameters.creep_m)


def test_a_robot_that_does_not_find_the_robot_ahead_drives_back() -> None:
    robot = BesideDoor((0.15, 0.0), 0.0)
    robot.sight_m = -1.0
    assert not carry_out(robot, regain(robot, 9, (0.0, 0.0)))
    assert robot.at == pytest.approx((0.15, 0.0), abs=robot.parameters.tolerance_m)


def test_a_robot_drives_back_on_its_way_and_not_on_its_loops() -> None:
    trail = Trail()
    loop = [(0.3 + 0.1 * x, 0.1 * y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]
    for at in [(0.1 * step, 0.0) for step in range(3)] + loop + [(0.3, -0.1), (0.3, -0.2)]:
        trail.record(at)
    points = [(0.0, 0.0), (0.1, 0.0), (0.2, 0.0), (0.3, 0.0), (0.3, -0.1), (0.3, -0.2)]
    assert [math.dist(*each) for each in zip(trail.points, points, strict=True)] == pytest.approx([0.0] * 6)
    robot = BesideDoor((0.3, -0.2), 0.15)
    assert carry_out(robot, drive_back(robot, trail.points, lambda: 9 in robot.frame.seen))
    assert robot.at == pytest.approx((0.1, 0.0), abs=0.06)
