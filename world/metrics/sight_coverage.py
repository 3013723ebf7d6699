"""`metrics.sight_range_m`: the fraction of the arena in sight of the robots, and the number of robots."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final

import shapely

from zwerm.scenario.types import Positive
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.metrics.sight import SeenArea, hexagonal_packing_robots, holes, living, obstacles, reachable
from zwerm.world.scene import Floats

# Percentages of the arena whose first time in sight is measured.
PERCENTS: Final = (50, 90, 99)
TIMES: Final = {
    f"time_to_{percent}_percent_coverage_s": (
        f"when {percent} % of the arena was first in sight, on a straight line between samples; null if it never was"
    )
    for percent in PERCENTS
}


class SightCoverage(Metric):
    """Coverage by sight of the living robots, its curve over the run, and the number of robots beside the ideal packing."""

    names: ClassVar[Mapping[str, str]] = {
        "coverage_fraction": "free area in sight of a living robot, within the range, of all free area; exact polygons",
        "reachable_coverage_fraction": (
            "the same, of the free area that a robot's body can get into from where robots are: not what lies "
            "behind a crack in a wall"
        ),
        "robots_deployed": "living robots that are in the arena at the end",
        "hexagonal_packing_robots": (
            "how many an ideal hexagonal packing has, points the range apart: the mean over all ways to lay it"
        ),
        "robots_over_hexagonal": "the first of these two over the second",
        "holes": "holes (H1) of the complex of the living robots that see each other within the range",
        "obstacles": "obstacles that stand free in the arena; a deployment that is done has as many holes",
        **TIMES,
    }
    every_s: ClassVar[float | None] = 5.0
    Parameters: ClassVar[Any] = Positive

    def __init__(self, parameters: float, context: MetricContext) -> None:
        self._range_m = parameters
        self._arena = context.arena
        self._sight = SeenArea(context.arena, parameters)
        self._truth: Truth | None = None
        self._times_s: list[float] = []
        self._fractions: list[float] = []
        self._robots: list[float] = []
        self._reached_s = dict.fromkeys(PERCENTS, math.nan)

    def sample(self, truth: Truth) -> None:
        """Measure the fraction in sight of the living robots; set the times of the percentages that it reaches first."""
        scene = truth.scene
        robots = living(scene.present_ids(), truth.dead)
        fraction = self._sight.fraction(scene.position[robots])
        for percent, reached_s in self._reached_s.items():
            if math.isnan(reached_s) and fraction >= percent / 100.0:
                self._reached_s[percent] = self._crossing_s(percent / 100.0, scene.time_s, fraction)
        self._truth = truth
        self._times_s.append(scene.time_s)
        self._fractions.append(fraction)
        self._robots.append(float(len(robots)))

    def metrics(self) -> dict[str, float]:
        """Return the coverage and the robots at the last sample, and the times of the percentages."""
        if self._truth is None:
            return {}
        scene = self._truth.scene
        robots = living(scene.present_ids(), self._truth.dead)
        ideal = hexagonal_packing_robots(self._arena, self._range_m)
        return {
            **self._covered(scene.position[robots], scene.radius_m),
            "robots_deployed": float(len(robots)),
            "hexagonal_packing_robots": ideal,
            "robots_over_hexagonal": len(robots) / ideal,
            "holes": float(holes(Visibility().pairs(scene, self._range_m), robots)),
            "obstacles": float(obstacles(self._arena)),
            **{f"time_to_{percent}_percent_coverage_s": time_s for percent, time_s in self._reached_s.items()},
        }

    def series(self) -> dict[str, list[float]]:
        """Return the fraction of the arena in sight and the number of living robots in the arena, at every sample."""
        return {"coverage_fraction": self._fractions, "robots_deployed": self._robots}

    def _covered(self, position: Floats, radius_m: float) -> dict[str, float]:
        """Return the fractions in sight of the free space, and of the part of it that robots can reach."""
        if not len(position):
            return {"coverage_fraction": 0.0, "reachable_coverage_fraction": 0.0}
        seen = self._sight.area(position)
        inside = reachable(self._arena, radius_m, position)
        return {
            "coverage_fraction": self._sight.fraction(position),
            "reachable_coverage_fraction": min(1.0, float(shapely.intersection(seen, inside).area / inside.area)),
        }

    def _crossing_s(self, share: float, time_s: float, fraction: float) -> float:
        """Return when `share` was reached [s], by linear interpolation between the previous sample and this one."""
        if not self._times_s:
            return time_s
        before_s, before = self._times_s[-1], self._fractions[-1]
        return before_s + (share - before) / (fraction - before) * (time_s - before_s)
