"""What a person sees of a run on the terminal: progress bars, and tables at the end."""

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Table

from zwerm.run.result import RunResult
from zwerm.scenario.tables import Scenario


class RunProgress:
    """A run's progress on `console`: robots that have joined, then ticks. A quiet one shows nothing."""

    def __init__(self, console: Console, name: str, quiet: bool = False) -> None:
        self._name = name
        self._progress = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            TextColumn("{task.fields[unit]}"),
            TimeRemainingColumn(),
            console=console,
            disable=quiet,
        )
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def joined(self, count: int, total: int) -> None:
        """Show that `count` of `total` robots have joined."""
        self._show(f"{self._name}: robots", "joined", count, total)

    def ticked(self, tick: int, ticks: int) -> None:
        """Show that `tick` of `ticks` are done."""
        self._show(self._name, "ticks", tick, ticks)

    def covered(self, fraction: float, robots: int) -> None:
        """Show how much of the arena is in sight, and of how many robots."""
        self._show(f"{self._name}: in sight", f"% of the arena, of {robots} robots", round(100.0 * fraction, 1), 100)

    def shrunk(self, tried: int, faults: int) -> None:
        """Show how many runs were tried, and how many faults the smallest failing schedule has."""
        self._show(f"{self._name}: shrinking", f"runs, {faults} faults still fail", tried, None)

    def _show(self, title: str, unit: str, done: float, total: int | None) -> None:
        task = self._tasks.get(title)
        if task is None:
            task = self._tasks[title] = self._progress.add_task(title, total=total, unit=unit)
        self._progress.update(task, completed=done, unit=unit)


def print_scenarios(console: Console, scenarios: Sequence[Scenario]) -> None:
    """Print the built-in scenarios as a table."""
    table = Table(box=None, padding=(0, 2, 0, 0), title_justify="left")
    table.add_column("scenario", style="bold", no_wrap=True)
    table.add_column("robots", justify="right")
    table.add_column("duration", justify="right")
    table.add_column("what it is")
    for each in scenarios:
        table.add_row(each.name, str(each.robots.count), f"{each.time.duration_s:g} s", each.summary)
    console.print(table)


def print_result(console: Console, result: RunResult, drawn: Sequence[Path]) -> None:
    """Print what became of a run, its metrics, its packets, and where its pictures are."""
    table = Table(title=result.title, title_justify="left", show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    rate = result.robot_ticks / result.wall_s if result.wall_s else 0.0
    table.add_row("outcome", result.outcome)
    for name, value in result.metrics.items():
        table.add_row(name, f"{value:.4g}")
    if result.radio["sent"]:
        radio = result.radio
        lost = ", ".join(f"{count} {cause}" for cause, count in radio["dropped"].items()) or "none"
        table.add_row(
            "radio packets",
            f"{radio['sent']} sent = {radio['delivered']} delivered + {radio['in_flight']} in flight + dropped: {lost}",
        )
        if radio["copies"] or radio["damaged"]:
            table.add_row("of them", f"{radio['copies']} copies made on the way, {radio['damaged']} delivered damaged")
    table.add_row("lost by the middleware", str(result.middleware_lost))
    if result.refused:
        table.add_row("refused", ", ".join(f"{count} {reason}" for reason, count in sorted(result.refused.items())))
    if result.crashed:
        table.add_row("crashed", ", ".join(map(str, result.crashed)))
    for what, nodes in (("restarted", result.restarted), *result.hindered.items()):
        if nodes:
            table.add_row(what, ", ".join(map(str, nodes)))
    if result.missed_faults:
        table.add_row("faults that never came", ", ".join(result.missed_faults))
    table.add_row("wall time", f"{result.wall_s:.1f} s, {rate:,.0f} robot-ticks/s, {result.runner}")
    table.add_row("trace", result.trace)
    for path in drawn:
        table.add_row({".png": "picture", ".toml": "faults drawn"}.get(path.suffix, "animation"), str(path))
    console.print(table)
