"""Robots that lose sight of others look for them: the robot ahead or behind in a push, or any robot."""

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.incarnations import adopted_slot
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.neighbourhood.situation import ALONE_TICKS
from zwerm.agents.sensor_coverage.neighbourhood.surveillance import Surveillance
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.deploy.node_specs import node_specs
from zwerm.scenario.load import load

DT_S = 0.1


def robot_3() -> LocalRobot:
    robot = Node(*node_specs(load("sensor-coverage", ("robots.count=14", "services.path=gradient")), 1)[3])._controller
    assert isinstance(robot, LocalRobot)
    return robot


def pushing(visible: tuple[int, ...]) -> tuple[LocalRobot, TokenPush]:
    """Return robot 3 at slot 8, which sees others, and its part in push 7 between the robots 4, behind, and 5, ahead."""
    robot = robot_3()
    robot.situation.motion.frame.seen = dict.fromkeys(visible, 1.0)
    robot.local_map.occupy(8)
    robot.pushing._join(7, 7, ((7, 4), (8, 3), (9, 5)), 4)
    assert robot.push is not None
    return robot, robot.push


def test_a_robot_that_sees_no_other_robot_comes_back() -> None:
    """It waits for robots on their way to it, drives back on its way, and takes a new slot, where it sees a robot."""
    robot = robot_3()
    situation = robot.situation
    for x_m in (0.0, 0.2, 0.4):
        situation.motion.frame.x_m = x_m
        situation._trail.record(situation.motion.position)
    robot.local_map.occupy(8)
    robot.local_map.heading = 0.0
    robot.local_map.samples = 1
    situation._activity, situation.motion.rest = None, situation.motion.position
    surveillance = Surveillance(situation, robot.beaconing)
    begun = None
    for tick in range(1, 2 * ALONE_TICKS):
        situation.tick = tick
        surveillance.poll(tick)
        if situation.active:
            begun = tick
            break
    assert begun == ALONE_TICKS + 1
    for _ in range(100):
        velocity = situation.advance()
        situation.motion.frame.x_m += DT_S * velocity.forward_m_s
        situation.motion.frame.seen = {5: 1.0} if situation.motion.frame.x_m < 0.15 else {}
    assert 0.0 < situation.motion.frame.x_m < 0.15
    assert robot.local_map.slot == adopted_slot(3, 1, 1) != adopted_slot(3, 1)


@pytest.mark.parametrize(
    ("visible", "walks", "phase"), [((4,), False, "regaining"), ((4, 5), False, "await"), ((4,), True, "await")]
)
def test_a_follower_looks_for_the_robot_ahead_unless_that_follows_a_wall(
    visible: tuple[int, ...], walks: bool, phase: str
) -> None:
    _, push = pushing(visible)
    push._walks = walks
    push._home()
    assert push.phase == phase


@pytest.mark.parametrize(("visible", "phase"), [((5,), "straightening"), ((4, 5), "await")])
def test_a_follower_at_a_measured_distance_moves_back_into_sight_of_the_robot_behind(
    visible: tuple[int, ...], phase: str
) -> None:
    robot, push = pushing(visible)
    push._behind_settled = True
    push._result = DriveResult(True, used_odometry=True)
    robot.local_map.distances_m[8] = 0.9
    push._straighten()
    assert push.phase == phase
