"""Camera blackout: sensors that are cameras see nothing. Others, such as touch, still work."""

from typing import Any

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults.sensing import OwnReadingFault, random_robot
from zwerm.world.scene import Scene
from zwerm.world.sensors import Sensor


class CameraBlackout(OwnReadingFault):
    """These robots see nothing."""

    def alters(self, sensor: Sensor) -> bool:
        """Return whether the sensor is a camera."""
        return sensor.dark is not None

    def altered(self, sensor: Sensor, reading: Any, scene: Scene, robot: int) -> Any:
        """Return the dark reading."""
        return sensor.dark

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return one robot."""
        return random_robot(stream, scenario, arena)
