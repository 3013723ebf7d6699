"""Faults of sensors: one file a kind. Each changes readings after the sensor has made them.

Random numbers are keyed by (fault, tick, robot, item): readings of other robots, and other faults, do not change.
"""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import Fault, FaultContext, FaultTable, Robots, unknown_nodes
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.sensors import Sensor
from zwerm.world.sensors.extra import Extra


class SensingFaultTable(FaultTable):
    """The robots that the fault strikes."""

    robots: Robots


class SensingFault(Fault):
    """A fault of the sensors of some robots. `hit` (robots,) is true for these robots."""

    Parameters: ClassVar[type[FaultTable]] = SensingFaultTable
    alters_sensors: ClassVar[bool] = True
    in_network: ClassVar[bool] = True  # the world makes the readings

    def __init__(self, parameters: Any, context: FaultContext) -> None:
        super().__init__(parameters, context)
        count = context.scenario.robots.count
        self.hit: Bools = np.zeros(count, dtype=np.bool_)
        self.hit[range(count) if parameters.robots is None else parameters.robots] = True

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return a line for each robot that does not exist."""
        return unknown_nodes(parameters.robots, ".robots", scenario)


class OwnReadingFault(SensingFault, ABC):
    """A fault that changes the readings of the robots that are hit, each by itself."""

    def alter(self, sensor: Sensor, readings: list[Any], scene: Scene, robots: Ints) -> None:
        """Change the readings of the robots that are hit."""
        for row in np.flatnonzero(self.hit[robots]).tolist():
            readings[row] = self.altered(sensor, readings[row], scene, int(robots[row]))

    @abstractmethod
    def altered(self, sensor: Sensor, reading: Any, scene: Scene, robot: int) -> Any:
        """Return the reading of a robot that is hit in place of `reading`."""


def random_robot(stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any]:
    """Return the parameters of a random fault that strikes one robot."""
    return {"robots": [int(stream.integers(scenario.robots.count))]}


def read(sensor: Sensor, faults: Sequence[Fault], scene: Scene, robots: Ints) -> Sequence[Any]:
    """Return the readings of `sensor` for each of `robots` while `faults` are active."""
    if isinstance(sensor, Extra):
        return sensor.joined([read(each, faults, scene, robots) for each in sensor.parts])
    hidden = [mask for mask in (fault.hides(sensor) for fault in faults) if mask is not None]
    readings = list(
        _read_without(sensor, np.any(hidden, axis=0), scene, robots) if hidden else sensor.read(scene, robots)
    )
    for fault in faults:
        if fault.alters(sensor):
            fault.alter(sensor, readings, scene, robots)
    return readings


def _read_without(sensor: Sensor, hidden: Bools, scene: Scene, robots: Ints) -> list[Any]:
    """Return the readings of `robots` in a scene without the hidden ones, except for the reading robot itself."""
    found: dict[int, Any] = {}
    others = robots[~hidden[robots]]
    masked = scene.present & ~hidden
    if len(others):
        found.update(zip(others.tolist(), sensor.read(dataclasses.replace(scene, present=masked), others), strict=True))
    for robot in robots[hidden[robots]].tolist():
        alone = masked.copy()
        alone[robot] = True
        reader = np.array([robot])
        found[robot] = sensor.read(dataclasses.replace(scene, present=alone), reader)[0]
    return [found[robot] for robot in robots.tolist()]
