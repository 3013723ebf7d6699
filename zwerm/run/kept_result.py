"""The result of a run whose robots leave: they may take seconds, and the user may interrupt meanwhile."""

from typing import Self

from zwerm.run.result import RunResult
from zwerm.world.tick.completion import INTERRUPTED


class KeptResult:
    """A context around the swarm of a run: an interrupt while its robots leave does not lose the result."""

    def __init__(self) -> None:
        self.result: RunResult | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> bool:
        if self.result is None or kind is None or not issubclass(kind, KeyboardInterrupt):
            return False
        self.result.outcome = INTERRUPTED
        self.result.reason = f"interrupted while the robots left, after tick {self.result.ticks}"
        return True

    def end(self) -> RunResult:
        """Return the result."""
        assert self.result is not None
        return self.result
