"""Stuck touch: one touch switch, counted counter-clockwise from straight ahead, is always closed, or never."""

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import FaultTable
from zwerm.world.faults.sensing import OwnReadingFault, SensingFaultTable, random_robot
from zwerm.world.scene import Scene
from zwerm.world.sensors import Sensor
from zwerm.world.sensors.registry import find
from zwerm.world.sensors.touch import Touch, TouchTable


class StuckTouchTable(SensingFaultTable):
    """The number of the switch, and its state."""

    switch: Annotated[int, Field(ge=0)]
    closed: bool


class StuckTouch(OwnReadingFault):
    """One switch of these robots does not move."""

    Parameters: ClassVar[type[FaultTable]] = StuckTouchTable

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return the mistakes in `robots` and `switch`."""
        found = super().check(parameters, scenario)
        switches = _switches(scenario)
        if not switches:
            found.append(".kind: the robots have no touch sensor")
        elif parameters.switch >= switches:
            found.append(f".switch: there are {switches}, numbered from 0, got {parameters.switch}")
        return found

    def alters(self, sensor: Sensor) -> bool:
        """Return whether the sensor has switches."""
        return isinstance(sensor, Touch)

    def altered(self, sensor: Sensor, reading: Any, scene: Scene, robot: int) -> Any:
        """Return the reading with the switch closed, or open."""
        assert isinstance(sensor, Touch)
        return sensor.with_switch(reading, self.parameters.switch, self.parameters.closed)

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return one robot, one of its switches, and its state."""
        robot = random_robot(stream, scenario, arena)
        return robot | {"switch": int(stream.integers(_switches(scenario))), "closed": bool(stream.integers(2))}

    @classmethod
    def impossible(cls, scenario: Scenario) -> str:
        """Return that there are no switches, if so."""
        return "" if _switches(scenario) else "the robots have no touch sensor"


def _switches(scenario: Scenario) -> int:
    """Return the number of touch switches of a robot, 0 without a touch sensor."""
    for sensor in scenario.robots.sensors:
        if issubclass(find(sensor.kind), Touch):
            table = find(sensor.kind).Parameters.model_validate(sensor.parameters)
            return table.switches if isinstance(table, TouchTable) else 0
    return 0
