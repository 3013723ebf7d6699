"""Depots, which let robots into the arena one by one, and an exit that takes them out.

From a timed inflow robots enter in id order, every `every_s` seconds, at a random free place of the entry rectangle. While
there is none, the next robot waits at the door; the interval counts from the last entry. From a base station's depot they
enter when it releases them, where it stands.
"""

import numpy as np

from zwerm.draws import Draws
from zwerm.scenario import BaseTable, InflowTable, PlacementTable
from zwerm.world.arena import Arena
from zwerm.world.placement import free_spot, place
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


class Depot:
    """The robots, ids from 1 to `count` - 1, that wait at a base station, which is robot 0."""

    def __init__(self, table: BaseTable, count: int, arena: Arena, radius_m: float, draws: Draws) -> None:
        if table.pose is not None:
            x, y, heading = table.pose
            self.base: tuple[int, Floats, float] = (0, np.array([x, y]), heading)
        else:
            positions, headings = place(PlacementTable(), arena, 1, radius_m, draws)
            self.base = (0, positions[0], float(headings[0]))
        self._count = count
        self._next_robot = 1
        self._ordered = 0
        self.refused_releases = 0

    def release(self) -> None:
        """Let the next robot out; a release from an empty depot is refused and counted."""
        if self._next_robot + self._ordered < self._count:
            self._ordered += 1
        else:
            self.refused_releases += 1

    def entering(self, scene: Scene) -> tuple[int, Floats, float] | None:
        """Return (robot, position (2,) [m], heading [rad]) of a robot that enters now, at the base, or None."""
        if not self._ordered:
            return None
        self._ordered -= 1
        robot, self._next_robot = self._next_robot, self._next_robot + 1
        return robot, self.base[1].copy(), self.base[2]

    def leaving(self, scene: Scene) -> Ints:
        """Return nobody: what a base station released stays out."""
        return np.zeros(0, dtype=np.int64)
