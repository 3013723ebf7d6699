"""Termination: the deployment ends after several scans in which nothing could be done."""

from typing import Final

COVERED: Final = "covered"
CUT_OFF: Final = "cut-off"


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
