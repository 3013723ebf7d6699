"""The way that a robot came, by odometry. A robot that lost sight of others drives back on it."""

import math
from typing import Final

from zwerm.agents.sensor_coverage.motion.homing import Vector

# Distance [m] between points, and the number of points that are kept: 8 m.
SPACING_M: Final = 0.05
POINTS_MAX: Final = 160


class Trail:
    """Points [m] of a robot's way by odometry, the latest last, without loops."""

    def __init__(self) -> None:
        self.points: list[Vector] = []

    def record(self, at: Vector) -> None:
        """Take in the present position. A way that comes back to an earlier point goes on from there."""
        points = self.points
        if points and math.dist(at, points[-1]) < SPACING_M:
            return
        for index, each in enumerate(points):
            if math.dist(at, each) < SPACING_M:
                del points[index + 1 :]
                return
        points.append(at)
        del points[:-POINTS_MAX]

    def since(self, at: Vector) -> list[Vector]:
        """Return the points after the latest one beside a position, with that position as the first."""
        points = self.points
        beside = (index for index in range(len(points) - 1, -1, -1) if math.dist(at, points[index]) < SPACING_M)
        return [at, *points[next(beside, len(points)) + 1 :]]
