"""Dead beacon: sensors of other robots do not see these robots. Their bodies stay in the arena, and touch sensors
detect them."""

from typing import Any

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults.sensing import SensingFault, random_robot
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.sensors import Sensor


class DeadBeacon(SensingFault):
    """These robots are not seen. A sensor without items is read in a scene without them."""

    def hides(self, sensor: Sensor) -> Bools | None:
        """Hide the robots from a sensor whose reading has no items to remove."""
        return self.hit if sensor.sees_beacons and not sensor.has_items else None

    def alters(self, sensor: Sensor) -> bool:
        """Return whether the items of the sensor are robots."""
        return sensor.sees_beacons and sensor.has_items

    def alter(self, sensor: Sensor, readings: list[Any], scene: Scene, robots: Ints) -> None:
        """Remove the dead beacons from all readings."""
        for row, reading in enumerate(readings):
            readings[row] = tuple([item for item in reading if not self.hit[sensor.item_id(item)]])

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return one robot."""
        return random_robot(stream, scenario, arena)
