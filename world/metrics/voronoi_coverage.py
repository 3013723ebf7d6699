"""Coverage of a field by a swarm: errors, cost, convergence and density, by the robots' true Voronoi cells.

All values are computed from the true positions and the exact field. The error to the *estimated* centroid is that of
an undisturbed robot at that place (eqs. 10 to 18). The error to the exact centroid (eq. 5) and the cost (eq. 1) are
integrals of the true field. Source: Schwager, McLurkin, Rus 2006.
"""

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Final

import numpy as np
from pydantic import Field as Limits

from zwerm.errors import ScenarioError
from zwerm.scenario.types import Count, Point, Positive, Table
from zwerm.world.geometry.voronoi_cells import Rings, VoronoiCells
from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.scene import Floats

# The statistics whose fall below the threshold is timed. The paper names the first; the published times lie between those
# of the next two.
STATISTICS: Final[dict[str, Callable[[Floats], float]]] = {
    "convergence_time_s": lambda error: float(error.mean()),
    "convergence_time_mean_squared_s": lambda error: float(np.square(error).mean()),
    "convergence_time_max_squared_s": lambda error: float(np.square(error).max()),
    "convergence_time_max_s": lambda error: float(error.max()),
}

# Factor of a lower bound of a mean that is computed with rounding.
_ROUNDED_DOWN: Final = 1.0 - 1e-9


class VoronoiMetricsTable(Table):
    """Coverage of the field by Voronoi cells: errors, cost, and the times at which statistics of the error fall below
    `converged_m`.

    With `peak_m` also the density in `rings` about it. The first `stationary` robots have cells, and no errors.
    """

    converged_m: Positive = 1e-7
    peak_m: Point | None = None
    rings: Count = 10
    stationary: Annotated[int, Limits(ge=0)] = 0


class VoronoiMetrics(Metric):
    """`metrics.voronoi`: coverage of the field by the robots that are present and not `stationary`."""

    names: ClassVar[Mapping[str, str]] = {
        "mean_error_m": "from robots to the estimated centroids of their Voronoi cells. Schwager 2006, eq. 10",
        "max_error_m": "the largest of those",
        "true_mean_error_m": "the same to the exact centroids of the true field. Schwager 2006, eq. 5",
        "coverage_cost": "cost of the swarm's places, lower is better. Schwager 2006, eq. 1",
        "convergence_time_s": "when the mean error first was below `converged_m`; null if it never was",
        "convergence_time_max_s": "when the largest error was",
        "convergence_time_mean_squared_s": "when the mean of the squared errors [m²] was below the same number",
        "convergence_time_max_squared_s": "when the largest squared error was",
        "mean_peak_distance_m": "from robots to the peak, where `peak_m` is given",
        "density_ring_*": (
            "robots in each ring about the peak, 01 the first, over what a uniform swarm would have there"
        ),
    }
    every_s: ClassVar[float | None] = 0.1
    Parameters: ClassVar[Any] = VoronoiMetricsTable

    def __init__(self, parameters: VoronoiMetricsTable, context: MetricContext) -> None:
        arena, field = context.arena, context.field
        if not arena.is_convex:
            raise ScenarioError(["metrics.voronoi: needs a convex arena without obstacles and walls"])
        if field is None:
            raise ScenarioError(["metrics.voronoi: needs a field, and the scenario has none"])
        self._table = parameters
        self._coverage = VoronoiCells(arena, field)
        self._rings = None if parameters.peak_m is None else Rings(arena, parameters.peak_m, parameters.rings)
        self._converged_s = dict.fromkeys(STATISTICS, math.nan)
        self._mean_error_m: list[float] = []
        self._last: tuple[Floats, Floats] | None = None

    def sample(self, truth: Truth) -> None:
        """Measure the errors; set the times of the statistics that are below the threshold for the first time."""
        scene = truth.scene
        position = scene.position[scene.present]
        if len(position) <= self._table.stationary:
            self._mean_error_m.append(math.nan)
            return
        error = self._coverage.errors(position)[self._table.stationary :]
        self._last = position, error
        self._mean_error_m.append(float(error.mean()))
        # No statistic is below the smallest error and its square, but for rounding.
        lowest = _ROUNDED_DOWN * float(error.min())
        if min(lowest, lowest**2) >= self._table.converged_m:
            return
        for name, statistic in STATISTICS.items():
            if math.isnan(self._converged_s[name]) and statistic(error) < self._table.converged_m:
                self._converged_s[name] = scene.time_s

    def metrics(self) -> dict[str, float]:
        """Return the errors, the cost and the density at the last sample, and the times of convergence."""
        if self._last is None:
            return {}
        position, error = self._last
        moving = position[self._table.stationary :]
        exact = self._coverage.integrals(position)
        apart = (exact.centroid - position)[self._table.stationary :]
        found = {
            "mean_error_m": float(error.mean()),
            "max_error_m": float(error.max()),
            "true_mean_error_m": float(np.hypot(*apart.T).mean()),
            "coverage_cost": float(exact.cost.sum()),
            **self._converged_s,
        }
        return found if self._rings is None else found | self._rings.density(moving)

    def series(self) -> dict[str, list[float]]:
        """Return the mean error [m] at every sample. Figures 3 and 9."""
        return {"mean_error_m": self._mean_error_m}
