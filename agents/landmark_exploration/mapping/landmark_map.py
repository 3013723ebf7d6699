"""The map of a robot or of the coordinator: the landmark complex and the frontiers, derived from logs.

Robots share observations, and statuses that no observation implies. All else is derived from these, by the same rules
on every robot. So maps made of the same logs are equal for every order of the logs' entries.
"""

from collections.abc import Sequence
from typing import Any, Final

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.frontier_status import ABANDONED, CLEAR, TIMED_OUT, Frontiers
from zwerm.agents.landmark_exploration.mapping.landmark_complex import LandmarkComplex
from zwerm.agents.landmark_exploration.sharing import log_entries as entries
from zwerm.agents.landmark_exploration.sharing.replica import Stretch

# Parts of one observation beyond this number are invalid, and are dropped.
_PARTS_MAX: Final = 4096

# Failures to reach a frontier, after which it counts as a potential obstacle boundary.
FAILURES_MAX: Final = 2


class LandmarkMap:
    """Complex and frontiers. `version` counts changes. Without bearings (`presence_only`) there are no frontiers."""

    def __init__(self, presence_only: bool = False) -> None:
        self._presence_only = presence_only
        self.complex = LandmarkComplex()
        self.frontiers = Frontiers()
        self.version = 0
        self._failures: dict[int, int] = {}  # frontier: the number of times a robot did not reach it
        self._parts: dict[int, list[tuple[int, int]]] = {}  # by origin, of an observation that is not complete

    def observe(self, snapshot: BearingSnapshot, rank: tuple[int, int] = (0, 0)) -> bool:
        """Add an observation; return whether it changed the map: a new simplex, or a status that rose."""
        risen = not self._presence_only and self.frontiers.note(snapshot)
        news = self.complex.update(snapshot, rank) or risen
        self.version += news
        return news

    def read(self, stretch: Stretch, held: int) -> None:
        """Add the entries of a stretch from entry number `held` on; invalid entries are ignored."""
        for number in range(held, stretch.first + len(stretch.entries)):
            self._read(stretch.origin, number, stretch.entries[number - stretch.first])

    def raise_all(self, keys: Sequence[int], status: int) -> bool:
        """Raise frontiers to a status; return whether any status rose."""
        news = [self.frontiers.raise_to(key, status) for key in keys]
        self.version += any(news)
        return any(news)

    def fail(self, key: int) -> None:
        """Record that a robot did not reach a frontier.

        The frontier is timed out after FAILURES_MAX failures of any robots, and abandoned after twice as many.
        """
        failures = self._failures[key] = self._failures.get(key, 0) + 1
        if failures >= FAILURES_MAX:
            self.raise_all([key], ABANDONED if failures >= 2 * FAILURES_MAX else TIMED_OUT)

    def _read(self, origin: int, number: int, entry: bytes) -> None:
        kind = entry[0] if entry else -1
        try:
            if kind == entries.OBSERVATION and origin not in self._parts:
                self.observe(entries.read_observation(entry), (number, origin))
                return
            if kind == entries.STATUSES:
                status, keys = entries.read_statuses(entry)
                if status <= CLEAR:
                    self.raise_all(keys, status)
                return
            if kind == entries.FAILURE:
                self.fail(entries.read_failure(entry))
                return
            bearings = entries.read_bearings(entry)
        except ValueError:
            return
        whole = [*self._parts.pop(origin, ()), *bearings]
        if kind == entries.OBSERVATION:
            self.observe(entries.snapshot_of(whole), (number, origin))
        elif len(whole) <= _PARTS_MAX:
            self._parts[origin] = whole

    def content(self) -> Any:
        """Return the content in a form that is equal for equal maps."""
        return (
            sorted(self.complex.simplices.values()),
            self.complex.table,
            sorted(self.frontiers.statuses.items()),
        )
