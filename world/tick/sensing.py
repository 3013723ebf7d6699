"""Sensing: reads all sensors of a swarm and makes the encoded observations of one tick."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, repeat
from typing import Any, Final

import numpy as np

from zwerm.wire.messages import SENSOR_FIELDS, Observation, Packet, encode
from zwerm.world.faults import Fault
from zwerm.world.faults.sensing import read
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor
from zwerm.world.tick.precompute import PrecomputedReadings, Readings

Inboxes = Sequence[tuple[Packet, ...]]

# Before the first tick, and not followed by it.
_NEVER: Final = -2


class Sensing:
    """The sensors of every robot, and the sensor faults that are in force, `faults`."""

    def __init__(self, sensors: Sequence[Sensor]) -> None:
        self.faults: Sequence[Fault] = ()
        self.sensors = {sensor.field: sensor for sensor in sensors}
        # One column of readings for each field, up to the last field that a sensor fills.
        last = max((SENSOR_FIELDS.index(field) for field in self.sensors), default=-1)
        self._columns = SENSOR_FIELDS[: last + 1]
        self._robots: Ints = np.zeros(0, dtype=np.int64)  # observed last
        self._precomputed: PrecomputedReadings | None = None
        # Readings of steady sensors by field and robot, and the tick of the newest scene in which they hold, or _NEVER.
        self._kept: dict[str, dict[int, Any]] = {field: {} for field, sensor in self.sensors.items() if sensor.steady}
        self._kept_tick = _NEVER

    def readings(self, scene: Scene, robots: Ints) -> Readings:
        """Return the readings of each of `robots` in `scene`, by field; empty without robots."""
        precomputed, self._precomputed, self._robots = self._precomputed, None, robots
        if precomputed is not None and not self.faults and precomputed.valid_for(scene, robots):
            return precomputed.readings
        return self._read_all(scene, robots) if len(robots) else {}

    def precompute(self, scene: Scene) -> None:
        """Read the sensors of the robots that were observed last in the next scene, unless a sensor fault is in force."""
        if len(self._robots) and not self.faults:
            self._precomputed = PrecomputedReadings(scene, self._robots, self._read_all(scene, self._robots))

    def read(self, field: str, scene: Scene, robots: Ints) -> Sequence[Any]:
        """Return the readings of one field for each of `robots`."""
        sensor = self.sensors[field]
        return read(sensor, self.faults, scene, robots) if self.faults else sensor.read(scene, robots)

    def reach_at_rest_m(self, field: str, scene: Scene) -> float | None:
        """Return how far [m] a robot with nothing to sense is from bodies that change that, or None if more may change it."""
        return None if self.faults else self.sensors[field].reach_at_rest_m(scene)

    def observations(
        self,
        scene: Scene,
        robots: int,
        nodes: int,
        readings: Readings,
        inboxes: Inboxes | None,
        times_s: Sequence[float] | None = None,
    ) -> Iterator[bytes]:
        """Yield the encoded observation of each node: `robots` robots, and after them nodes without sensors up to `nodes`.

        `inboxes` holds the packets of each node; None means that no node receives any. `times_s` are the readings of
        their clocks; None means that all are exact.
        """
        columns: list[Any] = [readings.get(field, repeat(None)) for field in self._columns]
        ticks = repeat(scene.tick, robots)
        times: Iterable[float] = repeat(scene.time_s) if times_s is None else times_s
        packets: Any = repeat(()) if inboxes is None else inboxes
        made: Iterator[Observation] = map(Observation, ticks, times, packets, *columns)
        if robots < nodes:
            rest = [()] * (nodes - robots) if inboxes is None else inboxes[robots:]
            last = [scene.time_s] * len(rest) if times_s is None else times_s[robots:]
            made = chain(made, map(Observation, repeat(scene.tick), last, rest))
        return map(encode, made)

    def _read_all(self, scene: Scene, robots: Ints) -> Readings:
        if self.faults or not self._kept or scene.moved.any():
            self._kept_tick = _NEVER
            return {field: self.read(field, scene, robots) for field in self.sensors}
        if scene.tick - self._kept_tick not in (0, 1):
            for kept in self._kept.values():
                kept.clear()
        self._kept_tick = scene.tick
        return {
            field: self._read_kept(field, scene, robots) if field in self._kept else sensor.read(scene, robots)
            for field, sensor in self.sensors.items()
        }

    def _read_kept(self, field: str, scene: Scene, robots: Ints) -> Sequence[Any]:
        """Return the readings of a steady sensor. Only robots that were not read since a body moved are read."""
        kept, ids = self._kept[field], robots.tolist()
        new = [robot for robot in ids if robot not in kept]
        if new:
            unread = robots if len(new) == len(ids) else np.array(new)
            kept.update(zip(new, self.sensors[field].read(scene, unread), strict=True))
        return [kept[robot] for robot in ids]
