"""From a scenario to a world ready to run, with every mistake that the typed tables could not see."""

from collections.abc import Callable
from typing import TypeVar

import msgspec

from zwerm.agents.registry import find, parameters_of
from zwerm.errors import ControllerError, ScenarioError
from zwerm.scenario import Scenario
from zwerm.world.arena import Arena
from zwerm.world.fields import make_field
from zwerm.world.sensors import Sensor
from zwerm.world.sensors.registry import Surroundings, make_sensors
from zwerm.world.world import World

T = TypeVar("T")


def assemble(scenario: Scenario, seed: int) -> World:
    """Return the world of `scenario`, its robots placed for `seed`.

    Raises ScenarioError with every mistake in the arena, the field, the sensors and the controller; or, where those are
    right, in the placement.
    """
    mistakes: list[str] = []

    def attempt(make: Callable[[], T]) -> T | None:
        try:
            return make()
        except ScenarioError as error:
            mistakes.extend(error.mistakes)
            return None

    arena = attempt(lambda: Arena.from_table(scenario.arena, scenario.folder))
    sensors: list[Sensor] | None = None
    if arena is not None:
        sensors = attempt(lambda: _sensors(scenario, arena))
    attempt(lambda: check_controller(scenario))
    if arena is not None and sensors is not None and not mistakes:
        world = attempt(lambda: World(scenario, seed, arena, sensors))
        if world is not None:
            return world
    raise ScenarioError([f"{scenario.place}: {line}" for line in mistakes])


def _sensors(scenario: Scenario, arena: Arena) -> list[Sensor]:
    field = None if scenario.field is None else make_field(scenario.field, arena, scenario.folder)
    surroundings = Surroundings(arena=arena, landmarks=scenario.landmarks, field=field)
    return make_sensors(scenario.robots.sensors, surroundings)


def check_controller(scenario: Scenario) -> None:
    """Find the robots' controller, and check what it is given against what it needs.

    Raises ScenarioError with every mistake.
    """
    robots = scenario.robots
    try:
        found = find(robots.controller)
    except ControllerError as error:
        raise ScenarioError([f"robots.controller: {error}"]) from None
    mistakes = []
    given = {table.kind for table in robots.sensors}
    for sensor in getattr(found, "sensors", ()):
        if sensor not in given:
            mistakes.append(f"robots.sensors: the controller {robots.controller} needs the sensor {sensor!r}")
    try:
        msgspec.convert(robots.parameters, parameters_of(found))
    except msgspec.ValidationError as error:
        mistakes.append(f"robots.parameters: {str(error).replace('`', '')}, got {robots.parameters!r}")
    if mistakes:
        raise ScenarioError(mistakes)
