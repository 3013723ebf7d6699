"""The omnidirectional camera: the ids of the robots in sight and the directions in which they are seen, without range.

As in Ramaithitima et al. 2015: a robot sees every robot within `range_m` to whose centre no wall blocks the line; on
request robots hide each other. The noise is Gaussian and independent for each tick, observer and robot seen, plus one
bias.
"""

from typing import ClassVar

import numpy as np

from zwerm.maths.angles import wrap
from zwerm.scenario.tables import Finite, NonNegative, Positive, Table
from zwerm.wire.messages import Bearing
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Surroundings, portions


class BearingsTable(Table):
    """Who is seen, and how well."""

    range_m: Positive | None = None
    through_walls: bool = False
    robots_occlude: bool = False
    sd_rad: NonNegative = 0.0
    bias_rad: Finite = 0.0


class Bearings:
    """Bearings to robots, ascending by id."""

    field: ClassVar[str] = "bearings"
    Parameters: ClassVar[type[Table]] = BearingsTable

    def __init__(self, parameters: BearingsTable, surroundings: Surroundings) -> None:
        self._sight = (parameters.range_m, parameters.through_walls, parameters.robots_occlude)
        self._sd_rad, self._bias_rad = parameters.sd_rad, parameters.bias_rad
        self._visibility = surroundings.visibility

    def read(self, scene: Scene, robots: Ints) -> list[tuple[Bearing, ...]]:
        """Return the bearings that each of `robots` has to the robots it sees."""
        observer, seen, ends = self._visibility.sightings(scene, robots, *self._sight)
        apart = scene.position[seen] - scene.position[observer]
        bearing = np.arctan2(apart[:, 1], apart[:, 0]) - scene.heading[observer] + self._bias_rad
        if self._sd_rad > 0.0:
            bearing += self._sd_rad * scene.draws.normal("sensor.bearings", scene.tick, observer, seen)
        return portions(list(map(Bearing, seen.tolist(), wrap(bearing).tolist())), ends)
