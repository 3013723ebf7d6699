"""A depot that lets robots into the arena one by one, and an exit that takes them out.

Robots enter in id order, every `every_s` seconds, at a random free place of the entry rectangle. While there is none, the
next robot waits at the door; the interval counts from the last entry.
"""

import numpy as np

from zwerm.scenario import InflowTable
from zwerm.world.placement import free_spot
from zwerm.world.scene import Floats, Ints, Scene


class Inflow:
    """The door of a depot of `count` robots, and the way out."""

    def __init__(self, table: InflowTable, count: int) -> None:
        self._table = table
        self._count = count
        self._next_robot = 0
        self._next_s = 0.0

    def entering(self, scene: Scene) -> tuple[int, Floats, float] | None:
        """Return (robot, position (2,) [m], heading [rad]) of a robot that enters now, or None."""
        if self._next_robot >= self._count or scene.time_s < self._next_s - 1e-9:
            return None
        taken = scene.position[scene.present]
        spot = free_spot(
            self._table.entry_m, scene.arena, taken, scene.radius_m, scene.draws, "entry", self._next_robot, scene.tick
        )
        if spot is None:
            return None
        robot, self._next_robot = self._next_robot, self._next_robot + 1
        self._next_s = scene.time_s + self._table.every_s
        heading = float(scene.draws.uniform("entry-heading", robot)) * 2.0 * np.pi - np.pi
        return robot, spot, heading

    def leaving(self, scene: Scene) -> Ints:
        """Return the robots whose whole body is within the exit rectangle."""
        if self._table.exit_m is None:
            return np.zeros(0, dtype=np.int64)
        x0, y0, x1, y1 = self._table.exit_m
        x, y, r = scene.position[:, 0], scene.position[:, 1], scene.radius_m
        inside = (x - r >= x0) & (x + r <= x1) & (y - r >= y0) & (y + r <= y1)
        return np.flatnonzero(inside & scene.present)
