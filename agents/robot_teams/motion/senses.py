"""A robot's senses at one tick, in the frame of the arena: its position, the walls it touches, the robots beside it."""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from zwerm.agents.robot_teams.mapping.facts import Wreck
from zwerm.agents.robot_teams.motion.wall_following import Vector
from zwerm.wire.messages import Observation

# The gap that robots keep between their bodies [m]. It is larger than the reach of a touch switch, so a touched body is
# a wall.
GAP_M: Final = 0.04

# A robot that moves less than this in a tick stands [m].
STANDS_M: Final = 0.004

# A wreck nearer than this, beyond the gap that is kept, is a wall [m].
DEAD_M: Final = 0.04


class Beside(NamedTuple):
    """A robot in sight: where it is, the unit vector towards it, the gap to keep, and its motion in the last tick [m].

    `wreck` is set where it is dead and in contact: then it is a wall.
    """

    node: int
    x_m: float
    y_m: float
    nx: float
    ny: float
    gap_m: float
    dx_m: float
    dy_m: float
    wreck: Wreck | None = None

    @property
    def stands(self) -> bool:
        """True if it did not move in the last tick."""
        return abs(self.dx_m) + abs(self.dy_m) < STANDS_M


class Senses(NamedTuple):
    """One tick's observation. `walls` are unit vectors towards the walls that are touched."""

    tick: int
    x_m: float
    y_m: float
    walls: tuple[Vector, ...]
    robots: tuple[Beside, ...]

    @property
    def wrecks(self) -> tuple[Wreck, ...]:
        """The wrecks that are touched."""
        return tuple([other.wreck for other in self.robots if other.wreck is not None])


class SenseReader:
    """Turns observations into senses; remembers where the robots in sight were a tick ago."""

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._heading_rad = math.nan
        self._vectors: dict[float, Vector] = {}
        self._last: dict[int, Vector] = {}
        self.cos, self.sin = 1.0, 0.0

    def read(self, observation: Observation, dead: Mapping[int, Wreck]) -> Senses:
        """Return the senses of an observation with pose, touch and neighbours; a `dead` robot in contact is a wall."""
        pose, touch, neighbours = observation.pose, observation.touch, observation.neighbours
        assert pose is not None
        if pose.heading_rad != self._heading_rad:
            self._heading_rad = pose.heading_rad
            self._vectors.clear()
            self.cos, self.sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        robots: list[Beside] = []
        wrecks: list[Vector] = []
        places: dict[int, Vector] = {}
        for each in neighbours or ():
            dx, dy = self.cos * each.x_m - self.sin * each.y_m, self.sin * each.x_m + self.cos * each.y_m
            apart = math.hypot(dx, dy) or 1e-9
            x, y = pose.x_m + dx, pose.y_m + dy
            was = self._last.get(each.node, (x, y))
            places[each.node] = x, y
            gap = apart - 2.0 * self._radius_m - GAP_M
            stands = abs(x - was[0]) + abs(y - was[1]) < STANDS_M
            wreck = dead.get(each.node) if gap < DEAD_M and stands else None
            if wreck is not None:
                wrecks.append((dx / apart, dy / apart))
            robots.append(Beside(each.node, x, y, dx / apart, dy / apart, gap, x - was[0], y - was[1], wreck))
        self._last = places
        walls = (*[self._vector(contact.bearing_rad) for contact in touch or ()], *wrecks)
        return Senses(observation.tick, pose.x_m, pose.y_m, walls, tuple(robots))

    def _vector(self, bearing_rad: float) -> Vector:
        found = self._vectors.get(bearing_rad)
        if found is None:
            angle = self._heading_rad + bearing_rad
            found = self._vectors[bearing_rad] = math.cos(angle), math.sin(angle)
        return found
