"""Sensors: what a robot may know of the scene. One file a sensor, each with its noise model; `registry` names them."""

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol

from zwerm.scenario import Table
from zwerm.world.scene import Ints, Scene


class Sensor(Protocol):
    """A sensor that every robot of the swarm carries.

    `field` is the field of `Observation` that it fills. The constructor takes an instance of `Parameters`.
    """

    field: ClassVar[str]
    Parameters: ClassVar[type[Table]]

    def read(self, scene: Scene, robots: Ints) -> Sequence[Any]:
        """Return one reading for each of `robots` (ascending ids of present robots), vectorised over all of them."""
