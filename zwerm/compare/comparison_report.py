"""Tables of a comparison on the terminal: outcomes of the runs, and one table for each metric."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

from rich.console import Console
from rich.table import Table

from zwerm.compare.comparison import METRICS, Comparison, SweepPoint
from zwerm.maths.statistics import Sample

NOTHING: Final = "-"
# Characters between columns, and the width above which a cell of an axis is folded.
GAP: Final = 2
AXIS_WIDTH_MAX: Final = 24
# Width of the longest outcome.
ENDING_WIDTH_MIN: Final = 12


def print_comparison(console: Console, comparison: Comparison) -> None:
    """Print the outcomes, then for each metric its means and its paired differences from the first variant."""
    first, *others = comparison.variants
    against = f"{', '.join(others)} against {first}"
    console.print(f"{comparison.study.name}: {against}", style="bold", markup=False, highlight=False)
    console.print("± is half the 95 % interval of a mean or of the paired difference; * if it excludes zero")
    console.print()
    for table in _endings(comparison, console.width):
        console.print(table)
    for metric in comparison.metrics:
        console.print()
        for table in _metric(comparison, metric, console.width):
            console.print(table)
    measured = set(comparison.results.known_metrics)
    for metric in comparison.study.table.metrics:
        if metric not in measured and comparison.study.table.metrics != list(METRICS):
            known = ", ".join(comparison.results.known_metrics) or "none"
            console.print(f"{metric}: no trial measured it; they measured: {known}", style="red", markup=False)


def _endings(comparison: Comparison, width: int) -> list[Table]:
    """Return the table of outcomes, split by columns if it is wider than the terminal."""
    tables: list[Table] = []
    widths = [max(len(variant), ENDING_WIDTH_MIN) + GAP for variant in comparison.variants]
    for group in _groups(widths, _room(comparison, width)):
        table = _table("" if tables else "outcomes")
        _add_axes(table, comparison)
        for k in group:
            table.add_column(comparison.variants[k], overflow="fold", min_width=widths[k] - GAP)
        for place in comparison.places:
            endings = [_count(comparison.outcomes(place.points[k])) for k in group]
            table.add_row(*map(str, place.settings.values()), *endings)
        tables.append(table)
    return tables


def _count(outcomes: Counter[str]) -> str:
    return ", ".join(f"{count} {what}" for what, count in outcomes.most_common()) or NOTHING


class _Columns(NamedTuple):
    """Columns that stay together, and their cells by row."""

    headers: tuple[str, ...]
    rows: list[tuple[str, ...]]

    @property
    def width(self) -> int:
        lines = [[header.splitlines() for header in self.headers], *([[each] for each in row] for row in self.rows)]
        return sum(max(len(line) for row in lines for line in row[k]) + GAP for k in range(len(self.headers)))


def _metric(comparison: Comparison, metric: str, width: int) -> list[Table]:
    """Return the table of a metric, split by columns if it is wider than the terminal."""
    room = _room(comparison, width)
    columns = _columns(comparison, metric, " - ")
    if sum(each.width for each in columns) > room:
        columns = _columns(comparison, metric, "\n- ")
    tables: list[Table] = []
    for group in _groups([each.width for each in columns], room):
        table = _table("" if tables else metric)
        _add_axes(table, comparison)
        for header in (header for k in group for header in columns[k].headers):
            table.add_column(header, justify="right", no_wrap=True)
        for row, place in enumerate(comparison.places):
            table.add_row(*map(str, place.settings.values()), *(cell for k in group for cell in columns[k].rows[row]))
        tables.append(table)
    return tables


def _columns(comparison: Comparison, metric: str, less: str) -> list[_Columns]:
    """Return the columns of means and of differences from the first variant; `less` joins the names in a header."""
    places, (first, *others) = comparison.places, comparison.variants
    means = [
        _Columns((variant,), [(shown(comparison.sample(place.points[k], metric)),) for place in places])
        for k, variant in enumerate(comparison.variants)
    ]
    differences = [
        _Columns(
            (f"{variant}{less}{first}", "pairs"), [_difference_cells(comparison, place, k, metric) for place in places]
        )
        for k, variant in enumerate(others, 1)
    ]
    return [*means, *differences]


def _difference_cells(comparison: Comparison, place: SweepPoint, k: int, metric: str) -> tuple[str, str]:
    """Return the k-th variant's difference from the first at a place, and the number of pairs."""
    difference = comparison.difference(place, place.points[k], metric)
    clear = abs(difference.mean) > difference.half_width
    return shown(difference, signed=True) + (" *" if clear else "  "), str(difference.n)


def _groups(widths: Sequence[int], room: int) -> list[list[int]]:
    """Return the indices of `widths` in groups that fit into `room`; a single column may be wider."""
    groups: list[list[int]] = [[]]
    for k, width in enumerate(widths):
        if groups[-1] and sum(widths[each] for each in groups[-1]) + width > room:
            groups.append([])
        groups[-1].append(k)
    return groups


def _room(comparison: Comparison, width: int) -> int:
    """Return the part of `width` that the columns of axes leave free."""
    return width - sum(_axis_width(comparison, number) + GAP for number in range(len(comparison.study.table.grid)))


def _table(title: str) -> Table:
    return Table(title=title or None, title_justify="left", title_style="bold", box=None, padding=(0, GAP, 0, 0))


def _add_axes(table: Table, comparison: Comparison) -> None:
    """Add a column for each axis, as wide as its values; wider values than AXIS_WIDTH_MAX are folded."""
    for number, axis in enumerate(comparison.study.table.grid):
        table.add_column(_broken(axis), overflow="fold", width=_axis_width(comparison, number))


def _axis_width(comparison: Comparison, number: int) -> int:
    axis = list(comparison.study.table.grid)[number]
    values = [str(list(place.settings.values())[number]) for place in comparison.places]
    return min(AXIS_WIDTH_MAX, max(map(len, [*_broken(axis).splitlines(), *values])))


def _broken(axis: str) -> str:
    """Return the name of an axis, broken before each `+`, and after dots if it is long."""
    lines = axis.replace("+", "\n+").splitlines()
    return "\n".join(each if len(each) <= AXIS_WIDTH_MAX else each.replace(".", ".\n") for each in lines)


def shown(sample: Sample, signed: bool = False) -> str:
    """Return a mean and half its interval, both with the decimals of four digits of the larger."""
    if sample.n == 0:
        return NOTHING
    size = max(abs(sample.mean), 0.0 if math.isnan(sample.half_width) else sample.half_width)
    digits = 4 if size < 1.0 else max(0, 3 - math.floor(math.log10(size)))
    half = "" if math.isnan(sample.half_width) else f" ± {sample.half_width:.{digits}f}"
    mean = round(sample.mean, digits) + 0.0  # no minus before a zero
    return f"{mean:{'+' if signed else ''}.{digits}f}{half}"
