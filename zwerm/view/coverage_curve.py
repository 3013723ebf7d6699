"""The plot below a picture: the fraction of the arena in sight and the number of robots, over stages or time.

Importing this module needs matplotlib.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from zwerm.view.canvas import BLUE, OUTSIDE, QUIET, VERMILLION
from zwerm.world.scene import Floats

COVERED, ROBOTS = BLUE, VERMILLION


class CoverageCurve(NamedTuple):
    """The curves of one run over k samples: over stages where the run has stages, else over time [s]."""

    time_s: Floats  # (k,) [s]
    x: Floats  # (k,)
    xlabel: str
    fraction: Floats  # (k,) of the arena
    robots: Floats  # (k,)
    ideal: float | None = None  # number of robots of an ideal packing

    def at(self, time_s: float) -> tuple[float, float]:
        """Return x and the covered fraction at a time [s], linear between samples."""
        return float(np.interp(time_s, self.time_s, self.x)), float(np.interp(time_s, self.time_s, self.fraction))


def coverage_curve(
    series: Mapping[str, Sequence[float]],
    stages: Sequence[tuple[float, int]],
    stage_name: str,
    ideal: float | None = None,
) -> CoverageCurve | None:
    """Return the curve of a run's series, or None where its coverage was not measured.

    `stages` are (time [s], number); `stage_name` labels their axis.
    """
    if "coverage_fraction" not in series:
        return None
    time_s, fraction, robots = (np.array(series[name]) for name in ("time_s", "coverage_fraction", "robots_deployed"))
    if not stages:
        return CoverageCurve(time_s, time_s, "time [s]", fraction, robots, ideal)
    at_s, number = zip(*stages, strict=True)
    return CoverageCurve(time_s, np.interp(time_s, at_s, number, left=0.0), stage_name, fraction, robots, ideal)


def draw_curve(axes: Axes, curve: CoverageCurve) -> Line2D:
    """Draw the curves into `axes`, and return the line that marks a moment, which is still invisible."""
    beside = axes.twinx()
    axes.plot(curve.x, 100.0 * curve.fraction, color=COVERED, linewidth=1.6)
    beside.plot(curve.x, curve.robots, color=ROBOTS, linewidth=1.4, linestyle=(0, (4, 1.5)))
    if curve.ideal is not None:
        beside.axhline(curve.ideal, color=ROBOTS, linewidth=0.8, linestyle=":")
        label = f"{curve.ideal:.0f} in an ideal hexagonal packing"
        beside.annotate(
            label, (0.0, curve.ideal), xycoords=("axes fraction", "data"), textcoords="offset points",
            xytext=(3, 2), ha="left", fontsize=7.5, color=ROBOTS,
        )  # fmt: skip
    axes.set_xlabel(curve.xlabel, color=QUIET)
    axes.set_ylabel("in sight [%]", color=COVERED)
    beside.set_ylabel("robots", color=ROBOTS)
    axes.set_ylim(0.0, 104.0)
    beside.set_ylim(0.0, 1.25 * max(float(curve.robots.max()), curve.ideal or 1.0))
    axes.set_xlim(0.0, max(float(curve.x.max()), 1e-9))
    axes.grid(color=OUTSIDE, linewidth=0.8)
    axes.set_axisbelow(True)
    for each in (axes, beside):
        each.tick_params(colors=QUIET, labelsize=8.5, length=3)
        for spine in each.spines.values():
            spine.set_visible(False)
    mark: Line2D = axes.axvline(0.0, color=QUIET, linewidth=1.2, visible=False)
    return mark
