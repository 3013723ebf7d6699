"""Where the robots in sight are: their positions in the body frame, as range-and-bearing hardware gives them.

Who is in sight is settled as for `bearings`. The noise is Gaussian, alike and independent in x and y, for each tick,
observer and robot seen. Headings of others are not sensed.
"""

from typing import ClassVar

import numpy as np

from zwerm.protocol import Neighbour
from zwerm.scenario import NonNegative, Positive, Table
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Surroundings, portions


class NeighboursTable(Table):
    """Who is seen, and how well."""

    range_m: Positive | None = None
    through_walls: bool = False
    robots_occlude: bool = False
    sd_m: NonNegative = 0.0


class Neighbours:
    """Relative positions of robots, ascending by id."""

    field: ClassVar[str] = "neighbours"
    Parameters: ClassVar[type[Table]] = NeighboursTable

    def __init__(self, parameters: NeighboursTable, surroundings: Surroundings) -> None:
        self._sight = (parameters.range_m, parameters.through_walls, parameters.robots_occlude)
        self._sd_m = parameters.sd_m
        self._visibility = surroundings.visibility

    def read(self, scene: Scene, robots: Ints) -> list[tuple[Neighbour, ...]]:
        """Return where each of `robots` has the robots it sees."""
        observer, seen, ends = self._visibility.sightings(scene, robots, *self._sight)
        dx, dy = (scene.position[seen] - scene.position[observer]).T
        cos, sin = np.cos(scene.heading)[observer], np.sin(scene.heading)[observer]
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        if self._sd_m > 0.0:
            x += self._sd_m * scene.draws.normal("sensor.neighbours.x", scene.tick, observer, seen)
            y += self._sd_m * scene.draws.normal("sensor.neighbours.y", scene.tick, observer, seen)
        return portions(list(map(Neighbour, seen.tolist(), x.tolist(), y.tolist())), ends)
