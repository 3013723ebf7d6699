"""The scene: the true state of all robots at one tick, which sensors, the radio and metrics read."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zwerm.maths.keyed_random import Draws
from zwerm.world.arena.arena import Arena

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# More pairs of robots are not compared one by one: most robots move, and all count.
PAIRS_MAX: Final = 10_000


@dataclass(slots=True)
class Scene:
    """The true state at tick `tick`. Arrays have one row per robot id, also for robots outside the arena.

    `present` marks the robots with a body in the arena, `moved` those whose pose differs from the previous scene's.
    """

    tick: int  # number of the tick, from 0
    time_s: float  # virtual time [s]
    position: Floats  # (n, 2) [m]
    heading: Floats  # (n,) [rad], not wrapped
    present: Bools  # (n,)
    moved: Bools  # (n,)
    radius_m: float  # of all robots [m]
    arena: Arena  # walls and free space
    draws: Draws  # keyed random numbers of the run

    def moved_near(self, robots: Ints, distance_m: float) -> Bools:
        """Return (k,) which of `robots` moved, entered or left, or are at most a distance from one that did."""
        movers = self.moved.nonzero()[0]
        if len(robots) * len(movers) > PAIRS_MAX:
            return np.ones(len(robots), dtype=np.bool_)
        apart = self.position[robots, None] - self.position[movers]
        near: Bools = (np.einsum("ijk,ijk->ij", apart, apart) <= distance_m * distance_m).any(axis=1)
        return near | self.moved[robots]

    def present_ids(self) -> Ints:
        """Return the ids of the robots in the arena, ascending."""
        return np.flatnonzero(self.present)
