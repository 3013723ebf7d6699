"""The coverage control algorithm as printed: a robot moves towards the estimated centroid of its own Voronoi cell.

The robot senses the positions of its neighbours, the corners of the region, and the field's value and
gradient at its place. All are in its body frame, so it needs no compass. The cache between two observations saves time
and changes no answer.

Rules for cases that the paper leaves open:
"""

from typing import Annotated, Any, ClassVar

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.maths.cached_voronoi_cell import CachedVoronoiCell
from zwerm.wire.messages import BodyVelocity, Command, Observation


class CoverageTable(Struct, frozen=True, forbid_unknown_fields=True):
    """The gain k of eq. 8 [1/s], and the error at and below which the robot is done [m]; with 0 it is never done."""

    gain_per_s: Annotated[float, Meta(gt=0.0)] = 5.0
    tolerance_m: Annotated[float, Meta(ge=0.0)] = 0.0


class VoronoiCoverage(Controller):
    """Schwager 2006, algorithm 1."""

    sensors: ClassVar[tuple[str, ...]] = ("neighbours", "boundary", "field")
    Parameters: ClassVar[type[Struct]] = CoverageTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        table: Any = self.parameters
        self._cell = CachedVoronoiCell()
        self._gain_per_s = table.gain_per_s
        self._tolerance2 = table.tolerance_m**2

    def step(self, observation: Observation) -> Command:
        """Return the velocity u = k (C_hat - p). Schwager 2006, eq. 8."""
        region, others, here = observation.boundary, observation.neighbours, observation.field
        assert region is not None
        assert others is not None
        assert here is not None
        x, y = self._cell.target(region, others, here.value, here.gradient_x, here.gradient_y)
        k = self._gain_per_s
        return Command(drive=BodyVelocity(k * x, k * y), done=x * x + y * y < self._tolerance2)
