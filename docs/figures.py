"""Draw the figures of stored measurements: `python docs/figures.py`.

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
SOAK: Final = FOLDER / "images" / "soak.csv"  # as `benchmarks/bench_soak.py --series` writes it
SOAK_PANELS: Final = {
    "memory of the world [MB]": {"world_mb": "resident", "heap_used_mb": "heap in use"},
    "memory of a robot [MB]": {"old_robot_mb_mean": "mean of those that live on", "robot_mb_max": "largest"},
    "open descriptors": {"world_descriptors": "world", "robot_descriptors_max": "a robot, most"},
}
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


def _draw(axes: Any, rows: list[dict[str, str]], variant: str, colour: str, marker: str) -> None:
    x = [float(row[AXIS]) for row in rows]
    mean = [float(row["mean"]) for row in rows]
    half = [float(row["half_width"] or 0.0) for row in rows]
    axes.errorbar(x, mean, yerr=half, label=variant, color=colour, marker=marker, markersize=5, capsize=3)


def main() -> None:
    for path, figure in ((FOLDER / "compare-loss.png", loss_figure), (FOLDER / "images" / "soak.png", soak_figure)):
        figure().savefig(path, dpi=110)
        print(path.relative_to(FOLDER.parent))


if __name__ == "__main__":
    main()
