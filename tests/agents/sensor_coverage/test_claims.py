"""Frontier claims without a coordinator: a robot that only robots outside the complex see is not the end of a deployment."""

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, SeenRobot, StateBeacon
from zwerm.deploy.node_specs import node_specs
from zwerm.scenario.load import load

ME, OTHER = 3, 4


@pytest.mark.parametrize(("redundant", "claims"), [(True, 1), (False, 0)])
def test_a_robot_that_sees_only_robots_outside_the_complex_claims_a_frontier(redundant: bool, claims: int) -> None:
    """It has no edge, so it makes no plans and has no open arcs of its own."""
    specs = node_specs(load("sensor-coverage", ("services.path=gradient",)), 1)
    robot = Node(*specs[ME])._controller
    assert isinstance(robot, LocalRobot)
    local_map = robot.local_map
    local_map.occupy(7)
    local_map.heading = 0.0
    seen = SeenRobot(ME, local_map.epoch, 7, 3.0)
    state = StateBeacon(1, 8, 1, False, False, 1, (seen,), (), (), NO_PATH_VECTOR, redundant)
    local_map.receive(OTHER, state, 0)
    local_map.update_bearings({OTHER: 0.0})
    assert robot.situation.claims == claims
    local_map.leave_complex()
    assert robot.situation.claims == 0
