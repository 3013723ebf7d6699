"""Sensor noise: one sensor of some robots, or of all, has wrong numbers, missing items, and phantom items.

Every number of a reading gets `bias` and Gaussian noise of standard deviation `sd`, in the unit of the sensor. Items of
a reading are robots or landmarks seen, closed switches, or a bit that is true. A fraction `missed_fraction` of them is
missing. A phantom item is added with probability `false_fraction`.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar

import msgspec
import numpy as np

from zwerm.maths.angles import wrap
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import Finite, Fraction, NonNegative
from zwerm.wire.messages import SENSOR_FIELDS
from zwerm.world.faults import FaultContext, FaultTable, Robots
from zwerm.world.faults.sensing import OwnReadingFault
from zwerm.world.scene import Scene
from zwerm.world.sensors import Sensor
from zwerm.world.sensors.registry import find


class SensorNoiseTable(FaultTable):
    """The sensor, the robots, and the size of each error."""

    sensor: str
    robots: Robots | None = None
    sd: NonNegative = 0.0
    bias: Finite = 0.0
    missed_fraction: Fraction = 0.0
    false_fraction: Fraction = 0.0


class SensorNoise(OwnReadingFault):
    """The readings of one sensor have errors."""

    Parameters: ClassVar[type[FaultTable]] = SensorNoiseTable

    def __init__(self, parameters: SensorNoiseTable, context: FaultContext) -> None:
        super().__init__(parameters, context)
        self._field = find(parameters.sensor).field

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return the mistakes in `robots` and `sensor`."""
        found = super().check(parameters, scenario)
        given = [sensor.kind for sensor in scenario.robots.sensors]
        if parameters.sensor not in given:
            return [*found, f".sensor: the robots have {', '.join(given) or 'no sensors'}, got {parameters.sensor!r}"]
        sensor = find(parameters.sensor)
        is_bit = isinstance(sensor.rest(), bool)
        if (parameters.missed_fraction or parameters.false_fraction) and not (sensor.has_items or is_bit):
            found.append(f".sensor: {parameters.sensor} can be neither missed nor imagined")
        if (parameters.sd or parameters.bias) and not sensor.has_floats:
            found.append(f".sensor: {parameters.sensor} has no numbers that sd and bias could change")
        return found

    def alters(self, sensor: Sensor) -> bool:
        """Return whether this is the noisy sensor."""
        return sensor.field == self._field

    def altered(self, sensor: Sensor, reading: Any, scene: Scene, robot: int) -> Any:
        """Return the reading with errors."""
        table = self.parameters

        def uniform(name: str) -> float:
            return float(scene.draws.uniform(f"{self.context.purpose}/{name}", scene.tick, robot, 0))

        if sensor.field not in SENSOR_FIELDS:
            return self._noisy(reading, range(len(reading)), scene, robot)
        if isinstance(reading, bool):
            chance = table.missed_fraction if reading else table.false_fraction
            return reading != (uniform("missed" if reading else "false") < chance)
        if not sensor.has_items:
            return self._noisy((reading,), [0], scene, robot)[0]
        seen = reading
        if table.missed_fraction and reading:
            ids = [sensor.item_id(item) for item in reading]
            kept = (
                scene.draws.uniform(f"{self.context.purpose}/missed", scene.tick, robot, ids) >= table.missed_fraction
            )
            seen = tuple([item for item, there in zip(reading, kept, strict=True) if there])
        if table.false_fraction and uniform("false") < table.false_fraction:
            seen = _with_phantom(sensor, seen, robot, uniform)
        return self._noisy(seen, [sensor.item_id(item) for item in seen], scene, robot)

    def _noisy(self, parts: tuple[Any, ...], ids: Sequence[int], scene: Scene, robot: int) -> tuple[Any, ...]:
        """Return `parts` with bias and noise on every float. The random numbers of each part are keyed by its id."""
        table = self.parameters
        if not (table.sd or table.bias) or not parts:
            return parts
        key = np.asarray(ids)
        floats = max(map(_count_floats, parts))
        normal = scene.draws.normal(f"{self.context.purpose}/sd", scene.tick, robot, key[:, None], np.arange(floats))
        offsets = (table.bias + table.sd * normal).tolist()
        return tuple([_shifted(part, iter(row)) for part, row in zip(parts, offsets, strict=True)])


def _with_phantom(
    sensor: Sensor, seen: tuple[Any, ...], robot: int, uniform: Callable[[str], float]
) -> tuple[Any, ...]:
    """Return `seen` and a phantom item, in the order of the sensor."""
    phantom = sensor.phantom(robot, {sensor.item_id(item) for item in seen}, uniform)
    return seen if phantom is None else tuple(sorted([*seen, phantom], key=sensor.item_id))


def _count_floats(value: Any) -> int:
    """Return the number of floats in a reading, or in an item of one."""
    if isinstance(value, msgspec.Struct):
        return sum(map(_count_floats, msgspec.structs.astuple(value)))
    if isinstance(value, tuple):
        return sum(map(_count_floats, value))
    return int(isinstance(value, float))


def _shifted(value: Any, offsets: Iterator[float], angle: bool = False) -> Any:
    """Return `value` with the next of `offsets` added to every float. Angles, by the suffix of their names, are wrapped."""
    if isinstance(value, float):
        shifted = value + next(offsets)
        return float(wrap(shifted)) if angle else shifted
    if isinstance(value, msgspec.Struct):
        names = value.__struct_fields__
        new = {name: _shifted(getattr(value, name), offsets, name.endswith("_rad")) for name in names}
        return type(value)(**new)
    return tuple([_shifted(part, offsets) for part in value]) if isinstance(value, tuple) else value
