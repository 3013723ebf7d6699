"""Termination: the deployment ends after several scans in which nothing could be done; and which cycles need a scan."""

from typing import Final

COVERED: Final = "covered"
CUT_OFF: Final = "cut-off"
# Cycles in a row without a scan; a scan finds robots that have died.
UNSCANNED_MAX: Final = 3

# Explanations of the outcomes other than `covered`.
GIVEN_UP: Final = {
    "depot-dry": "the depot is empty",
    "source-blocked": "no robot can leave the base",
    "source-lost": "no base station answers",
    "cut-off": "no path leads to the frontier",
    "no-end": "too many cycles",
    "unproven": "a wall was not followed to its end",
}


class QuiescenceDetector:
    """The termination service. With noise a single scan may miss a frontier, so several quiet scans are needed."""

    def __init__(self, scans: int = 2) -> None:
        self._scans = scans
        self._quiet = 0

    def judge(self, assigned: bool, frontier: bool) -> str:
        """Return `covered`, or `cut-off` if a frontier is left without a path, or an empty string while it goes on."""
        self._quiet = 0 if assigned else self._quiet + 1
        if self._quiet < self._scans:
            return ""
        return CUT_OFF if frontier else COVERED


class ScanSchedule:
    """Decides which cycles begin with a scan. `unscanned` counts the cycles since the latest one."""

    def __init__(self) -> None:
        self.unscanned = 0

    def end_cycle(self, pushes: int, stopped: int) -> None:
        """Do without the next scan if walls stopped all pushes, because then all robots stand where they stood before."""
        idle = 0 < pushes == stopped and self.unscanned < UNSCANNED_MAX
        self.unscanned = self.unscanned + 1 if idle else 0

    def scan_next(self) -> None:
        """Begin the next cycle with a scan."""
        self.unscanned = 0
