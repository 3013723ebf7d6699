"""How the covered part of an arena grows: what robots have in sight, looked at all through a run."""

import math
from collections.abc import Sequence
from typing import Final

from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.sight import SeenArea, living
from zwerm.world.scene import Scene

# How much of the arena has to be in sight, in percent, for the times that are told.
PERCENTS: Final = (50, 90, 99)


class SightObserver:
    """The metrics of `metrics.sight_range_m` that take a whole run; those of its end are in `metrics`."""

    every_s: Final = 5.0

    def __init__(self, arena: Arena, range_m: float) -> None:
        self._sight = SeenArea(arena, range_m)
        self._times_s: list[float] = []
        self._fractions: list[float] = []
        self._robots: list[float] = []
        self._reached_s = dict.fromkeys(PERCENTS, math.nan)

    def look(self, scene: Scene, dead: Sequence[int]) -> None:
        """Take note of how much is in sight of the living, and of what share of the arena is for the first time."""
        robots = living(scene.present_ids(), dead)
        fraction = self._sight.fraction(scene.position[robots])
        for percent, reached_s in self._reached_s.items():
            if math.isnan(reached_s) and fraction >= percent / 100.0:
                self._reached_s[percent] = self._crossing_s(percent / 100.0, scene.time_s, fraction)
        self._times_s.append(scene.time_s)
        self._fractions.append(fraction)
        self._robots.append(float(len(robots)))

    def metrics(self) -> dict[str, float]:
        """Return when each share of the arena was first in sight."""
        return {f"time_to_{percent}_percent_coverage_s": time_s for percent, time_s in self._reached_s.items()}

    def series(self) -> dict[str, list[float]]:
        """Return the share of the arena in sight and the number of living robots in it, at every look."""
        return {"coverage_fraction": self._fractions, "robots_deployed": self._robots}

    def _crossing_s(self, share: float, time_s: float, fraction: float) -> float:
        """Return when `share` was reached, on a straight line from the look before to this one."""
        if not self._times_s:
            return time_s
        before_s, before = self._times_s[-1], self._fractions[-1]
        return before_s + (share - before) / (fraction - before) * (time_s - before_s)
