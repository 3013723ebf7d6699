"""The stays of robots at slots: what a robot touched and drove there holds for one stay only.

A robot that leaves its slot for a walk may come back to it later, as another one does: beside where it stood before, where it
touches other walls. So does a robot that others push on.
"""

import math
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Final

# A robot that was pushed this far [m] off its place sees the walls close to it in other directions.
NEAR_M: Final = 0.03


class Pushed(Enum):
    """How far others have pushed a robot: it sees the walls close to it in other directions, or others, too."""

    NOT = "not"
    NEAR = "near"
    FAR = "far"


class Stays:
    """Numbers the stays in the order in which they are seen, and remembers the directions from each to other ones.

    A robot that was pushed by `far_m` [m] sees other walls.
    """

    def __init__(self, far_m: float) -> None:
        self._far_m = far_m
        self._latest: dict[int, tuple[int, int]] = {}  # the robot and the number, by slot
        self._count = 0
        # By slot: the robot, and how far [m] others have pushed it since its way along walls close by counts, and in all.
        self._pushes: dict[int, tuple[int, tuple[float, float], tuple[float, float]]] = {}
        self._views: dict[int, dict[tuple[int, int], float]] = {}  # [rad] by number, then by another slot and its stay

    def number(self, slot: int, robot: int) -> int:
        """Return the number of the stay of the robot that is at a slot now."""
        latest = self._latest.get(slot)
        if latest is None or latest[0] != robot:
            self._count += 1
            latest = self._latest[slot] = robot, self._count
        return latest[1]

    def numbers(self, occupant: Mapping[int, int]) -> dict[int, int]:
        """Return the numbers of all stays by slot; `occupant` has the robot at each slot."""
        return {slot: self.number(slot, robot) for slot, robot in occupant.items()}

    def push(self, slot: int, robot: int, way: tuple[float, float]) -> Pushed:
        """Note the way (x, y) [m] by which others have pushed the robot at a slot, in its own frame; return how far it is now.

        If they have pushed it off its place, another stay begins.
        """
        (x, y), stands = way, (0.0, 0.0)
        pushed, near, far = self._pushes.get(slot, (robot, stands, stands))
        if pushed != robot:
            near = far = stands
        near, far = (near[0] + x, near[1] + y), (far[0] + x, far[1] + y)
        found = Pushed.NOT
        if math.hypot(*far) > self._far_m:
            found, near, far = Pushed.FAR, stands, stands
        elif math.hypot(*near) > NEAR_M:
            found, near = Pushed.NEAR, stands
        if found is not Pushed.NOT:
            self._latest.pop(slot, None)
        self._pushes[slot] = robot, near, far
        return found

    def see(self, slot: int, other: int, occupant: Mapping[int, int], direction_rad: float) -> None:
        """Note the direction [rad] from the robot at a slot to that at another one."""
        here, there = self.number(slot, occupant[slot]), self.number(other, occupant[other])
        self._views.setdefault(here, {})[other, there] = direction_rad

    def apart_m(self, one: int, two: int, distance_m: Callable[[int], float]) -> float:
        """Return how far [m] two stays at a slot are apart at least, as the robots show that both saw at the same places.

        `distance_m` returns the distance [m] of another slot, or infinity if it is not known. Then its robot shows nothing.
        """
        apart = 0.0
        first = self._views.get(one, {})
        for (other, stay), direction in self._views.get(two, {}).items():
            distance = distance_m(other)
            if (other, stay) in first and math.isfinite(distance):
                off = abs(math.remainder(first[other, stay] - direction, math.tau))
                apart = max(apart, distance * math.sin(min(off, math.pi / 2.0)))
        return apart
