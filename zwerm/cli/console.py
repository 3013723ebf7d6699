"""Progress bars of a run, and the tables printed at its end."""

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Table

if TYPE_CHECKING:  # progress needs neither of them
    from zwerm.run.result import RunResult


class RunProgress:
    """Progress of a run on `console`: robots joined, then ticks done. Shows nothing if `quiet`."""

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
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.suspend()

    def suspend(self) -> None:
        """Remove the display for good: a debugger needs the terminal."""
        if self._tasks:
            self._progress.stop()

    def joined(self, count: int, total: int) -> None:
        """Show that `count` of `total` robots have joined."""
        self._show(f"{self._name}: robots", "joined", count, total)

    def ticked(self, tick: int, ticks: int) -> None:
        """Show that `tick` of `ticks` are done."""
        self._show(self._name, "ticks", tick, ticks)

    def covered(self, fraction: float, robots: int) -> None:
        """Show the fraction of the arena in sight of robots, and the number of robots."""
        self._show(f"{self._name}: in sight", f"% of the arena, of {robots} robots", round(100.0 * fraction, 1), 100)

    def shrunk(self, tried: int, faults: int) -> None:
        """Show the number of runs tried, and the number of faults in the smallest failing schedule."""
        self._show(f"{self._name}: shrinking", f"runs, {faults} faults still fail", tried, None)

    def _show(self, title: str, unit: str, done: float, total: int | None) -> None:
        task = self._tasks.get(title)
        if not self._tasks:  # an error before it leaves no empty line
            self._progress.start()
        if task is None:
            task = self._tasks[title] = self._progress.add_task(title, total=total, unit=unit)
        self._progress.update(task, completed=done, unit=unit)


# The kind of a file, by its suffix.
FILE_KINDS: Final = {
    **dict.fromkeys((".png", ".pdf", ".svg"), "picture"),
    **dict.fromkeys((".gif", ".mp4"), "animation"),
    ".toml": "faults drawn",
    ".mcap": "recording",
}


def print_file(console: Console, path: Path) -> None:
    """Print the path of a file that a run has written, and its kind."""
    console.print(f"{FILE_KINDS[path.suffix.lower()]}: {path}", markup=False, highlight=False, soft_wrap=True)


def print_result(console: Console, result: "RunResult") -> None:
    """Print the outcome of a run, its metrics and its packet counts."""
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
    console.print(table)
