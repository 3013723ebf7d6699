"""The omnidirectional camera: the ids of the robots in sight and the directions in which they are seen, without range.

As in Ramaithitima et al. 2015, a robot sees every robot within `range_m` if no wall blocks the line to its centre. On
request robots hide each other. The noise is Gaussian and independent for each tick, observer and robot seen, plus one
bias.
"""

import math
from collections.abc import Callable, Collection
from typing import Any, ClassVar

import numpy as np

from zwerm.maths.angles import wrap
from zwerm.scenario.types import Finite, NonNegative, Positive, Table
from zwerm.wire.messages import Bearing
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings, chosen, portions, random_angle


class BearingsTable(Table):
    """Range and noise of bearings, and which robots are visible."""

    range_m: Positive | None = None
    through_walls: bool = False
    robots_occlude: bool = False
    sd_rad: NonNegative = 0.0
    bias_rad: Finite = 0.0


class Bearings(Sensor):
    """Bearings to robots, ascending by id."""

    field: ClassVar[str] = "bearings"
    Parameters: ClassVar[type[Table]] = BearingsTable
    wake_event: ClassVar[str] = "on_visible"
    dark: ClassVar[Any] = ()
    sees_beacons: ClassVar[bool] = True
    has_items: ClassVar[bool] = True

    def __init__(self, parameters: BearingsTable, surroundings: Surroundings) -> None:
        self._sight = (parameters.range_m, parameters.through_walls, parameters.robots_occlude)
        self._sd_rad, self._bias_rad = parameters.sd_rad, parameters.bias_rad
        self.steady = self._sd_rad == 0.0
        self._visibility = surroundings.visibility
        self._count = surroundings.count

    def read(self, scene: Scene, robots: Ints) -> list[tuple[Bearing, ...]]:
        """Return the bearings that each of `robots` has to the robots it sees."""
        observer, seen, ends = self._visibility.sightings(scene, robots, *self._sight)
        apart = scene.position[seen] - scene.position[observer]
        bearing = np.arctan2(apart[:, 1], apart[:, 0]) - scene.heading[observer] + self._bias_rad
        if self._sd_rad > 0.0:
            bearing += self._sd_rad * scene.draws.normal("sensor.bearings", scene.tick, observer, seen)
        return portions(list(map(Bearing, seen.tolist(), wrap(bearing).tolist())), ends)

    @staticmethod
    def signature(reading: tuple[Bearing, ...]) -> tuple[int, ...]:
        """Return the ids of the robots in sight."""
        return tuple(bearing.node for bearing in reading)

    def phantom(self, robot: int, known: Collection[int], uniform: Callable[[str], float]) -> Bearing | None:
        """Return the bearing of another robot in a random direction."""
        number = chosen(range(self._count), {*known, robot}, uniform)
        return None if number is None else Bearing(number, random_angle(uniform))

    @classmethod
    def rest(cls) -> tuple[Bearing, ...]:
        """Return no bearing."""
        return ()

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> tuple[Bearing, ...]:
        """Return `count` bearings in random directions."""
        bearings = random.uniform(-math.pi, math.pi, count).tolist()
        return tuple(Bearing(node, bearing) for node, bearing in enumerate(bearings, start=1))

    @classmethod
    def extremes(cls) -> tuple[Bearing, ...]:
        """Return two robots behind, in one direction, and one with a large id."""
        return (Bearing(1, math.pi), Bearing(2, math.pi), Bearing(99_999, 0.0))
