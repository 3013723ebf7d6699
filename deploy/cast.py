"""The cast of a run: for every node, the controller that plays it and what it may know before its first observation."""

from zwerm.agents.contract import Body, Setup
from zwerm.draws import Draws
from zwerm.scenario import Scenario

ROBOT = "robot"


def cast(scenario: Scenario, seed: int) -> dict[int, tuple[str, Setup]]:
    """Return (controller, setup) by node id.

    A node gets the key of its own random stream and no other: from it the run's other draws cannot be told.
    """
    draws, robots = Draws(seed), scenario.robots
    body = Body(
        kind=robots.body.kind,
        radius_m=robots.body.radius_m,
        max_speed_m_s=robots.body.max_speed_m_s,
        max_turn_rad_s=robots.body.max_turn_rad_s,
        wheel_base_m=robots.body.wheel_base_m if robots.body.kind == "differential" else 0.0,
    )
    sensors = tuple(table.kind for table in robots.sensors)
    return {
        node: (
            robots.controller,
            Setup(
                node=node,
                role=ROBOT,
                dt_s=scenario.time.dt_s,
                sensors=sensors,
                stream_key=draws.stream_key("controller", node),
                body=body,
                channels=("robots",) if scenario.radio is not None else (),
                parameters=robots.parameters,
            ),
        )
        for node in range(robots.count)
    }
