"""The end of a decentralised deployment: covered, by a census in which no robot is missing, or failed, with the reason.

The base takes the census when no path has led to a frontier for some time. If the census counts every released robot as
present, or as dead with a witness, and no arc stays open, all is covered. If a robot is missing, or an arc stays open after
all attempts to follow a wall there, the base lets all robots repeat the failed attempts, a few times, and then gives up:
noise and the places of other robots differ from walk to walk. It also gives up when no attempt has had success for a long
time. It never reports success because time has passed.
"""

from collections.abc import Iterable
from typing import Final

from zwerm.agents.sensor_coverage.protocols.ending.completion_census import CompletionProtocol

COVERED: Final = "covered"
UNPROVEN: Final = "unproven: a wall was not followed to its end"

# Ticks without a frontier before the census.
QUIET_TICKS: Final = 60
# Ticks that a robot may be missing, or an arc open, before a search. A robot may be down for some time, or its death may have
# no witness yet.
MISSING_TICKS: Final = 900
SEARCHES_MAX: Final = 2
# Ticks without any progress after which the base gives up.
STALLED_TICKS_MAX: Final = 9000
# Bound of the missing robots that a reason names.
NAMED_MAX: Final = 5


class Termination:
    """The base's rules for the end. Every method takes the base's own tick."""

    def __init__(self, completion: CompletionProtocol) -> None:
        self.takes_census = False
        self._completion = completion
        self._quiet_since: int | None = None
        self._unsettled_since: int | None = None
        self._progress_at: int | None = None

    def let_out(self, robots: Iterable[int]) -> None:
        """Take in the robots that were let out."""
        self._completion.let_out(robots)

    def progress(self, tick: int) -> None:
        """Record that a robot has tried to expand, or has expanded."""
        self._progress_at = tick

    def disturb(self) -> None:
        """Record that a path leads to a frontier, or may do so."""
        self._quiet_since = self._unsettled_since = None
        self.takes_census = False

    def quiet(self, tick: int, samples: int) -> str:
        """Record that no path leads to a frontier; return the outcome, or an empty string before the end."""
        if self._quiet_since is None:
            self._quiet_since = tick
        self.takes_census = tick - self._quiet_since > QUIET_TICKS + 4 * samples
        if not (self.takes_census and self._completion.concluded):
            return ""
        last, missing = self._completion.last, self._completion.missing
        if not missing and (last is None or not last.unproven):
            return COVERED
        if self._unsettled_since is None:
            self._unsettled_since = tick
        if tick - self._unsettled_since <= MISSING_TICKS:
            return ""
        if self._completion.search >= SEARCHES_MAX:
            return self._missing_robots_outcome() if missing else UNPROVEN
        self._completion.begin_search()
        self._unsettled_since = None
        self._progress_at = tick
        return ""

    def stalled(self, tick: int) -> str:
        """Return why the base gives up, if nothing has come of any attempt for a long time; else an empty string."""
        if self._progress_at is None:
            self._progress_at = tick
        if tick - self._progress_at <= STALLED_TICKS_MAX:
            return ""
        last = self._completion.last
        if last is not None and self._completion.missing:
            return self._missing_robots_outcome()
        if last is not None and last.claims > 0:
            return "cut-off: no way leads to the frontier"
        return "no-end: some robot does not know whether it stands at the frontier"

    def _missing_robots_outcome(self) -> str:
        missing = self._completion.missing
        named = ", ".join(str(each) for each in missing[:NAMED_MAX]) + (", ..." if len(missing) > NAMED_MAX else "")
        return f"somebody-missing: {len(missing)} robots neither answer nor are seen dead: {named}"
