"""Faults of sensors: what is wrong with a reading after its sensor has made it. One schema of noise for all sensors.

    sensor_noise      every number of a reading gets `bias` and Gaussian noise of deviation `sd`, in the sensor's own unit;
                      of items (robots or landmarks seen, closed switches, a bit that says yes) a fraction is missed, and
                      with probability `false_fraction` one that is not there is added
    stuck_touch       one switch is always closed, or never
    dead_beacon       others no longer see these robots (bearings, neighbours, line of sight); they still bump into them
    camera_blackout   these robots see no robots and no landmarks

Draws are keyed by (fault, tick, robot, item): readings of other robots, and other faults, do not change.
"""

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any, ClassVar, Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from zwerm.maths.angles import wrap
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import Finite, Fraction, NonNegative
from zwerm.wire.messages import SENSOR_FIELDS, Bearing, Contact, LandmarkBearing, Neighbour
from zwerm.world.faults import FaultTable, Robots
from zwerm.world.scene import Bools, Floats, Ints, Scene
from zwerm.world.sensors import Sensor
from zwerm.world.sensors.registry import find
from zwerm.world.sensors.touch import TouchTable

SEEING: Final[dict[str, Any]] = {"bearings": (), "landmarks": (), "neighbours": (), "line_of_sight": False}
_ITEMS: Final = ("bearings", "landmarks", "neighbours", "touch")
_YES_OR_NO: Final = (*_ITEMS, "line_of_sight")

# How far away a neighbour that is not there seems to be, at most, where the sensor has no range [m].
_PHANTOM_M: Final = 1.0


class SensorNoiseTable(FaultTable):
    """Noise on one sensor of some robots, or of all."""

    sensor: str
    robots: Robots | None = None
    sd: NonNegative = 0.0
    bias: Finite = 0.0
    missed_fraction: Fraction = 0.0
    false_fraction: Fraction = 0.0


class StuckTouchTable(FaultTable):
    """A switch, counted counter-clockwise from straight ahead, that does not move any more."""

    robots: Robots
    switch: Annotated[int, Field(ge=0)]
    closed: bool


class DeadBeaconTable(FaultTable):
    """These robots cannot be seen."""

    robots: Robots


class CameraBlackoutTable(FaultTable):
    """These robots see nobody."""

    robots: Robots


class SensingFault(ABC):
    """One fault of sensors. `fields` are those it touches."""

    fields: ClassVar[Sequence[str]] = ()

    def __init__(self, table: Any, scenario: Scenario, purpose: str) -> None:
        count = scenario.robots.count
        self._table = table
        self._purpose = purpose
        self._count = count
        self._hit: Bools = np.zeros(count, dtype=np.bool_)
        self._hit[range(count) if table.robots is None else table.robots] = True

    @abstractmethod
    def alter(self, field: str, readings: list[Any], scene: Scene, robots: Ints) -> None:
        """Change the readings, one for each of `robots`, in place."""


class _OfEach(SensingFault):
    """A fault of the robots that are hit, each by itself."""

    def alter(self, field: str, readings: list[Any], scene: Scene, robots: Ints) -> None:
        """Change the readings of those that are hit."""
        for row in np.flatnonzero(self._hit[robots]).tolist():
            readings[row] = self._altered(field, readings[row], scene, int(robots[row]))

    @abstractmethod
    def _altered(self, field: str, reading: Any, scene: Scene, robot: int) -> Any:
        """Return what a robot that is hit reads in place of `reading`."""


class CameraBlackout(_OfEach):
    """Nothing is seen."""

    fields = tuple(SEEING)

    def _altered(self, field: str, reading: Any, scene: Scene, robot: int) -> Any:
        return SEEING[field]


class DeadBeacon(SensingFault):
    """Some robots are not seen; line of sight, which tells no ids, is sensed anew without them."""

    fields = ("bearings", "neighbours")

    @property
    def unseen(self) -> Bools:
        """(n,) who cannot be seen."""
        return self._hit

    def alter(self, field: str, readings: list[Any], scene: Scene, robots: Ints) -> None:
        """Take the dead beacons out of everybody's readings."""
        for row, reading in enumerate(readings):
            readings[row] = tuple([item for item in reading if not self._hit[item.node]])


class StuckTouch(_OfEach):
    """A switch is always closed, or never."""

    fields = ("touch",)

    def __init__(self, table: StuckTouchTable, scenario: Scenario, purpose: str) -> None:
        super().__init__(table, scenario, purpose)
        self._contacts = contacts_of(scenario)

    def _altered(self, field: str, reading: Any, scene: Scene, robot: int) -> Any:
        stuck = self._contacts[self._table.switch]
        closed = {contact.bearing_rad for contact in reading} - {stuck.bearing_rad}
        if self._table.closed:
            closed.add(stuck.bearing_rad)
        return tuple([contact for contact in self._contacts if contact.bearing_rad in closed])


class SensorNoise(_OfEach):
    """Numbers are off, items are missed, and some are imagined."""

    def __init__(self, table: SensorNoiseTable, scenario: Scenario, purpose: str) -> None:
        super().__init__(table, scenario, purpose)
        field = find(table.sensor).field
        self._extra = None if field in SENSOR_FIELDS else field
        self.fields = ("extra",) if self._extra else (field,)  # type: ignore[misc]
        self._contacts = contacts_of(scenario)
        self._landmarks = len(scenario.landmarks)
        ranges = [each.parameters.get("range_m") for each in scenario.robots.sensors if each.kind == table.sensor]
        self._range_m = float(ranges[0]) if ranges and ranges[0] is not None else _PHANTOM_M

    def _altered(self, field: str, reading: Any, scene: Scene, robot: int) -> Any:
        table = self._table

        def uniform(what: str, items: ArrayLike = 0) -> Floats:
            return scene.draws.uniform(f"{self._purpose}/{what}", scene.tick, robot, items)

        if field == "line_of_sight":
            chance = table.missed_fraction if reading else table.false_fraction
            return reading != bool(uniform("missed" if reading else "false") < chance)
        if self._extra is not None:
            return reading | {self._extra: self._off(reading[self._extra], scene, robot, [0])}
        if field not in _ITEMS:
            return self._off((reading,), scene, robot, [0])[0]
        seen = reading
        if table.missed_fraction and reading:
            kept = uniform("missed", [_id_of(item, self._contacts) for item in reading]) >= table.missed_fraction
            seen = tuple([item for item, there in zip(reading, kept, strict=True) if there])
        if table.false_fraction and float(uniform("false")) < table.false_fraction:
            seen = self._imagine(field, seen, robot, uniform)
        return self._off(seen, scene, robot, [_id_of(item, self._contacts) for item in seen])

    def _off(self, parts: tuple[Any, ...], scene: Scene, robot: int, ids: Sequence[int]) -> tuple[Any, ...]:
        """Return `parts` with bias and noise on every float; draws are keyed by a part's id, or by where it stands."""
        table = self._table
        if not (table.sd or table.bias) or not parts:
            return parts
        key = np.asarray(ids if len(ids) == len(parts) else range(len(parts)))
        floats = max(map(_floats, parts))
        draw = scene.draws.normal(f"{self._purpose}/sd", scene.tick, robot, key[:, None], np.arange(floats))
        offsets = (table.bias + table.sd * draw).tolist()
        return tuple([_shifted(part, iter(row)) for part, row in zip(parts, offsets, strict=True)])

    def _imagine(
        self, field: str, seen: tuple[Any, ...], robot: int, uniform: Callable[[str], Floats]
    ) -> tuple[Any, ...]:
        """Return `seen` and an item that is not there, in the sensor's order."""
        known = {_id_of(item, self._contacts) for item in seen}
        if field in ("bearings", "neighbours"):
            known.add(robot)
        total = {"landmarks": self._landmarks, "touch": len(self._contacts)}.get(field, self._count)
        others = [number for number in range(total) if number not in known]
        if not others:
            return seen
        number = others[int(float(uniform("which")) * len(others))]
        angle = math.pi * (2.0 * float(uniform("where")) - 1.0)
        made: Any
        if field == "touch":
            made = self._contacts[number]
        elif field == "neighbours":
            far = self._range_m * math.sqrt(float(uniform("far")))
            made = Neighbour(number, far * math.cos(angle), far * math.sin(angle))
        else:
            made = Bearing(number, angle) if field == "bearings" else LandmarkBearing(number, angle)
        return tuple(sorted([*seen, made], key=lambda item: _id_of(item, self._contacts)))


def _floats(value: Any) -> int:
    """Return how many floats there are in a reading, or in an item of one."""
    if isinstance(value, msgspec.Struct):
        return sum(map(_floats, msgspec.structs.astuple(value)))
    if isinstance(value, tuple):
        return sum(map(_floats, value))
    return int(isinstance(value, float))


def _shifted(value: Any, offsets: Iterator[float], angle: bool = False) -> Any:
    """Return `value` with the next of `offsets` added to every float; angles, which are named so, are wrapped."""
    if isinstance(value, float):
        shifted = value + next(offsets)
        return float(wrap(shifted)) if angle else shifted
    if isinstance(value, msgspec.Struct):
        names = value.__struct_fields__
        new = {name: _shifted(getattr(value, name), offsets, name.endswith("_rad")) for name in names}
        return type(value)(**new)
    return tuple([_shifted(part, offsets) for part in value]) if isinstance(value, tuple) else value


KINDS: Final[dict[type[FaultTable], Callable[[Any, Scenario, str], SensingFault]]] = {
    SensorNoiseTable: SensorNoise,
    StuckTouchTable: StuckTouch,
    DeadBeaconTable: DeadBeacon,
    CameraBlackoutTable: CameraBlackout,
}


def read(sensor: Sensor, faults: Sequence[SensingFault], scene: Scene, robots: Ints) -> Sequence[Any]:
    """Return what `sensor` tells each of `robots` while `faults` are in force."""
    field = sensor.field
    unseen = [fault.unseen for fault in faults if isinstance(fault, DeadBeacon)] if field == "line_of_sight" else []
    readings = list(
        sensor.read(scene, robots) if not unseen else _look_past(sensor, np.any(unseen, axis=0), scene, robots)
    )
    for fault in faults:
        if field in fault.fields:
            fault.alter(field, readings, scene, robots)
    return readings


def _look_past(sensor: Sensor, unseen: Bools, scene: Scene, robots: Ints) -> list[Any]:
    """Return the readings of `robots` as if the unseen, but for the reader itself, were not there."""
    found: dict[int, Any] = {}
    others = robots[~unseen[robots]]
    masked = scene.present & ~unseen
    if len(others):
        found.update(zip(others.tolist(), sensor.read(dataclasses.replace(scene, present=masked), others), strict=True))
    for robot in robots[unseen[robots]].tolist():
        alone = masked.copy()
        alone[robot] = True
        reader = np.array([robot])
        found[robot] = sensor.read(dataclasses.replace(scene, present=alone), reader)[0]
    return [found[robot] for robot in robots.tolist()]


def nonsense(table: FaultTable, scenario: Scenario) -> list[str]:
    """Return what is wrong with a fault of sensors in this scenario, a line each, led by the rest of its path."""
    given = [sensor.kind for sensor in scenario.robots.sensors]
    found: list[str] = []
    if isinstance(table, SensorNoiseTable):
        if table.sensor not in given:
            found.append(f".sensor: the robots have {', '.join(given) or 'no sensors'}, got {table.sensor!r}")
        if (table.missed_fraction or table.false_fraction) and table.sensor not in _YES_OR_NO:
            found.append(f".sensor: {table.sensor} can be neither missed nor imagined")
        if (table.sd or table.bias) and table.sensor in ("touch", "line_of_sight"):
            found.append(f".sensor: {table.sensor} has no numbers that sd and bias could change")
    if isinstance(table, StuckTouchTable):
        switches = len(contacts_of(scenario))
        if "touch" not in given:
            found.append(".kind: the robots have no touch sensor")
        elif table.switch >= switches:
            found.append(f".switch: there are {switches}, numbered from 0, got {table.switch}")
    return found


def contacts_of(scenario: Scenario) -> list[Contact]:
    """Return the contact that each closed touch switch is, counter-clockwise from straight ahead."""
    tables = [sensor.parameters for sensor in scenario.robots.sensors if sensor.kind == "touch"]
    switches = TouchTable.model_validate(tables[0] if tables else {}).switches
    sector_rad = 2.0 * math.pi / switches
    bearings = wrap(np.arange(switches) * sector_rad).tolist()
    return [Contact(bearing, sector_rad / 2.0) for bearing in bearings]


def _id_of(item: Any, contacts: Sequence[Contact]) -> int:
    """Return what tells an item from the others of a reading."""
    if isinstance(item, Contact):
        return next(number for number, contact in enumerate(contacts) if contact.bearing_rad == item.bearing_rad)
    number: int = item.landmark if isinstance(item, LandmarkBearing) else item.node
    return number
