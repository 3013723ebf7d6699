"""Reports on the progress of a run: what the runner says while robots join and ticks pass."""

from typing import Protocol


class ProgressListener(Protocol):
    """Receives reports on the progress of a run."""

    def joined(self, count: int, total: int) -> None:
        """Take the report that `count` of `total` robots have joined."""

    def ticked(self, tick: int, ticks: int) -> None:
        """Take the report that `tick` of `ticks` are done."""

    def covered(self, fraction: float, robots: int) -> None:
        """Take the report that `robots` robots see a `fraction` of the arena."""


class NullProgress:
    """Ignores all reports."""

    def joined(self, count: int, total: int) -> None:
        """Ignore it."""

    def ticked(self, tick: int, ticks: int) -> None:
        """Ignore it."""

    def covered(self, fraction: float, robots: int) -> None:
        """Ignore it."""
