"""Draw the figures of stored measurements: `python docs/figures.py`, or only those that are named, as `soak.png`.

Each figure shows rows of a CSV file in `measurements/` or beside the figure, so it is drawn again from the same file.
"""

import csv
import sys
from pathlib import Path
from typing import Any, Final

from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).parent))

import _measured

FOLDER: Final = Path(__file__).parent
LOSS: Final = "compare-small-hall"
AXIS: Final = "radio.loss+uplink.loss"
STYLES: Final = {"central": ("#0072B2", "o"), "decentralised": ("#D55E00", "s")}
SOAK: Final = FOLDER / "images" / "soak.csv"  # as `benchmarks/reliability/bench_soak.py --series` writes it
SOAK_PANELS: Final = {
    "memory of the world [MB]": {"world_mb": "resident", "heap_used_mb": "heap in use"},
    "memory of a robot [MB]": {"old_robot_mb_mean": "mean of those that live on", "robot_mb_max": "largest"},
    "open descriptors": {"world_descriptors": "world", "robot_descriptors_max": "a robot, most"},
}
# Environment of landmark-based exploration: its groups of runs by the number of robots.
ENVIRONMENTS: Final = {
    "free": {10: "free", 20: "free-20", 30: "free-30"},
    "simple": {10: "simple-10", 20: "simple", 30: "simple-30"},
    "complex": {10: "complex-10", 20: "complex-20", 30: "complex"},
}
ENVIRONMENT_STYLES: Final = (("#009E73", "o"), ("#CC79A7", "s"), ("#555555", "^"))
SPEED: Final = {"iterations_to_91_5_percent_completion": "iterations to 91.5 %", "iterations": "iterations to the end"}
# Table, its axis, the label of the axis, and whether its scale is logarithmic.
RADIO: Final = (
    ("landmark-loss", AXIS, "fraction of messages lost", False),
    ("landmark-bursts", "packets", "messages lost in a burst, 0.3 of all", True),
    ("landmark-range", "radio.range_m", "range of the radio [r]", True),
)
EXPLORATION: Final = {"completion_fraction": "completion", "iterations": "iterations to the end"}
METRICS: Final = {
    "coverage_fraction": "coverage",
    "robots_deployed": "robots deployed",
    "time_to_99_percent_coverage_s": "time to 99 % coverage [s]",
    "sim_s": "duration [s]",
    "messages_per_robot_mean": "messages per robot",
    "bytes_per_robot_mean": "bytes per robot",
}


def loss_figure() -> Figure:
    """Return the comparison of the central and the decentralised variant over the fraction of messages lost."""
    found = _measured.load(LOSS)
    figure = Figure(figsize=(10.5, 6.2), layout="constrained")
    panels = figure.subplots(2, 3, sharex=True).ravel().tolist()
    for (metric, label), axes in zip(METRICS.items(), panels, strict=True):
        for variant, (colour, marker) in STYLES.items():
            _draw(
                axes,
                [row for row in found.rows if (row["variant"], row["metric"]) == (variant, metric)],
                variant,
                colour,
                marker,
            )
        axes.set_title(label, loc="left", fontsize=10)
        axes.grid(alpha=0.3)
        axes.set_ylim(bottom=0.0)
    for axes in panels[3:]:
        axes.set_xlabel("fraction of messages lost")
    panels[0].legend(frameon=False, loc="lower left")
    n = found.origin["trials"]
    figure.suptitle(
        f"Hall of 2.6 m by 2 m, {n} seeds a point; bars: 95 % interval of the mean", x=0.01, ha="left", fontsize=10
    )
    return figure


def soak_figure() -> Figure:
    """Return memory and descriptors of the world and of its robots over a long run."""
    with SOAK.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    minutes = [float(row["time_s"]) / 60.0 for row in rows]
    figure = Figure(figsize=(10.5, 3.2), layout="constrained")
    for axes, (title, columns) in zip(figure.subplots(1, 3), SOAK_PANELS.items(), strict=True):
        for (column, label), (colour, _) in zip(columns.items(), STYLES.values(), strict=False):
            axes.plot(minutes, [float(row[column]) for row in rows], color=colour, label=label)
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xlabel("minutes")
        axes.grid(alpha=0.3)
        axes.set_ylim(0.0, 1.1 * max(float(row[column]) for row in rows for column in columns))
        if len(columns) > 1:
            axes.legend(frameon=False, loc="center right", bbox_to_anchor=(1.0, 0.35))
    return figure


def _single_runs(name: str) -> list[dict[str, str]]:
    with (_measured.STORE / "single-runs" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def robots_figure() -> Figure:
    """Return the iterations of landmark exploration by the number of robots, in three environments (Fig. 9 of its paper)."""
    rows = _single_runs("landmark-numbers")
    figure = Figure(figsize=(8.6, 3.8), layout="constrained")
    for axes, (metric, title) in zip(figure.subplots(1, 2), SPEED.items(), strict=True):
        for (label, groups), (colour, marker) in zip(ENVIRONMENTS.items(), ENVIRONMENT_STYLES, strict=True):
            # A run that was stopped has reached 91.5 %, and no end.
            wanted = ("completed",) if metric == "iterations" else ("completed", "time-limit")
            found = {
                count: [float(row[metric]) for row in rows if row["group"] == group and row["outcome"] in wanted]
                for count, group in groups.items()
            }
            found = {count: values for count, values in found.items() if values}
            if len(found) > 1:
                _draw_scaling(axes, found, label, colour, marker)
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xlabel("robots")
        axes.set_xticks([10, 20, 30])
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
    figure.suptitle(
        "Points: mean; bars: least to most. Dotted: inversely proportional to the robots",
        x=0.01,
        ha="left",
        fontsize=10,
    )
    return figure


def _draw_scaling(axes: Any, found: dict[int, list[float]], label: str, colour: str, marker: str) -> None:
    mean = {count: sum(values) / len(values) for count, values in found.items()}
    below = [mean[count] - min(values) for count, values in found.items()]
    above = [max(values) - mean[count] for count, values in found.items()]
    axes.errorbar(
        list(mean),
        list(mean.values()),
        [below, above],
        label=label,
        color=colour,
        marker=marker,
        markersize=5,
        capsize=3,
    )
    first = min(mean)
    counts = range(first, max(mean) + 1)
    axes.plot(counts, [mean[first] * first / count for count in counts], color=colour, linestyle=":", linewidth=1)


def dispersion_figure() -> Figure:
    """Return completion and iterations with minimal effort by the dispersion of landmarks (Fig. 14 of the paper)."""
    rows = _single_runs("landmark-dispersion")
    paper = {
        float(row["scatter.dispersion_m"]): float(row["paper"])
        for row in _measured.load("landmark-dispersion").rows
        if row["metric"] == "completion_fraction"
    }
    levels = sorted(paper)
    figure = Figure(figsize=(8.6, 3.8), layout="constrained")
    completion, iterations = figure.subplots(1, 2)
    for axes, metric in ((completion, "completion_fraction"), (iterations, "iterations")):
        # A run that was stopped has no end.
        wanted = ("completed",) if metric == "iterations" else ("completed", "time-limit")
        some = [row for row in rows if row["outcome"] in wanted]
        axes.boxplot(
            [[float(row[metric]) for row in some if float(row["dispersion_m"]) == level] for level in levels],
            tick_labels=[f"{level:.2f} r" for level in levels],
            medianprops={"color": "#D55E00"},
        )
        axes.set_title(EXPLORATION[metric], loc="left", fontsize=10)
        axes.set_xlabel("dispersion of the landmarks")
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3, axis="y")
    places = range(1, len(levels) + 1)
    completion.plot(
        places, [paper[each] for each in levels], "x", color="#0072B2", label="mean of the paper", markersize=8
    )
    completion.set_ylim(top=1.02)
    completion.legend(frameon=False, loc="lower left")
    figure.suptitle(f"Minimal effort, {len(rows) // len(levels)} runs a box", x=0.01, ha="left", fontsize=10)
    return figure


def radio_figure() -> Figure:
    """Return completion and iterations of landmark exploration over loss, length of bursts and range of the radio."""
    figure = Figure(figsize=(10.5, 5.8), layout="constrained")
    panels = figure.subplots(2, len(RADIO), sharey="row", sharex="col")
    for column, (name, axis, label, is_log) in enumerate(RADIO):
        found = _measured.load(name)
        for axes, metric in zip(panels[:, column], EXPLORATION, strict=True):
            for variant, (colour, marker) in STYLES.items():
                some = [
                    row
                    for row in found.rows
                    if row["metric"] == metric and (row["variant"] or "decentralised") == variant
                ]
                if some:
                    _draw(axes, some, variant, colour, marker, axis)
                else:  # the channel of the coordinator has no range
                    axes.axhline(_mean_without_loss(metric, variant), color=colour, linestyle="--", label=variant)
            axes.grid(alpha=0.3)
            if is_log:
                ticks = sorted({float(row[axis]) for row in found.rows})
                axes.set_xscale("log")
                axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
                axes.minorticks_off()
        panels[0, column].set_title(f"{found.origin['trials']} runs a point", loc="left", fontsize=10)
        panels[1, column].set_xlabel(label)
    for axes, title in zip(panels[:, 0], EXPLORATION.values(), strict=True):
        axes.set_ylabel(title)
    panels[0, 0].set_ylim(0.9, 1.0)
    panels[1, 0].set_ylim(bottom=0.0)
    panels[1, 0].legend(frameon=False, loc="upper left")
    figure.suptitle("landmark-free, 10 robots; bars: 95 % interval of the mean", x=0.01, ha="left", fontsize=10)
    return figure


def _mean_without_loss(metric: str, variant: str) -> float:
    name, axis, *_ = RADIO[0]
    wanted = (metric, variant, 0.0)
    rows = _measured.load(name).rows
    return next(float(row["mean"]) for row in rows if (row["metric"], row["variant"], float(row[axis])) == wanted)


def _draw(axes: Any, rows: list[dict[str, str]], variant: str, colour: str, marker: str, axis: str = AXIS) -> None:
    x = [float(row[axis]) for row in rows]
    mean = [float(row["mean"]) for row in rows]
    half = [float(row["half_width"] or 0.0) for row in rows]
    axes.errorbar(x, mean, yerr=half, label=variant, color=colour, marker=marker, markersize=5, capsize=3)


def main() -> None:
    images = FOLDER / "images"
    figures = {
        FOLDER / "compare-loss.png": loss_figure,
        images / "soak.png": soak_figure,
        images / "landmark-robots.png": robots_figure,
        images / "landmark-dispersion.png": dispersion_figure,
        images / "landmark-radio.png": radio_figure,
    }
    asked = sys.argv[1:]
    for path, figure in figures.items():
        if not asked or path.name in asked:
            figure().savefig(path, dpi=110)
            print(path.relative_to(FOLDER.parent))


if __name__ == "__main__":
    main()
