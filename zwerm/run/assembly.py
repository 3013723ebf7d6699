"""From a scenario to a world and its observers; reports every mistake that the typed tables cannot detect."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from zwerm.agents.runtime.controllers import find, parameters_of, step_place
from zwerm.catalogue import BASE, COORDINATOR, ROBOT, Role, controller_classes
from zwerm.deploy.node_specs import controller_for, node_specs
from zwerm.errors import ControllerError, ScenarioError
from zwerm.scenario.diagnostics import struct_mistakes
from zwerm.scenario.overrides import blame
from zwerm.scenario.parameter_files import with_file_texts
from zwerm.scenario.plugin_names import search_first
from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.scatter import with_landmarks
from zwerm.world.bodies.drives import find_drive
from zwerm.world.fields import Field
from zwerm.world.fields.registry import make_field
from zwerm.world.geometry import search_tree
from zwerm.world.metrics.observers import Observers, make_observers
from zwerm.world.sensors import Sensor, Surroundings
from zwerm.world.sensors.registry import find as find_sensor
from zwerm.world.sensors.registry import make_sensors
from zwerm.world.world import World

T = TypeVar("T")


def assemble(scenario: Scenario, seed: int) -> World:
    """Return the world of `scenario`, its robots placed for `seed`. Raises ScenarioError as `assemble_run` does."""
    return assemble_run(scenario, seed)[0]


def assemble_run(scenario: Scenario, seed: int, *, import_controllers: bool = True) -> tuple[World, Observers]:
    """Return the world of `scenario` for `seed`, and the observers that measure its run.

    Without `import_controllers` no code of controllers that are not in the catalogue runs in this process; then they
    are not checked. Raises ScenarioError with every mistake that `prepare` finds; or, where there is none, in the faults
    and the placement.
    """
    scenario = _with_landmarks(scenario, seed)
    arena, sensors, observers = prepare(scenario, import_controllers=import_controllers)
    mistakes: list[str] = []
    world = _attempt(lambda: World(scenario, seed, arena, sensors), scenario, mistakes)
    if world is None:
        raise ScenarioError(blame(mistakes, scenario.place, scenario.overrides))
    if import_controllers:
        world.place_of = lambda node: step_place(find(node_specs(scenario, seed)[node][0]))
    return world, observers


class Prepared(NamedTuple):
    """The parts of a world and its run that do not depend on the seed. Sensors and observers are for one run each."""

    arena: Arena
    sensors: Sequence[Sensor]
    observers: Observers


def observers_of(scenario: Scenario, arena: Arena) -> Observers:
    """Return new observers for a run of `scenario`, as `prepare` makes them."""
    table = scenario.field
    field = None if table is None else make_field(table, arena.bounds, scenario.folder, scenario.place)
    return make_observers(scenario, arena, field)


def prepare(scenario: Scenario, *, import_controllers: bool = True) -> Prepared:
    """Return the arena, the sensors and the observers of `scenario`.

    Raises ScenarioError with every mistake in the arena, the field, the sensors, the metrics and the controller.
    Without `import_controllers` only controllers of the catalogue are checked.
    """
    search_first(scenario.folder)
    scenario = _with_landmarks(scenario, 1)
    mistakes: list[str] = []
    field, table = None, scenario.field
    sensors, observers = None, None
    arena = _attempt(lambda: Arena.from_table(scenario.arena, scenario.folder), scenario, mistakes)
    _attempt(lambda: check_drive(scenario), scenario, mistakes)
    _attempt(lambda: check_controllers(scenario, import_own=import_controllers), scenario, mistakes)
    if arena is not None and table is not None:
        bounds = arena.bounds
        field = _attempt(lambda: make_field(table, bounds, scenario.folder, scenario.place), scenario, mistakes)
    # A mistake in the field's own table must not also be reported as a missing field.
    if arena is not None and (field is not None or table is None):
        sensors = _attempt(lambda: _sensors(scenario, arena, field), scenario, mistakes)
        observers = _attempt(lambda: make_observers(scenario, arena, field), scenario, mistakes)
    search_tree.prepare(scenario.robots.count)
    if arena is None or sensors is None or observers is None or mistakes:
        raise ScenarioError(blame(mistakes, scenario.place, scenario.overrides))
    return Prepared(arena, sensors, observers)


def _with_landmarks(scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario with its landmarks scattered, or as it is where the arena has a mistake: `prepare` reports that."""
    try:
        return with_landmarks(scenario, seed)
    except ScenarioError as error:
        if any(line.startswith("scatter") for line in error.mistakes):
            raise ScenarioError([f"{scenario.place}: {line}" for line in error.mistakes]) from None
        return scenario


def _attempt(make: Callable[[], T], scenario: Scenario, mistakes: list[str]) -> T | None:
    """Return what `make` makes, or None with its mistakes added to `mistakes`, each led by the scenario's place."""
    try:
        return make()
    except ScenarioError as error:
        named = scenario.place + ": "
        mistakes += [line if line.startswith(named) else named + line for line in error.mistakes]
        return None


def _sensors(scenario: Scenario, arena: Arena, field: Field | None) -> Sequence[Sensor]:
    landmarks = np.array(scenario.landmarks, dtype=np.float64).reshape(-1, 2)
    surroundings = Surroundings(arena, scenario.robots.count, landmarks=landmarks, field=field)
    return make_sensors(scenario.robots.sensors, surroundings, "robots.sensors", scenario.place)


def check_drive(scenario: Scenario) -> None:
    """Find the drive of the robots' body. Raises ScenarioError where there is none of that name."""
    try:
        find_drive(scenario.robots.body.kind)
    except ValueError as error:
        raise ScenarioError([f"robots.body.kind: {error}"]) from None


def check_controllers(scenario: Scenario, *, import_own: bool = True) -> None:
    """Find the controllers of robots, base and coordinator, and check what each is given against what it needs.

    Without `import_own` those that are not in the catalogue are left out. Raises ScenarioError with every mistake.
    """
    robots, base, coordinator = scenario.robots, scenario.base, scenario.coordinator
    kinds = [table.kind for table in robots.sensors]
    # A controller may name what it needs by the sensor's kind or by the field of the observation that it fills.
    given = [*kinds, *filter(None, map(_field_of, kinds))]
    mistakes: list[str] = []

    def check(table: str, role: Role, name: str, parameters: dict[str, Any], sensors: Sequence[str]) -> None:
        if import_own or is_of_catalogue(name):
            mistakes.extend(_controller_mistakes(scenario, table, role, name, parameters, sensors))

    check("robots", ROBOT, robots.controller, robots.parameters, given)
    if base is not None:
        check("base", BASE, base.controller, base.parameters, given)
    if coordinator is not None:
        check("coordinator", COORDINATOR, coordinator.controller, coordinator.parameters, [])
    if mistakes:
        raise ScenarioError(list(dict.fromkeys(mistakes)))


def is_of_catalogue(controller: str) -> bool:
    """Return whether a controller is Zwerm's own: a name without a module, or a class of the catalogue."""
    return ":" not in controller or controller in controller_classes()


def _field_of(kind: str) -> str | None:
    """Return the field that a sensor fills, or None if there is no such sensor; `make_sensors` reports that mistake."""
    try:
        return find_sensor(kind).field
    except ValueError:
        return None


def _controller_mistakes(
    scenario: Scenario, table: str, role: Role, controller: str, parameters: dict[str, Any], sensors: Sequence[str]
) -> list[str]:
    try:
        found = find(controller_for(scenario, role, controller))
    except ControllerError as error:
        return [f"{table}.controller: {error}"]
    mistakes = [
        f"robots.sensors: the controller {controller} needs the sensor {sensor!r}"
        for sensor in getattr(found, "sensors", ())
        if sensor not in sensors
    ]
    try:
        with_file_texts(parameters, scenario.folder, f"{table}.parameters")
    except ScenarioError as error:
        mistakes += error.mistakes
    return mistakes + struct_mistakes(parameters_of(found), parameters, f"{table}.parameters")
