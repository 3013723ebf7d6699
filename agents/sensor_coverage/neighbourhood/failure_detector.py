"""Failure detector: it asks neighbours whose state is missing or does not agree, and declares silent ones dead."""

from collections.abc import Mapping
from typing import ClassVar, Final

from zwerm.agents.sensor_coverage.messages.beacons import StateRequest
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing

# Ticks before the first request, ticks between requests, and requests before a robot is declared dead.
FIRST_TICKS: Final = 8
REPEAT_TICKS: Final = 2
REQUESTS_MAX: Final = 150
# A robot whose latest state is older than this is asked, too.
SILENT_TICKS: Final = 260


class FailureDetector(Component):
    """One robot's failure detector. `dead` are robots that did not answer, `due` is the tick of the next request."""

    channel: ClassVar[str] = CHANNEL

    def __init__(self) -> None:
        self.dead: dict[int, None] = {}
        self.due: int | None = None
        self._requests: dict[int, int] = {}
        self._outbox: list[Outgoing] = []

    def answered(self, node: int) -> bool:
        """Record that a robot has sent its state; return whether it was declared dead."""
        self._requests.pop(node, None)
        dead = node in self.dead
        self.dead.pop(node, None)
        return dead

    def restarted(self, node: int, tick: int) -> None:
        """Record that a robot has sent its first message of another incarnation."""
        self.answered(node)

    def check(self, tick: int, table: NeighbourTable, visible: Mapping[int, float], samples: int) -> None:
        """Ask the robots whose states are needed, if it is time; averaging bearings takes `samples` ticks."""
        wanted = [node for node in dict.fromkeys(table.stale(visible)) if node not in self.dead]
        wanted += [
            node for node in visible if node not in wanted and tick - table.received_at.get(node, tick) > SILENT_TICKS
        ]
        wanted = [
            node
            for node in wanted
            if node not in table.states
            or not table.states[node].moving
            or tick - table.received_at[node] > SILENT_TICKS
        ]
        if not wanted:
            self._requests.clear()
            self.due = None
            return
        if self.due is None:
            self.due = tick + FIRST_TICKS + samples
        if tick < self.due:
            return
        self.due = tick + REPEAT_TICKS
        self._requests = {node: self._requests.get(node, 0) + 1 for node in wanted}
        for node, requests in self._requests.items():
            silent = node not in table.received_at or tick - table.received_at[node] > SILENT_TICKS
            if requests > REQUESTS_MAX and silent:
                table.remove_dead(node)
                self.dead[node] = None
        self._outbox.append(Outgoing(None, StateRequest(tuple(wanted))))

    def outgoing(self) -> list[Outgoing]:
        """Return the request of this tick."""
        sent, self._outbox = self._outbox, []
        return sent

    def next_wake(self) -> int | None:
        """Return the tick of the next request."""
        return self.due
