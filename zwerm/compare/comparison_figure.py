"""A comparison as a figure: each metric over the first sweep, each variant with its 95 % interval.

A panel of paired differences from the first variant is below each panel of means. Markers are hollow if not all runs have a
value. A marker stands at its value of the sweep; variants stand beside each other only where the values are not numbers. With
several sweeps there is one figure for each combination of the other sweeps' values.
"""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from zwerm.compare.comparison import COMPLETED, Comparison, SweepPoint
from zwerm.maths.statistics import Sample
from zwerm.study.study_tables import Setting
from zwerm.study.trial_plan import Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours (2008), with a marker each, so that variants differ in grey too.
STYLES: Final = (("#0072B2", "o"), ("#D55E00", "s"), ("#009E73", "^"), ("#CC79A7", "D"), ("#E69F00", "v"))
# Default metrics of the figure: from each row the first that was measured.
SHOWN: Final = (
    ("coverage_fraction", "cell_coverage_fraction", "area_coverage_fraction", "mean_error_m", "robots_done_fraction"),
    ("robots_deployed", "coverage_cost"),
    ("time_to_90_percent_coverage_s", "convergence_time_s", "deployment_cycles", "sim_s"),
    ("messages_per_robot_mean",),
    ("bytes_per_robot_mean",),
)
UNITS: Final = {"_m_s": " [m/s]", "_m2": " [m²]", "_m": " [m]", "_s": " [s]", "_fraction": " [fraction]"}
LABELS: Final = {COMPLETED: "runs completed [fraction]", "sim_s": "duration of the run [s]"}
COLUMNS: Final = 3
PANEL_IN: Final = (3.5, 3.6)
HEAD_IN: Final = 0.78
LINE_IN: Final = 0.17  # of the explanation and the legend
CHARACTER_IN: Final = 0.068  # width of a character, a little too large
HANDLE_IN: Final = 0.75  # of the legend, with the space around it
FOOT_IN: Final = 0.3
DODGE: Final = 0.12
DPI: Final = 200


def draw_comparison(path: Path, comparison: Comparison, metrics: Sequence[str] = ()) -> list[Path]:
    """Draw the comparison at `path` (.png, .pdf or .svg), and return the paths of all figures.

    `metrics` are the metrics to show, by default a choice of the measured ones.
    """
    by_rest: dict[tuple[tuple[str, Setting], ...], list[SweepPoint]] = {}
    for place in comparison.places:
        by_rest.setdefault(tuple(place.settings.items())[1:], []).append(place)
    chosen = [each for each in metrics if each in comparison.metrics] or _choice(comparison)
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn = []
    for rest, places in by_rest.items():
        subtitle = ", ".join(f"{axis} = {value}" for axis, value in rest)
        suffix = re.sub(r"[^A-Za-z0-9.=_-]+", "-", "".join(f"-{axis}={value}" for axis, value in rest))[:100]
        drawn.append(path.with_name(f"{path.stem}{suffix}{path.suffix}"))
        _draw(comparison, _in_order(places), [*chosen, COMPLETED], subtitle).savefig(drawn[-1], dpi=DPI)
    return drawn


def _choice(comparison: Comparison) -> list[str]:
    found = [next((each for each in names if each in comparison.metrics), None) for names in SHOWN]
    return [each for each in found if each is not None] or comparison.metrics[:COLUMNS]


def _draw(comparison: Comparison, places: Sequence[SweepPoint], metrics: Sequence[str], subtitle: str) -> "Figure":
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(metrics))
    rows = math.ceil(len(metrics) / columns)
    width = PANEL_IN[0] * columns
    seeds = sorted({seed for place in places for point in place.points for seed in comparison.seeds(point)})
    about = f"{len(seeds)} seeds a point" if len(seeds) > 1 else "one seed a point"
    explained = fill(
        f"{about}; means with their 95 % intervals; below, the difference from {comparison.variants[0]}, paired by seed. "
        "A failed run counts with its measured values.",
        int(width / CHARACTER_IN),
    )
    labelled = max(1, int(width / (HANDLE_IN + CHARACTER_IN * max(map(len, comparison.variants)))))
    lines = explained.count("\n") + math.ceil(len(comparison.variants) / labelled)
    head = HEAD_IN + LINE_IN * lines
    size = (width, PANEL_IN[1] * rows + head + FOOT_IN)
    figure = Figure(figsize=size)
    below_head = (0.0, FOOT_IN / size[1], 1.0, 1.0 - (head + FOOT_IN) / size[1])
    figure.set_layout_engine("constrained", rect=below_head, wspace=0.04)
    blocks = figure.subfigures(rows, columns, squeeze=False).ravel().tolist()
    for metric, block in zip(metrics, blocks, strict=False):
        above, under = block.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
        _draw_metric(above, under, comparison, places, metric)
    handles, labels = above.get_legend_handles_labels()
    top = 1.0 - 0.12 / size[1]
    scenario = comparison.places[0].points[0].scenario
    title = ": ".join(filter(None, [scenario.name, subtitle]))
    figure.text(0.01, top, title, va="top", fontsize=12, fontweight="bold")
    figure.text(0.01, top - 0.27 / size[1], explained, va="top", fontsize=9)
    below = top - (0.42 + LINE_IN * explained.count("\n")) / size[1]
    figure.legend(
        handles, labels, loc="upper left", bbox_to_anchor=(0.0, below), ncols=min(labelled, len(labels)), frameon=False
    )
    if _some_missing(comparison, places, metrics):
        figure.text(
            0.01,
            0.08 / size[1],
            "Hollow or missing: not every run, or none, has a value.",
            va="bottom",
            fontsize=9,
        )
    return figure


def _draw_metric(
    above: "Axes", below: "Axes", comparison: Comparison, places: Sequence[SweepPoint], metric: str
) -> None:
    x, ticks = _axis(places)
    below.axhline(0.0, color="0.4", linewidth=0.8)
    count = len(comparison.variants)
    for number, variant in enumerate(comparison.variants):
        colour, marker = STYLES[number % len(STYLES)]
        style = {
            "color": colour,
            "marker": marker,
            "markersize": 4.5,
            "linewidth": 1.3,
            # No line between values that are not numbers.
            "linestyle": "none" if ticks else "solid",
            "capsize": 2.5,
            "label": variant,
        }
        # Names of values have places beside each other; a number has its own.
        shifted = x + DODGE * (number - (count - 1) / 2.0) if ticks else x
        points = [place.points[number] for place in places]
        whole = [_all_measured(comparison, point, metric) for point in points]
        _bars(above, shifted, [comparison.sample(point, metric) for point in points], whole, style)
        if number:
            differences = [comparison.difference(place, place.points[number], metric) for place in places]
            both = [_all_measured(comparison, place.points[0], metric) for place in places]
            _bars(below, shifted, differences, [one and other for one, other in zip(whole, both, strict=True)], style)
    above.set_title(label(metric), fontsize=10)
    if metric.endswith("_fraction") or metric == COMPLETED:
        low, high = above.get_ylim()
        limits = max(-0.02, low), min(1.03, max(high, low + 0.02))
        above.set_yticks([tick for tick in above.get_yticks() if limits[0] <= tick <= 1.0 + 1e-9])
        above.set_ylim(*limits)
    below.set_ylabel("difference", fontsize=8)
    below.set_xlabel(axis_label(next(iter(places[0].settings), "")), fontsize=9)
    if ticks:
        slanted = len("".join(ticks)) > 30
        below.set_xticks(x, ticks, rotation=20 if slanted else 0, ha="right" if slanted else "center")
    for axes in (above, below):
        axes.grid(alpha=0.3)
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)


def _bars(axes: "Axes", x: Any, samples: Sequence[Sample], whole: Sequence[bool], style: Mapping[str, Any]) -> None:
    means = np.array([each.mean for each in samples])
    halves = np.nan_to_num([each.half_width for each in samples])
    axes.errorbar(x, means, halves, **style)
    hollow = np.array([not each for each in whole]) & ~np.isnan(means)
    if hollow.any():
        plain = {"color": style["color"], "marker": style["marker"], "markersize": style["markersize"]}
        axes.plot(x[hollow], means[hollow], linestyle="none", markerfacecolor="white", zorder=3, **plain)


def _axis(places: Sequence[SweepPoint]) -> tuple[Any, list[str]]:
    """Return the x coordinates of the places on the first sweep, and tick labels if it is not numeric."""
    values = [_first(place) for place in places]
    if _numeric(values):
        return np.array(values, dtype=np.float64), []
    return np.arange(len(values), dtype=np.float64), [str(each) for each in values]


def _in_order(places: Sequence[SweepPoint]) -> list[SweepPoint]:
    """Return the places in ascending order if the first sweep is numeric, else in the order given."""
    return sorted(places, key=_first) if _numeric([_first(place) for place in places]) else list(places)


def _first(place: SweepPoint) -> Any:
    return next(iter(place.settings.values()), "")


def _numeric(values: Sequence[Setting]) -> bool:
    return all(isinstance(each, int | float) and not isinstance(each, bool) for each in values)


def _all_measured(comparison: Comparison, point: Point, metric: str) -> bool:
    """Return whether every run of a point has a value."""
    return len(comparison.values(point, metric)) == len(comparison.seeds(point))


def _some_missing(comparison: Comparison, places: Sequence[SweepPoint], metrics: Sequence[str]) -> bool:
    points = [point for place in places for point in place.points]
    return any(not _all_measured(comparison, point, metric) for point in points for metric in metrics)


def axis_label(axis: str) -> str:
    """Return the axis label of a sweep: its paths, or `messages lost` if all paths are a loss."""
    return "messages lost [fraction]" if all(path.endswith(".loss") for path in axis.split("+")) else axis


def label(metric: str) -> str:
    """Return the label of a metric with its unit: `messages_per_robot_mean` is `messages per robot`."""
    if metric in LABELS:
        return LABELS[metric]
    unit = next((suffix for suffix in UNITS if metric.endswith(suffix)), "")
    name = metric.removesuffix(unit).removesuffix("_mean").replace("_percent_", " % ").replace("_", " ")
    return name + UNITS.get(unit, "")
