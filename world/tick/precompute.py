"""Foresight: what the same robots will sense at the next tick, worked out before it begins."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from zwerm.world.scene import Ints, Scene

Readings = Mapping[str, Sequence[Any]]


class PrecomputedReadings(NamedTuple):
    """The `readings` of `robots` (ascending ids) in `scene`, by field: right unless the scene or the robots become others."""

    scene: Scene
    robots: Ints
    readings: Readings

    def holds(self, scene: Scene, robots: Ints) -> bool:
        """Tell whether it is `scene` that came about, and `robots` that sense it."""
        return self.scene is scene and np.array_equal(self.robots, robots)
