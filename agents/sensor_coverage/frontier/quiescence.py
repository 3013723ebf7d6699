"""When it is over."""

from typing import Final

COVERED: Final = "covered"
CUT_OFF: Final = "cut-off"


class QuiescenceDetector:
    """Over when nothing could be done, survey after survey: with noise, a frontier may be missed once."""

    def __init__(self, surveys: int = 2) -> None:
        self._surveys = surveys
        self._quiet = 0

    def judge(self, assigned: bool, frontier: bool) -> str:
        """Return `covered`, or `cut-off` where a frontier is left that no path leads to; nothing while it goes on."""
        self._quiet = 0 if assigned else self._quiet + 1
        if self._quiet < self._surveys:
            return ""
        return CUT_OFF if frontier else COVERED
