"""What a person sees of a comparison on the terminal: how its runs ended, and a table for each metric."""

import math
from collections import Counter
from typing import Final

from rich.console import Console
from rich.table import Table

from zwerm.statistics import Sample
from zwerm.study.comparison import METRICS, Comparison

NOTHING: Final = "-"


def print_comparison(console: Console, comparison: Comparison) -> None:
    """Print how runs ended, then for each metric its means and the differences from the first variant, pair by pair."""
    first, *others = comparison.variants
    against = f"{', '.join(others)} against {first}"
    console.print(f"{comparison.study.name}: {against}", style="bold", markup=False, highlight=False)
    console.print("± is half the 95 % interval, of a mean or of the paired difference; * where that leaves out zero")
    console.print()
    console.print(_endings(comparison))
    for metric in comparison.metrics:
        console.print()
        console.print(_metric(comparison, metric))
    measured = set(comparison.results.known_metrics)
    for metric in comparison.study.table.metrics:
        if metric not in measured and comparison.study.table.metrics != list(METRICS):
            known = ", ".join(comparison.results.known_metrics) or "none"
            console.print(f"{metric}: no trial measured it; they measured: {known}", style="red", markup=False)


def _endings(comparison: Comparison) -> Table:
    table = _table(comparison, "how runs ended")
    for variant in comparison.variants:
        table.add_column(variant, overflow="fold")
    for place in comparison.places:
        endings = [_count(comparison.outcomes(point)) for point in place.points]
        table.add_row(*map(str, place.settings.values()), *endings)
    return table


def _count(outcomes: Counter[str]) -> str:
    return ", ".join(f"{count} {what}" for what, count in outcomes.most_common()) or NOTHING


def _metric(comparison: Comparison, metric: str) -> Table:
    table = _table(comparison, metric)
    for variant in comparison.variants:
        table.add_column(variant, justify="right", no_wrap=True)
    for variant in comparison.variants[1:]:
        table.add_column(f"{variant} - {comparison.variants[0]}", justify="right", no_wrap=True)
        table.add_column("pairs", justify="right")
    for place in comparison.places:
        means = [shown(comparison.sample(point, metric)) for point in place.points]
        beside = []
        for point in place.points[1:]:
            difference = comparison.difference(place, point, metric)
            clear = abs(difference.mean) > difference.half_width
            beside += [shown(difference, signed=True) + (" *" if clear else "  "), str(difference.n)]
        table.add_row(*map(str, place.settings.values()), *means, *beside)
    return table


def _table(comparison: Comparison, title: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    for axis in comparison.study.table.grid:
        table.add_column(axis, overflow="fold")
    return table


def shown(sample: Sample, signed: bool = False) -> str:
    """Return a mean and half its interval, to the same digit: four of the larger's."""
    if sample.n == 0:
        return NOTHING
    size = max(abs(sample.mean), 0.0 if math.isnan(sample.half_width) else sample.half_width)
    digits = 4 if size < 1.0 else max(0, 3 - math.floor(math.log10(size)))
    half = "" if math.isnan(sample.half_width) else f" ± {sample.half_width:.{digits}f}"
    mean = round(sample.mean, digits) + 0.0  # no minus before a zero
    return f"{mean:{'+' if signed else ''}.{digits}f}{half}"
