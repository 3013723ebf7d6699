"""Coverage by position: the fraction of grid cells with a robot, and the fraction of the area near a robot. Ozdemir 2019."""

from collections.abc import Mapping
from typing import Any, ClassVar, Final

import numpy as np
import shapely

from zwerm.scenario.types import Grid, Positive
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.scene import Floats, Ints

# Segments of a quarter of the polygon that stands for a disc: its area is too small by a fraction of 2e-5.
_QUARTER_SIDES: Final = 64


def cell_counts(position: Floats, bounds: tuple[float, float, float, float], grid: tuple[int, int]) -> Ints:
    """Return (rows, columns) numbers of robots in the cells of `grid` = (columns, rows) over `bounds` [m]."""
    x0, y0, x1, y1 = bounds
    columns, rows = grid
    column = np.clip(((position[:, 0] - x0) / (x1 - x0) * columns).astype(np.int64), 0, columns - 1)
    row = np.clip(((position[:, 1] - y0) / (y1 - y0) * rows).astype(np.int64), 0, rows - 1)
    return np.bincount(row * columns + column, minlength=rows * columns).reshape(rows, columns)


def cell_coverage_fraction(counts: Ints) -> float:
    """Return the fraction of cells that hold a robot. Ozdemir 2019, eq. 2."""
    return float(np.count_nonzero(counts) / counts.size)


def area_coverage_fraction(position: Floats, radius_m: float, arena: Arena) -> float:
    """Return the fraction of the arena within `radius_m` of a robot. Ozdemir 2019, eq. 3."""
    if not len(position):
        return 0.0
    discs = shapely.buffer(shapely.points(position), radius_m, quad_segs=_QUARTER_SIDES)
    covered = shapely.intersection(shapely.union_all(discs), arena.free)
    return float(covered.area / arena.area_m2)


class CellCoverage(Metric):
    """`metrics.cells`: the fraction of the cells of a grid, [columns, rows], that hold a robot."""

    names: ClassVar[Mapping[str, str]] = {
        "cell_coverage_fraction": "cells of the grid with a robot in them, of all cells. Ozdemir 2019, eq. 2",
    }
    Parameters: ClassVar[Any] = Grid

    def __init__(self, parameters: tuple[int, int], context: MetricContext) -> None:
        self._grid = parameters
        self._bounds = context.arena.bounds
        self._fractions: list[float] = []

    def sample(self, truth: Truth) -> None:
        """Count the cells that hold a robot."""
        position = truth.scene.position[truth.scene.present]
        self._fractions.append(cell_coverage_fraction(cell_counts(position, self._bounds, self._grid)))

    def metrics(self) -> dict[str, float]:
        """Return the fraction at the end."""
        return {"cell_coverage_fraction": self._fractions[-1]}

    def series(self) -> dict[str, list[float]]:
        """Return the fraction at every sample."""
        return {"cell_coverage_fraction": self._fractions}


class AreaCoverage(Metric):
    """`metrics.coverage_radius_m`: the fraction of the arena within that distance [m] of a robot."""

    names: ClassVar[Mapping[str, str]] = {
        "area_coverage_fraction": "free area within the radius of a robot, of all free area. Ozdemir 2019, eq. 3",
    }
    Parameters: ClassVar[Any] = Positive

    def __init__(self, parameters: float, context: MetricContext) -> None:
        self._radius_m = parameters
        self._arena = context.arena
        self._fractions: list[float] = []

    def sample(self, truth: Truth) -> None:
        """Measure the covered area."""
        position = truth.scene.position[truth.scene.present]
        self._fractions.append(area_coverage_fraction(position, self._radius_m, self._arena))

    def metrics(self) -> dict[str, float]:
        """Return the fraction at the end."""
        return {"area_coverage_fraction": self._fractions[-1]}

    def series(self) -> dict[str, list[float]]:
        """Return the fraction at every sample."""
        return {"area_coverage_fraction": self._fractions}
