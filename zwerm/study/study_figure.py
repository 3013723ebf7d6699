"""A study as one PNG: lines over an axis of the grid, bars of variants, heat maps of cells, or series over time.

`swarm_figures` draws the figures that show robots. Bands and error bars are the 95 % interval of the mean; the paler band is
one standard deviation. Diamonds are the paper's values; triangles that point up are its lower bounds.
"""

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from zwerm.study.summary import Results, SummaryLine
from zwerm.study.swarm_figures import draw_density, draw_tracks
from zwerm.study.trial_plan import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANEL_IN: Final = (6.0, 4.2)
_CELL_IN: Final = 0.4
_TITLE_IN: Final = 0.8
_DPI: Final = 150


def draw_study(path: Path, results: Results) -> Path:
    """Draw `results` at `path` and return the path. The kind of figure is the study's, or follows from its axes."""
    from matplotlib.figure import Figure

    table = results.study.table
    kind = table.picture
    if kind is None:
        numeric = bool(table.grid) and all(
            not isinstance(value, str | bool) for value in next(iter(table.grid.values()))
        )
        kind = "series" if table.series else "line" if numeric else "bars"
    figure = Figure(dpi=_DPI, layout="constrained")
    _DRAW[kind](figure, results)
    figure.suptitle("\n".join(textwrap.wrap(table.summary or table.name, 60)))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    return path


def _lines(figure: "Figure", results: Results) -> None:
    """Draw one panel a metric: its mean over the first axis of the grid, one line for each variant and other setting."""
    metrics = results.study.table.metrics
    axis = next(iter(results.study.table.grid))
    panels = _panels(figure, len(metrics), len(metrics))
    for panel, metric in zip(panels, metrics, strict=True):
        curves: dict[str, list[SummaryLine]] = {}
        for point in results.points:
            others = {name: value for name, value in point.settings.items() if name != axis}
            curves.setdefault(label(point.variant, others), []).append(results.line(point, metric))
        for number, (name, lines) in enumerate(curves.items()):
            color = f"C{number % 10}"
            x = np.array([line.settings[axis] for line in lines], dtype=np.float64)
            mean, sd, half = (np.array([line.sample[field] for line in lines]) for field in (1, 2, 3))
            panel.fill_between(x, mean - sd, mean + sd, color=color, alpha=0.12, linewidth=0)
            panel.fill_between(x, mean - half, mean + half, color=color, alpha=0.35, linewidth=0)
            panel.plot(x, mean, ".-", color=color, label=name or "ours")
            _draw_paper(panel, x.tolist(), lines, color)
        panel.set(xlabel=axis)
        _show_range(panel, metric)
        panel.grid(alpha=0.3)
        if results.study.table.paper is not None or len(curves) > 1:
            panel.legend()


def _bars(figure: "Figure", results: Results) -> None:
    """Draw one panel a metric, one bar a point."""
    metrics = results.study.table.metrics
    panels = _panels(figure, len(metrics), len(metrics))
    names = [point.label or results.study.name for point in results.points]
    for panel, metric in zip(panels, metrics, strict=True):
        lines = [results.line(point, metric) for point in results.points]
        places = list(range(len(lines)))
        half = [0.0 if math.isnan(line.sample.half_width) else line.sample.half_width for line in lines]
        means = [line.sample.mean for line in lines]
        panel.bar(places, means, yerr=half, color="C0", alpha=0.7, capsize=4, label="ours, with its 95 % interval")
        _draw_paper(panel, places, lines, "C3")
        panel.legend()
        panel.set_xticks(places, names, rotation=20, ha="right")
        _show_range(panel, metric)
        panel.grid(axis="y", alpha=0.3)


def _draw_paper(panel: "Axes", places: Sequence[float], lines: Sequence[SummaryLine], color: str) -> None:
    for marker, bound, name in (("D", False, "paper"), ("^", True, "paper: at least")):
        shown = [
            (x, line.paper)
            for x, line in zip(places, lines, strict=True)
            if line.paper is not None and line.is_bound == bound
        ]
        if shown:
            x, y = zip(*shown, strict=True)
            named = panel.get_legend_handles_labels()[1]
            text = "_" if name in named else name
            panel.plot(x, y, marker, color="white", markeredgecolor=color, markeredgewidth=1.5, zorder=5, label=text)


def _heat_maps(figure: "Figure", results: Results) -> None:
    """Draw one panel a point: the mean number of robots in each cell at the end, with one colour scale."""
    shown = [(point, cells) for point in results.points if (cells := point.scenario.metrics.cells)]
    shown = [(point, cells) for point, cells in shown if len(results.cell_counts(point))]
    means = [results.cell_counts(point).mean(axis=0).reshape(cells[::-1]) for point, cells in shown]
    highest = max((float(mean.max()) for mean in means), default=1.0)
    columns, rows = (max((cells[side] for _, cells in shown), default=1) for side in (0, 1))
    size = (max(6.0, _CELL_IN * columns), max(0.8, _CELL_IN * rows) + 0.7)
    panels = _panels(figure, max(1, len(shown)), max(1, round(18.0 / size[0])), size)
    for panel, (point, (columns, rows)), mean in zip(panels, shown, means, strict=False):
        image = panel.imshow(mean, origin="lower", cmap="viridis", vmin=0.0, vmax=highest)
        for row in range(rows):
            for column in range(columns):
                color = "black" if mean[row, column] > 0.6 * highest else "white"
                panel.text(column, row, f"{mean[row, column]:.2f}", ha="center", va="center", color=color, fontsize=6)
        number = len(results.rows(point))
        panel.set(title=f"{point.label or point.scenario.name}, {number} trials", xticks=[], yticks=[])
    if shown:
        figure.colorbar(image, ax=panels, label="mean number of robots", location="bottom", shrink=0.5)


def _series(figure: "Figure", results: Results) -> None:
    """Draw one panel a series: its mean over time with the standard deviation, one line a point."""
    names = results.study.table.series
    panels = _panels(figure, max(1, len(names)), max(1, len(names)))
    for panel, name in zip(panels, names, strict=False):
        for number, point in enumerate(results.points):
            rows = [row for row in results.rows(point) if row.get("series_time_s")]
            if not rows:
                continue
            # Runs that complete early are cut to the shortest.
            length = min(len(row["series_time_s"]) for row in rows)
            time_s = np.array(rows[0]["series_time_s"][:length])
            counts = np.array([row[f"{name}_series"][:length] for row in rows], dtype=np.float64)
            mean, sd = counts.mean(axis=0), counts.std(axis=0)
            panel.fill_between(time_s, mean - sd, mean + sd, color=f"C{number % 10}", alpha=0.2, linewidth=0)
            panel.plot(time_s, mean, color=f"C{number % 10}", label=point.label or "ours")
        # An error that decays exponentially is a line on a logarithmic axis.
        panel.set(xlabel="time_s", ylabel=name, yscale="log" if name == "mean_error_m" else "linear")
        panel.grid(alpha=0.3)
        if panel.get_legend_handles_labels()[1]:
            panel.legend()


def _panels(figure: "Figure", count: int, columns: int, size: tuple[float, float] = _PANEL_IN) -> "list[Axes]":
    """Return `count` panels of `size` [inches], row by row."""
    columns = min(count, columns)
    rows = -(-count // columns)
    figure.set_size_inches(size[0] * columns, size[1] * rows + _TITLE_IN)
    panels: list[Axes] = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for empty in panels[count:]:
        empty.set_axis_off()
    return panels[:count]


def _show_range(panel: "Axes", metric: str) -> None:
    """Label the axis; limit it to [0, 1] for a fraction, because few trials make wide intervals."""
    panel.set(ylabel=metric)
    if metric.endswith("_fraction"):
        panel.set_ylim(0.0, 1.02)


_DRAW: Final = {
    "line": _lines,
    "bars": _bars,
    "heatmap": _heat_maps,
    "series": _series,
    "tracks": draw_tracks,
    "density": draw_density,
}
