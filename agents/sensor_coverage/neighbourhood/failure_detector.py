"""Asking those whose word is missing or does not fit what one sees; who does not answer for long is dead."""

from collections.abc import Mapping
from typing import Final

from zwerm.agents.sensor_coverage.messages.peers import StateRequest
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable

# When to ask for the first time, and again, and how often before somebody is taken for dead [ticks].
FIRST_TICKS: Final = 8
AGAIN_TICKS: Final = 2
ASKS_MAX: Final = 150
# Whose last word is older than this is asked, too.
SILENT_TICKS: Final = 260


class FailureDetector:
    """One robot's. `dead` are those who did not answer, `at` is when to ask next."""

    def __init__(self) -> None:
        self.dead: dict[int, None] = {}
        self.at: int | None = None
        self._asked: dict[int, int] = {}

    def answered(self, node: int) -> bool:
        """Take note that a robot said something; tell whether it was thought to be dead."""
        self._asked.pop(node, None)
        dead = node in self.dead
        self.dead.pop(node, None)
        return dead

    def turn(self, tick: int, sight: NeighbourTable, seen: Mapping[int, float], samples: int) -> StateRequest | None:
        """Return whom to ask now, if anybody; looking around takes `samples` ticks."""
        wanted = [node for node in dict.fromkeys(sight.stale(seen)) if node not in self.dead]
        wanted += [node for node in seen if node not in wanted and tick - sight.heard.get(node, tick) > SILENT_TICKS]
        wanted = [
            node
            for node in wanted
            if node not in sight.states or not sight.states[node].moving or tick - sight.heard[node] > SILENT_TICKS
        ]
        if not wanted:
            self._asked.clear()
            self.at = None
            return None
        if self.at is None:
            self.at = tick + FIRST_TICKS + samples
        if tick < self.at:
            return None
        self.at = tick + AGAIN_TICKS
        self._asked = {node: self._asked.get(node, 0) + 1 for node in wanted}
        for node, times in self._asked.items():
            if times > ASKS_MAX and tick - sight.heard.get(node, -SILENT_TICKS) > SILENT_TICKS:
                sight.forget(node)
                self.dead[node] = None
        return StateRequest(tuple(wanted))
