"""Progress and result tables of a study on the terminal."""

import math
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from zwerm.study.summary import Results, SummaryLine

# Period of the speed estimate: trials are long and differ in length.
_ESTIMATE_S = 600.0
_REASONS_SHOWN = 5


class StudyProgress:
    """Progress of a study on `console`: trials done, failed and remaining. Shows nothing if `quiet`."""

    def __init__(self, console: Console, name: str, quiet: bool = False) -> None:
        self._progress = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            TextColumn("trials{task.fields[failed]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            speed_estimate_period=_ESTIMATE_S,
            disable=quiet,
        )
        self._name = name
        self._failed = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._progress.live.is_started:
            self._progress.stop()

    def begin(self, total: int) -> None:
        """Start the progress bar of `total` trials."""
        self._progress.start()
        self._task = self._progress.add_task(self._name, total=total, failed="")

    def ended(self, failed: bool) -> None:
        """Count an ended trial."""
        self._failed += failed
        note = f", [red]{self._failed} failed[/red]" if self._failed else ""
        self._progress.update(self._task, advance=1, failed=note)


def print_results(console: Console, results: Results) -> None:
    """Print a table for each metric, with mean, interval and the paper's value of each point; then the failures."""
    study = results.study
    console.print(": ".join(filter(None, [study.name, study.table.summary])), style="bold", markup=False)
    for metric in study.table.metrics:
        console.print()
        console.print(_table(metric, [results.line(point, metric) for point in results.points], list(study.table.grid)))
    if study.table.paper.note:
        console.print(f"\nThe paper: {study.table.paper.note}", markup=False, highlight=False)
    for metric in results.unknown_metrics():
        known = ", ".join(results.known_metrics) or "none"
        console.print(f"{metric}: no trial measured it; they measured: {known}", style="red", markup=False)
    _print_failures(console, results)


def _table(metric: str, lines: Sequence[SummaryLine], axes: Sequence[str]) -> Table:
    """Return the table of one metric: variant and settings, measured values, the paper's values."""
    named = any(line.variant for line in lines)
    compared = any(line.published for line in lines)
    table = Table(title=metric, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    for heading in [*(["variant"] if named else []), *axes]:
        table.add_column(heading, overflow="fold")
    for heading in ["n", "mean", "± 95 %", "sd", *(["paper", "difference", ""] if compared else [])]:
        table.add_column(heading, justify="right", no_wrap=True)
    for line in lines:
        point = [*([line.variant] if named else []), *(f"{value}" for value in line.settings.values())]
        table.add_row(*point, *_measured_cells(line), *(_paper_cells(line) if compared else []))
    return table


def _print_failures(console: Console, results: Results) -> None:
    total = results.failures.total()
    if not total:
        return
    console.print(f"{total} trial{'s' if total > 1 else ''} failed:", style="red")
    for reason, count in results.failures.most_common(_REASONS_SHOWN):
        console.print(f"  {count} x {reason}", style="red", markup=False, highlight=False, soft_wrap=True)
    if len(results.failures) > _REASONS_SHOWN:
        console.print(f"  and {len(results.failures) - _REASONS_SHOWN} other reasons", style="red")


def _measured_cells(line: SummaryLine) -> list[str]:
    n, *numbers = line.sample.n, line.sample.mean, line.sample.half_width, line.sample.sd
    return [str(n), *map(_readable, numbers)]


def _readable(number: float) -> str:
    """Return a number with four decimals, or three digits if it is below 0.01."""
    if math.isnan(number):
        return "-"
    return f"{number:.4f}" if number == 0.0 or abs(number) >= 0.01 else f"{number:.3g}"


def _paper_cells(line: SummaryLine) -> list[str]:
    if line.paper is None:
        return ["", "", ""]
    verdict = {True: "[green]within", False: "[bold red]OUTSIDE", None: "?"}[line.agrees]
    difference = "-" if line.difference is None else f"{line.difference:+.4f}"
    return [f"{'>= ' if line.is_bound else ''}{line.paper:g}", difference, verdict]
