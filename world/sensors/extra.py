"""The readings of sensors outside the catalogue: the observation's field `extra`, a tuple of floats by sensor name.

A sensor whose `field` is no field of `Observation` returns one tuple of floats for each robot. This class gathers them.
"""

from collections.abc import Sequence
from typing import ClassVar

from zwerm.scenario.types import Table
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor


class Extra(Sensor):
    """One dictionary for each robot, from sensors' fields to readings. Made by the registry, not by a table."""

    field: ClassVar[str] = "extra"
    Parameters: ClassVar[type[Table]] = Table

    def __init__(self, parameters: Sequence[Sensor], surroundings: object = None) -> None:
        self.parts = tuple(parameters)

    def read(self, scene: Scene, robots: Ints) -> list[dict[str, tuple[float, ...]]]:
        """Return every sensor's reading for each of `robots`."""
        return self.joined([sensor.read(scene, robots) for sensor in self.parts])

    def joined(self, columns: Sequence[Sequence[tuple[float, ...]]]) -> list[dict[str, tuple[float, ...]]]:
        """Return one dictionary for each robot from a column of readings for each of `parts`."""
        names = [sensor.field for sensor in self.parts]
        return [dict(zip(names, readings, strict=True)) for readings in zip(*columns, strict=True)]
