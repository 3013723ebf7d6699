"""Node specifications: the controller class and the Setup of every node of a run."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import msgspec

from zwerm.agents.runtime.contract import Body, Setup
from zwerm.catalogue import BASE, COORDINATOR, ROBOT, Role, algorithm_of, names
from zwerm.errors import ControllerError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.parameter_files import with_file_texts
from zwerm.scenario.tables import Scenario
from zwerm.world.bodies.drives import find_drive

# The table of a scenario that names the controller of each role.
TABLES: Final[dict[Role, str]] = {ROBOT: "robots", BASE: "base", COORDINATOR: "coordinator"}


def controller_for(scenario: Scenario, role: Role, name: str) -> str:
    """Return the class, `module:Class`, that runs on a node of `role` under the name that the scenario gives.

    Raises ControllerError where the role is the coordinator's or a base station's, and the catalogue has no such name.
    """
    row = algorithm_of(name)
    known = {} if row is None else row.controllers.get(role, {})
    if name not in known:
        if role == COORDINATOR and ":" not in name:
            expected = ", ".join(names(role))
            raise ControllerError(f"expected a built-in coordinator ({expected}) or module:Class, got {name!r}")
        return name
    variant = scenario.variant
    own = {} if variant is None else variant.controllers.get(role, {})
    return own.get(name, known[name])


def services_of(scenario: Scenario) -> dict[str, str]:
    """Return the provider of every service: those of the chosen variant, or the algorithm's first."""
    variant, row = scenario.variant, algorithm_of(scenario.robots.controller)
    if variant is None and row is not None and row.variants:
        variant = row.variants[0]
    return dict(variant.services) if variant is not None else dict(scenario.services or {})


def restart_spec(scenario: Scenario, seed: int, node: int, incarnation: int) -> tuple[str, Setup]:
    """Return (controller, setup) of a node's later incarnation: the same but for the random stream."""
    controller, setup = node_specs(scenario, seed)[node]
    if incarnation == 1:
        return controller, setup
    key = Draws(seed).stream_key("controller", node, incarnation)
    return controller, msgspec.structs.replace(setup, stream_key=key, incarnation=incarnation)


def node_specs(scenario: Scenario, seed: int) -> dict[int, tuple[str, Setup]]:
    """Return (controller, setup) by node id.

    A node gets the key of its own random stream and no other. So it cannot compute other random numbers of the run.
    """
    draws, robots = Draws(seed), scenario.robots
    body = Body(
        kind=robots.body.kind,
        radius_m=robots.body.radius_m,
        max_speed_m_s=robots.body.max_speed_m_s,
        max_turn_rad_s=robots.body.max_turn_rad_s,
        wheel_base_m=robots.body.wheel_base_m if find_drive(robots.body.kind).has_wheels else 0.0,
    )
    sensors = tuple(table.kind for table in robots.sensors)
    channels = (("robots",) if scenario.radio is not None else ()) + (("uplink",) if scenario.coordinator else ())
    services = services_of(scenario)
    specs: dict[int, tuple[str, Setup]] = {}

    def add(nodes: Iterable[int], role: Role, name: str, given: Mapping[str, Any]) -> None:
        placed = role != COORDINATOR
        controller = controller_for(scenario, role, name)
        parameters = with_file_texts(given, scenario.folder, f"{TABLES[role]}.parameters")
        for node in nodes:
            setup = Setup(
                node=node,
                role=role,
                dt_s=scenario.time.dt_s,
                sensors=sensors if placed else (),
                stream_key=draws.stream_key("controller", node),
                body=body if placed else None,
                channels=channels if placed else ("uplink",),
                parameters=dict(parameters),
                services=services,
                bases=() if placed or scenario.base is None else tuple(range(scenario.base.stations)),
            )
            specs[node] = controller, setup

    add(range(robots.count), ROBOT, robots.controller, robots.parameters)
    if scenario.base is not None:
        add(range(scenario.base.stations), BASE, scenario.base.controller, scenario.base.parameters)
    if scenario.coordinator is not None:
        add([robots.count], COORDINATOR, scenario.coordinator.controller, scenario.coordinator.parameters)
    return specs
