"""Parking: which bodies the physics engine need not step, because they stand still and nothing that moves is near them.

A body in the engine costs time at every step, whether it moves or not. A parked body is out of the engine. It comes back
before it is driven, and before a body that moves, or that such a body may push, comes within reach. Small swarms, and
swarms of which many robots move, park no robot: there the engine costs less than the search.
"""

from typing import Final

import numpy as np

from zwerm.world.scene import Bools, Floats, Ints

# Up to this many bodies, all of them are in the engine.
FEW_BODIES: Final = 128

# Above this fraction of moving bodies, all of them are in the engine.
_MANY_MOVE: Final = 0.125

# Ticks between two searches for bodies that are near. The reach grows with it.
SEARCH_TICKS: Final = 4

# Ticks that a body stands still before it is parked. It bounds how often bodies enter and leave the engine.
_STILL_TICKS: Final = 20


class Parking:
    """The parked ones of the bodies with ids below `count`.

    Two bodies farther apart than `reach_m` cannot meet within SEARCH_TICKS ticks.
    """

    def __init__(self, count: int, reach_m: float) -> None:
        self.parked: Bools = np.zeros(count, dtype=np.bool_)
        self.in_use = False
        self._reach2 = reach_m**2
        self._moved_tick: Ints = np.zeros(count, dtype=np.int64)
        self._tick = 0
        self._search_tick = 0
        self._urgent = False

    def admit(self, robot: int) -> None:
        """Take a new body, which is in the engine."""
        self.parked[robot] = False
        self._search_tick = self._tick
        self._moved_tick[robot] = self._tick

    def note_moved(self, moved: Bools) -> None:
        """End a tick in which the bodies `moved` (n,) moved."""
        self._moved_tick[moved] = self._tick
        self._tick += 1

    def urge(self) -> None:
        """Take notice that drives have changed: a parked body may be driven."""
        self._urgent = True

    def change(self, position: Floats, present: Bools, driven: Bools) -> tuple[Ints, Ints]:
        """Return the ids of the bodies that enter the engine now, and of those that leave it.

        `position` (n, 2) [m]; `present` (n,) are the bodies in the arena, `driven` (n,) those with a velocity command.
        """
        if self._tick < self._search_tick and not (self._urgent and (driven & self.parked).any()):
            self._urgent = False
            return _NO_ROBOTS, _NO_ROBOTS
        self._urgent = False
        self._search_tick = self._tick + SEARCH_TICKS
        awake = present & (driven | (self._moved_tick >= self._tick - _STILL_TICKS))
        count, total = np.count_nonzero(awake), np.count_nonzero(present)
        if total <= FEW_BODIES or count > _MANY_MOVE * total:
            awake = present
        else:
            self._spread(position, present, awake)
        entering = np.flatnonzero(awake & self.parked)
        leaving = np.flatnonzero(present & ~awake & ~self.parked)
        if len(entering) or len(leaving):
            self.parked[entering], self.parked[leaving] = False, True
            self.in_use = bool(self.parked.any())
        return entering, leaving

    def _spread(self, position: Floats, present: Bools, awake: Bools) -> None:
        """Add to `awake` all bodies that one of them can meet, directly or through others."""
        x, y = position.T
        newest = np.flatnonzero(awake)
        while len(newest):
            near = (x - x[newest][:, None]) ** 2 + (y - y[newest][:, None]) ** 2 <= self._reach2
            reached = near.any(axis=0) & present & ~awake
            newest = np.flatnonzero(reached)
            awake[newest] = True


_NO_ROBOTS: Ints = np.zeros(0, dtype=np.int64)
