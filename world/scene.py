"""The scene: the true state of all robots at one tick, which sensors, the radio and metrics read."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from zwerm.maths.keyed_random import Draws
from zwerm.world.arena.arena import Arena

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


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

    def present_ids(self) -> Ints:
        """Return the ids of the robots in the arena, ascending."""
        return np.flatnonzero(self.present)
