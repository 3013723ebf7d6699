"""Ends a run of sensor coverage early, once nearly all of its arena has been in sight for a while."""

from typing import Final

from benchmarks.common.verdicts import ENOUGH
from zwerm.run.progress import NullProgress

# The samples in a row, one every 5 s.
SAMPLES: Final = 7


class UntilInSight(NullProgress):
    """Interrupts a run once its robots have seen `ENOUGH` of the arena for half a minute: then `completed` is no false word.

    It is for runs in which only a false `completed` is looked for. Whole runs are judged without it.
    """

    def __init__(self) -> None:
        self._samples = 0

    @property
    def is_in_sight(self) -> bool:
        """Whether the run was interrupted."""
        return self._samples >= SAMPLES

    def covered(self, fraction: float, robots: int) -> None:
        """Count the samples in a row with `ENOUGH` of the arena in sight."""
        self._samples = self._samples + 1 if fraction >= ENOUGH else 0
        if self.is_in_sight:
            raise KeyboardInterrupt
