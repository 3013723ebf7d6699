"""The leader's announcement that it has left its slot for good, flooded over a few hops.

The follower is usually out of the leader's range, so neighbours forward the announcement.
"""

from collections.abc import Callable
from typing import ClassVar, Final

from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.messages.pushes import SlotVacated
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing

# Hops over which the announcement is forwarded, and ticks before it is repeated for the first time.
HOPS: Final = 2
REPEAT_TICKS: Final = 4


class VacancyAnnouncer(Component):
    """Announces a vacated slot, less and less often, while `is_out(push)` holds."""

    channel: ClassVar[str] = CHANNEL

    def __init__(self, is_out: Callable[[int], bool]) -> None:
        self._is_out = is_out
        self._push: int | None = None
        self._due = 0
        self._wait_ticks = REPEAT_TICKS
        self._tick = 0

    def announce(self, push: int, tick: int) -> None:
        """Begin to announce that the leader of a push has left its slot."""
        self._push, self._due, self._wait_ticks = push, tick, REPEAT_TICKS

    def poll(self, tick: int) -> None:
        """Set the time of this tick."""
        self._tick = tick

    def outgoing(self) -> list[Outgoing]:
        """Return the announcement if it is due."""
        push = self._push
        if push is None or self._tick < self._due:
            return []
        self._due = self._tick + self._wait_ticks
        self._wait_ticks *= 2
        if not self._is_out(push):
            self._push = None
        return [Outgoing(None, SlotVacated(push, HOPS))]

    def next_wake(self) -> int | None:
        """Return the tick of the next announcement."""
        return None if self._push is None else self._due
