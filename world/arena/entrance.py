"""Entrances of the arena: a timed entry schedule with an exit, and the depots of base stations.

An entry schedule lets robots enter in id order, every `every_s` seconds, at a random free place of the entry rectangle. While
no place is free, the next robot waits; the interval counts from the last entry. A base station's depot lets a robot enter at
the station when the station releases it.
"""

from collections import deque

import numpy as np

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import BaseTable, EntranceTable, PlacementTable
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.placement import free_spot, place, placed
from zwerm.world.scene import Floats, Ints, Scene


class EntrySchedule:
    """Lets `count` robots enter one by one, and removes those that reach the exit."""

    def __init__(self, table: EntranceTable, count: int) -> None:
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


class Depots:
    """The base stations, robots 0 to n - 1, and the depots in which the other robots wait.

    The robots are distributed to the depots one by one, and leave each depot in id order.
    """

    def __init__(self, table: BaseTable, count: int, arena: Arena, radius_m: float, draws: Draws) -> None:
        """Place every base station. Raises ScenarioError where one has no room, or where no robot is left to wait."""
        stations = table.stations
        if stations >= count:
            raise ScenarioError([f"robots.count: expected more than the {stations} base stations, got {count}"])
        if given := table.poses or ([table.pose] if table.pose else []):
            keys = [f"base.poses.{station}" for station in range(stations)] if table.poses else ["base.pose"]
            drawn = -np.pi + 2.0 * np.pi * draws.uniform("base-heading", np.arange(stations))
            poses = [
                (each[0], each[1], each[2] if len(each) > 2 else turn) for each, turn in zip(given, drawn, strict=True)
            ]
            self.position, self.heading = placed(poses, keys, arena, radius_m)
        else:
            self.position, self.heading = place(PlacementTable(), arena, stations, radius_m, draws)
        self.stations = stations
        self._waiting = [deque(range(stations + station, count, stations)) for station in range(stations)]
        self._entering: deque[tuple[int, int]] = deque()
        self.refused_releases = 0

    def release(self, station: int) -> None:
        """Release a station's next robot; a release from an empty depot is refused and counted."""
        if self._waiting[station]:
            self._entering.append((station, self._waiting[station].popleft()))
        else:
            self.refused_releases += 1

    def entering(self, scene: Scene) -> tuple[int, Floats, float] | None:
        """Return (robot, position (2,) [m], heading [rad]) of a robot that enters now, at its base, or None.

        One robot enters a tick; others released at the same tick follow.
        """
        if not self._entering:
            return None
        station, robot = self._entering.popleft()
        return robot, self.position[station].copy(), float(self.heading[station])

    def leaving(self, scene: Scene) -> Ints:
        """Return no robots: a released robot stays in the arena."""
        return np.zeros(0, dtype=np.int64)
