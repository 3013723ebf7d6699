"""How a swarm fills its arena, as a plot: what is in sight and how many robots there are, by deployment cycle or by time.

Importing this module needs matplotlib, which comes with the `study` extra.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from zwerm.view.canvas import BLUE, OUTSIDE, QUIET, VERMILLION
from zwerm.view.snapshots import Snapshot
from zwerm.world.scene import Floats

COVERED, ROBOTS = BLUE, VERMILLION


class CoverageCurve(NamedTuple):
    """The curves of one run over k looks, by cycle where there are cycles, else by time [s]."""

    time_s: Floats  # (k,) [s]
    x: Floats  # (k,)
    xlabel: str
    fraction: Floats  # (k,) of the arena
    robots: Floats  # (k,)
    ideal: float | None = None  # how many robots an ideal packing has

    def at(self, time_s: float) -> tuple[float, float]:
        """Return x and the fraction covered at a time, between looks on a straight line."""
        return float(np.interp(time_s, self.time_s, self.x)), float(np.interp(time_s, self.time_s, self.fraction))


def growth(
    series: Mapping[str, Sequence[float]], stages: Sequence[Snapshot], ideal: float | None = None
) -> CoverageCurve | None:
    """Return the growth that a run's series tell of; None where its coverage was not looked at."""
    if "coverage_fraction" not in series:
        return None
    time_s, fraction, robots = (np.array(series[name]) for name in ("time_s", "coverage_fraction", "robots_deployed"))
    if not stages:
        return CoverageCurve(time_s, time_s, "time [s]", fraction, robots, ideal)
    cycle = np.interp(time_s, [each.time_s for each in stages], [each.cycle or 0 for each in stages], left=0.0)
    return CoverageCurve(time_s, cycle, "deployment cycle", fraction, robots, ideal)


def draw_growth(axes: Axes, grown: CoverageCurve) -> Line2D:
    """Draw the curves into `axes`, and return the line that marks a moment; it is not shown yet."""
    beside = axes.twinx()
    axes.plot(grown.x, 100.0 * grown.fraction, color=COVERED, linewidth=1.6)
    beside.plot(grown.x, grown.robots, color=ROBOTS, linewidth=1.4, linestyle=(0, (4, 1.5)))
    if grown.ideal is not None:
        beside.axhline(grown.ideal, color=ROBOTS, linewidth=0.8, linestyle=":")
        label = f"{grown.ideal:.0f} would do in hexagonal packing"
        beside.annotate(
            label, (0.0, grown.ideal), xycoords=("axes fraction", "data"), textcoords="offset points",
            xytext=(3, 2), ha="left", fontsize=7.5, color=ROBOTS,
        )  # fmt: skip
    axes.set_xlabel(grown.xlabel, color=QUIET)
    axes.set_ylabel("in sight [%]", color=COVERED)
    beside.set_ylabel("robots", color=ROBOTS)
    axes.set_ylim(0.0, 104.0)
    beside.set_ylim(0.0, 1.25 * max(float(grown.robots.max()), grown.ideal or 1.0))
    axes.set_xlim(0.0, max(float(grown.x.max()), 1e-9))
    axes.grid(color=OUTSIDE, linewidth=0.8)
    axes.set_axisbelow(True)
    for each in (axes, beside):
        each.tick_params(colors=QUIET, labelsize=8.5, length=3)
        for spine in each.spines.values():
            spine.set_visible(False)
    mark: Line2D = axes.axvline(0.0, color=QUIET, linewidth=1.2, visible=False)
    return mark
