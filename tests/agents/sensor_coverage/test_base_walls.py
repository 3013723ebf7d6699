"""Walls close to the base: robots follow them from its point, and the base takes their arcs into its proof of coverage."""

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_base import LocalBase
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import SHUT, STRETCH, NearWalls
from zwerm.agents.sensor_coverage.messages.pushes import AllStanding, PushAborted
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import WalkResult
from zwerm.deploy.node_specs import node_specs
from zwerm.scenario.load import load

SCENARIO = load("sensor-coverage", ("robots.count=14", "services.path=gradient"))
NEAR = NearWalls(((0.3, 0.5), (2.0, 0.25)), ((0.8, 0.1),))
PUSH = 7


@pytest.mark.parametrize("body", [PushAborted(PUSH, True, *NEAR[:2]), AllStanding(PUSH, *NEAR[:2])])
def test_the_base_takes_the_arcs_of_a_wall_that_was_followed_beside_it_into_its_proof(
    body: PushAborted | AllStanding,
) -> None:
    base = Node(*node_specs(SCENARIO, 1)[0])._controller
    assert isinstance(base, LocalBase)
    base.schedule._active = PUSH
    base.components.dispatch(3, body, 1)
    assert [(each.start_rad, each.width_rad) for each in base.local_map.proof.memory()] == [
        *NEAR.followed,
        *NEAR.past_ends,
    ]


@pytest.mark.parametrize("end", [SHUT, STRETCH])
def test_a_robot_that_leads_from_the_base_reports_the_arcs_that_it_closed_there(end: str) -> None:
    robot = Node(*node_specs(SCENARIO, 1)[3])._controller
    assert isinstance(robot, LocalRobot)
    robot.local_map.heading = 0.2
    push = robot.pushing._join(PUSH, PUSH, ((NOWHERE, 3),), 0)
    push.lead_from_base(1.0, 1)
    push._approached(WalkResult(end, 0.1, near=NEAR))
    sent = push.end if end == SHUT else robot.situation.mailbox._queues[0].bodies[0]
    assert isinstance(sent, PushAborted | AllStanding)
    assert NearWalls(sent.near, sent.past_ends) == NEAR.turned(0.2)
