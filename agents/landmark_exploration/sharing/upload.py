"""The upload of a robot's log to the coordinator: new entries at once, and again from the first unacknowledged entry."""

from collections.abc import Iterator
from typing import Final

from zwerm.agents.landmark_exploration.sharing.landmark_messages import Entries, Vector
from zwerm.agents.landmark_exploration.sharing.packing import counts_of, pack_entries
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch

# Ticks without an acknowledgement after which the robot sends the entries again.
RETRY_TICKS: Final = 5
# Entries that are sent in one tick, at most.
WINDOW_ENTRIES: Final = 60


class Upload:
    """Sends the log of `origin`. The coordinator acknowledges by its version vector."""

    def __init__(self, replica: Replica, origin: int, bytes_max: int) -> None:
        self._replica = replica
        self._origin = origin
        self._bytes_max = bytes_max
        self._acknowledged = 0
        self._sent = 0
        self._retry_at = 0

    @property
    def complete(self) -> bool:
        """True if the coordinator has the whole log."""
        return self._acknowledged == self._replica.vector.get(self._origin, 0)

    def acknowledge(self, vector: Vector) -> None:
        """Store the number of entries that the coordinator holds; it is lower than before if it has lost its memory."""
        held = counts_of(vector).get(self._origin)
        if held is None:
            if not vector.low <= self._origin < vector.high:
                return
            held = 0
        self._acknowledged = min(held, self._replica.vector.get(self._origin, 0))
        self._sent = max(self._sent, self._acknowledged)

    def tick(self, tick: int) -> Iterator[Entries]:
        """Yield the messages to send in this tick."""
        total = self._replica.vector.get(self._origin, 0)
        if self._acknowledged < total and self._sent >= total and tick >= self._retry_at:
            self._sent = self._acknowledged
        if self._sent < total:
            log = self._replica.logs[self._origin]
            entries = tuple(log[self._sent : self._sent + WINDOW_ENTRIES])
            yield from pack_entries(Stretch(self._origin, self._sent, entries), self._bytes_max)
            self._sent += len(entries)
            self._retry_at = tick + RETRY_TICKS
