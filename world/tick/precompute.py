"""Precomputed readings: what the same robots sense at the next tick, computed while nodes still work on this one."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from zwerm.world.scene import Ints, Scene

Readings = Mapping[str, Sequence[Any]]


class PrecomputedReadings(NamedTuple):
    """The `readings` of `robots` (ascending ids) in `scene`, by field of the observation."""

    scene: Scene
    robots: Ints
    readings: Readings

    def valid_for(self, scene: Scene, robots: Ints) -> bool:
        """Return whether these are the readings of exactly these robots in exactly this scene."""
        return self.scene is scene and np.array_equal(self.robots, robots)
