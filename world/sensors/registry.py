"""Sensors by name: those of the catalogue, and `module:Class` for any other.

Input: the `[[robots.sensors]]` tables of a scenario. Output: sensors that fill different fields of the observation, or every
mistake in the tables at once.
"""

from collections.abc import Sequence

from pydantic import ValidationError

from zwerm.catalogue import SENSORS
from zwerm.errors import ScenarioError
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.plugin_names import class_named, takes
from zwerm.scenario.types import OpenTable, Table
from zwerm.wire.messages import SENSOR_FIELDS, Observation
from zwerm.world.sensors import Sensor, Surroundings
from zwerm.world.sensors.extra import Extra

_STANDARD = frozenset(SENSOR_FIELDS) - {"extra"}
_TAKEN = frozenset(Observation.__struct_fields__) - _STANDARD


def find(kind: str) -> type[Sensor]:
    """Return the sensor class that `kind` names.

    Raises ValueError, in one line, where there is none or it is no sensor.
    """
    found = class_named(SENSORS.get(kind, kind), "sensor", SENSORS)
    if not callable(getattr(found, "read", None)):
        raise ValueError(f"{kind} is no sensor: it has no method read(scene, robots)")
    name = getattr(found, "field", None)
    if not isinstance(name, str) or name in _TAKEN:
        raise ValueError(f"{kind} is no sensor: its `field` must name what it fills, got {name!r}")
    parameters = getattr(found, "Parameters", None)
    if not isinstance(parameters, type) or not issubclass(parameters, Table):
        raise ValueError(f"{kind} is no sensor: its `Parameters` must be a subclass of zwerm.scenario.types.Table")
    if not takes(found, 2):
        raise ValueError(f"{kind} is no sensor: its constructor must take (parameters, surroundings)")
    # A class with the same methods need not inherit: it gets the defaults of the base class behind its own attributes.
    return found if issubclass(found, Sensor) else type(found.__name__, (found, Sensor), {})


def make_sensor(table: OpenTable, surroundings: Surroundings, path: str, place: str) -> Sensor:
    """Return the sensor that `table` describes; `path` is the path of the table in the scenario `place`.

    Raises ScenarioError with every mistake, each `place: path.key: rule, got value`.
    """
    try:
        kind = find(table.kind)
        return kind(kind.Parameters.model_validate(table.parameters), surroundings)
    except ValidationError as error:
        raise ScenarioError(mistakes(error, place, f"{path}.", kind.Parameters)) from None
    except ValueError as error:
        raise ScenarioError([f"{place}: {path}.kind: {error}"]) from None


def make_sensors(tables: Sequence[OpenTable], surroundings: Surroundings, path: str, place: str) -> tuple[Sensor, ...]:
    """Return the sensors that `tables` describe, one for each field of the observation that they fill.

    Those whose field is not one of the observation's own are gathered in the one that fills `extra`. Raises
    ScenarioError with every mistake in every table, and where two sensors fill the same field.
    """
    found: list[str] = []
    filled: dict[str, str] = {}
    standard: list[Sensor] = []
    extra: list[Sensor] = []
    for index, table in enumerate(tables):
        here = f"{path}.{index}"
        try:
            sensor = make_sensor(table, surroundings, here, place)
        except ScenarioError as error:
            found += error.mistakes
            continue
        if sensor.field in filled:
            found.append(
                f"{place}: {here}.kind: fills {sensor.field}, as {filled[sensor.field]} does, got {table.kind!r}"
            )
        filled.setdefault(sensor.field, here)
        (standard if sensor.field in _STANDARD else extra).append(sensor)
    if found:
        raise ScenarioError(found)
    return (*standard, Extra(extra)) if extra else tuple(standard)
