"""The outline of the arena: the corners of its outer boundary, counter-clockwise, in the body frame.

For algorithms that presume to know their environment's boundary, such as Voronoi coverage (Schwager et al. 2006). Every
robot gets all corners, through walls and at any distance; obstacles are not included. The noise is Gaussian and
independent for each tick, robot, corner and axis.
"""

from typing import ClassVar, Final

import numpy as np
from shapely.geometry import Polygon

from zwerm.scenario.types import NonNegative, Table
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings, in_body_frames

_SQUARE: Final = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))


class BoundaryTable(Table):
    """Noise of the corners."""

    sd_m: NonNegative = 0.0


class Boundary(Sensor):
    """The corners (x, y) [m], the same for every robot but for the frame."""

    field: ClassVar[str] = "boundary"
    Parameters: ClassVar[type[Table]] = BoundaryTable

    def __init__(self, parameters: BoundaryTable, surroundings: Surroundings) -> None:
        free = surroundings.arena.free
        if not isinstance(free, Polygon):
            raise ValueError("the boundary sensor needs an arena of one piece")
        self._sd_m = parameters.sd_m
        corners = np.asarray(free.exterior.coords)[:-1, :2]
        self._corners = corners if free.exterior.is_ccw else corners[::-1]

    def read(self, scene: Scene, robots: Ints) -> list[tuple[tuple[float, float], ...]]:
        """Return the corners in the frame of each of `robots`."""
        dx, dy = self._corners.T[:, :, None] - scene.position.take(robots, axis=0).T[:, None, :]
        x, y = in_body_frames(dx, dy, scene.heading, robots)
        if self._sd_m > 0.0:
            corner = np.arange(len(self._corners))[:, None]
            x += self._sd_m * scene.draws.normal("sensor.boundary.x", scene.tick, robots, corner)
            y += self._sd_m * scene.draws.normal("sensor.boundary.y", scene.tick, robots, corner)
        corners = [zip(*each, strict=True) for each in zip(x.tolist(), y.tolist(), strict=True)]
        return list(zip(*corners, strict=True))

    @classmethod
    def rest(cls) -> tuple[tuple[float, float], ...]:
        """Return a square about the robot."""
        return _SQUARE

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> tuple[tuple[float, float], ...]:
        """Return a square about a random place."""
        x, y = random.uniform(-1.0, 1.0, 2).tolist()
        return tuple((x + corner_x, y + corner_y) for corner_x, corner_y in _SQUARE)

    @classmethod
    def extremes(cls) -> tuple[tuple[float, float], ...]:
        """Return a large square."""
        return tuple((1e3 * x, 1e3 * y) for x, y in _SQUARE)
