"""The cast of a run: for every node, the controller that plays it and what it may know before its first observation."""

from typing import Any, Final

import msgspec

from zwerm.agents.runtime.contract import Body, Setup
from zwerm.errors import ControllerError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.services import ServicesTable
from zwerm.scenario.tables import Scenario

ROBOT: Final = "robot"
BASE: Final = "base"
COORDINATOR: Final = "coordinator"

# What plays a part that is no robot's, by the name that scenarios give it.
PARTS: Final = {
    (BASE, "sensor-coverage"): "zwerm.agents.sensor_coverage:Base",
    (COORDINATOR, "sensor-coverage"): "zwerm.coordinator.sensor_coverage.coordinator:SensorCoverageCoordinator",
}

# The same where robots find the path among themselves.
ALONE: Final = {
    (ROBOT, "sensor-coverage"): "zwerm.agents.sensor_coverage.local_robot:LocalRobot",
    (BASE, "sensor-coverage"): "zwerm.agents.sensor_coverage.local_base:LocalBase",
    (COORDINATOR, "sensor-coverage"): "zwerm.coordinator.sensor_coverage.redundancy_advisor:RedundancyAdvisor",
}

# The same where a coordinator finds the path, and robots among themselves who can be spared.
AGREED: Final = {
    (ROBOT, "sensor-coverage"): "zwerm.agents.sensor_coverage.negotiating_robot:NegotiatingRobot",
    (BASE, "sensor-coverage"): "zwerm.agents.sensor_coverage.negotiating_robot:NegotiatingBase",
}


def player(role: str, name: str, services: ServicesTable | None = None) -> str:
    """Return the controller that plays a role under the name that a scenario gives it, with these services.

    Raises ControllerError where no coordinator has that name.
    """
    if role == COORDINATOR and (role, name) not in PARTS and ":" not in name:
        known = ", ".join(each for part, each in PARTS if part == role)
        raise ControllerError(f"expected a built-in coordinator ({known}) or module:Class, got {name!r}")
    players = PARTS
    if services is not None and services.path == "gradient":
        players = PARTS | ALONE
    elif services is not None and services.spares == "link":
        players = PARTS | AGREED
    return players.get((role, name), name)


def recast(scenario: Scenario, seed: int, node: int, incarnation: int) -> tuple[str, Setup]:
    """Return (controller, setup) of a node's later life: all is as before, but for a random stream of its own."""
    controller, setup = cast(scenario, seed)[node]
    if incarnation == 1:
        return controller, setup
    key = Draws(seed).stream_key("controller", node, incarnation)
    return controller, msgspec.structs.replace(setup, stream_key=key, incarnation=incarnation)


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
    channels = (("robots",) if scenario.radio is not None else ()) + (("uplink",) if scenario.coordinator else ())
    chosen = scenario.services or ServicesTable()
    services = {"path": chosen.path, "redundancy": chosen.spares}
    players: dict[int, tuple[str, Setup]] = {}

    def add(node: int, role: str, controller: str, parameters: dict[str, Any]) -> None:
        placed = role != COORDINATOR
        key = draws.stream_key("controller", node)
        players[node] = (
            player(role, controller, scenario.services),
            Setup(
                node=node,
                role=role,
                dt_s=scenario.time.dt_s,
                sensors=sensors if placed else (),
                stream_key=key,
                body=body if placed else None,
                channels=channels if placed else ("uplink",),
                parameters=parameters,
                services=services,
                bases=() if placed or scenario.base is None else tuple(range(scenario.base.stations)),
            ),
        )

    for node in range(robots.count):
        add(node, ROBOT, robots.controller, robots.parameters)
    if scenario.base is not None:
        for node in range(scenario.base.stations):
            add(node, BASE, scenario.base.controller, scenario.base.parameters)
    if scenario.coordinator is not None:
        add(robots.count, COORDINATOR, scenario.coordinator.controller, scenario.coordinator.parameters)
    return players
