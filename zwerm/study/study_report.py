"""What a person sees of a study on the terminal: its progress, and the table at its end."""

import math
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from zwerm.study.summary import Results, SummaryLine
from zwerm.study.tables import Study

# Speed is estimated over this long: a study's trials are long, and of different length.
_ESTIMATE_S = 600.0
_REASONS_SHOWN = 5


class StudyProgress:
    """A study's progress on `console`: trials done, failed and to come. A quiet one shows nothing."""

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
        """Take note that `total` trials are to be run now."""
        self._progress.start()
        self._task = self._progress.add_task(self._name, total=total, failed="")

    def ended(self, failed: bool) -> None:
        """Take note that a trial has ended."""
        self._failed += failed
        note = f", [red]{self._failed} failed[/red]" if self._failed else ""
        self._progress.update(self._task, advance=1, failed=note)


def print_studies(console: Console, studies: list[Study]) -> None:
    """Print the built-in studies as a table."""
    table = Table(box=None, padding=(0, 2, 0, 0), title_justify="left")
    table.add_column("study", style="bold", no_wrap=True)
    table.add_column("trials", justify="right")
    table.add_column("what it is")
    for study in studies:
        grid = math.prod(len(axis) for axis in study.table.grid.values())
        trials = len(study.variants) * grid * len(study.table.seeds)
        table.add_row(study.name, str(trials), study.table.summary)
    console.print(table)


def print_results(console: Console, results: Results) -> None:
    """Print a table for each metric, each point with its mean, interval and paper's value; then what went wrong."""
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
    """Return a table of one metric: who and where, ours, the paper's."""
    named = any(line.variant for line in lines)
    compared = any(line.published for line in lines)
    table = Table(title=metric, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    for heading in [*(["variant"] if named else []), *axes]:
        table.add_column(heading, overflow="fold")
    for heading in ["n", "mean", "± 95 %", "sd", *(["paper", "difference", ""] if compared else [])]:
        table.add_column(heading, justify="right", no_wrap=True)
    for line in lines:
        who = [*([line.variant] if named else []), *(f"{value}" for value in line.settings.values())]
        table.add_row(*who, *_ours(line), *(_theirs(line) if compared else []))
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


def _ours(line: SummaryLine) -> list[str]:
    n, *numbers = line.sample.n, line.sample.mean, line.sample.half_width, line.sample.sd
    return [str(n), *map(_readable, numbers)]


def _readable(number: float) -> str:
    """Return four decimals, or three digits of what is too small for them."""
    if math.isnan(number):
        return "-"
    return f"{number:.4f}" if number == 0.0 or abs(number) >= 0.01 else f"{number:.3g}"


def _theirs(line: SummaryLine) -> list[str]:
    if line.paper is None:
        return ["", "", ""]
    verdict = {True: "[green]within", False: "[bold red]OUTSIDE", None: "?"}[line.agrees]
    difference = "-" if line.difference is None else f"{line.difference:+.4f}"
    return [f"{'>= ' if line.is_bound else ''}{line.paper:g}", difference, verdict]
