"""The result of a run whose robots leave: they may take seconds, and the user may interrupt meanwhile."""

from collections.abc import Callable
from typing import Self

from zwerm.run.result import RunResult
from zwerm.world.tick.completion import INTERRUPTED


class KeptResult:
    """A context around that of a run's swarm: an interrupt while the robots leave does not lose the result.

    `close` ends the swarm and is idempotent. An interrupt may come before the swarm's own context can hold it back. A swarm
    that stays open would keep this program from ending.
    """

    def __init__(self, close: Callable[[], object]) -> None:
        self.result: RunResult | None = None
        self._close = close

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> bool:
        if kind is None or not issubclass(kind, KeyboardInterrupt):
            return False
        self._close()
        if self.result is None:
            return False
        self.result.outcome = INTERRUPTED
        self.result.reason = f"interrupted while the robots left, after tick {self.result.ticks}"
        return True

    def end(self) -> RunResult:
        """Return the result."""
        assert self.result is not None
        return self.result
