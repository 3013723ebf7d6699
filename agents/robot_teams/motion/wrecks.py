"""Detection of wrecks: robots that do not move although they are touched, and are silent.

Silence alone proves nothing: a packet may be lost, or the radio divided. A living robot moves aside when touched, or goes on.
So a robot counts as a wreck only if three conditions hold. It was touched for `TOUCHED_S` in total. It did not move for
`STILL_S`. It was silent for twice the time after which a member is dropped. Any motion, and any later status, shows
that it lives.
"""

from collections.abc import Callable, Iterable
from typing import Final

from zwerm.agents.robot_teams.mapping.facts import Void, Wreck
from zwerm.agents.robot_teams.motion.senses import DEAD_M, Senses

# A silent robot is dead if it was touched for this time, and did not move for this time [s].
TOUCHED_S: Final = 3.0
STILL_S: Final = 8.0
# More than this is motion [m].
MOVED_M: Final = 0.03
# Largest error of the place of a wreck that a teammate reported [m].
REPORTED_M: Final = 0.1


class _Track:
    """A robot that last moved at tick `since` and has stood at (x, y) since then; it was touched for `touched` ticks."""

    def __init__(self, x_m: float, y_m: float, since: int) -> None:
        self.x_m, self.y_m, self.since = x_m, y_m, since
        self.touched = 0


class WreckWatch:
    """Watches the robots in sight. `silent_ticks` returns the number of ticks since the last news of a robot."""

    def __init__(self, dt_s: float, silence_s: float, silent_ticks: Callable[[int, int], int]) -> None:
        self.wrecks: dict[int, Wreck] = {}
        self.moved: list[int] = []  # those of them that moved in the last tick
        self._tracks: dict[int, _Track] = {}
        self._silent_ticks = silent_ticks
        self._touched_ticks = round(TOUCHED_S / dt_s)
        self._still_ticks = round(STILL_S / dt_s)
        self._silence_ticks = round(2.0 * silence_s / dt_s)

    def watch(self, senses: Senses, reported: Iterable[Void]) -> list[int]:
        """Take in one tick's senses and the wrecks that teammates `reported`; return the robots that are new
        wrecks."""
        found = []
        self.moved.clear()
        for other in senses.robots:
            track = self._tracks.get(other.node)
            if track is None or abs(other.x_m - track.x_m) + abs(other.y_m - track.y_m) > MOVED_M:
                track = self._tracks[other.node] = _Track(other.x_m, other.y_m, senses.tick)
                if self.wrecks.pop(other.node, None) is not None:
                    self.moved.append(other.node)
            if other.gap_m < DEAD_M:
                track.touched += 1
            if other.node in self.wrecks:
                continue
            for void in reported:
                if void.wreck.node == other.node and abs(void.x_mm / 1000.0 - other.x_m) < REPORTED_M:
                    self.wrecks[other.node] = void.wreck
            if (
                other.node not in self.wrecks
                and track.touched > self._touched_ticks
                and senses.tick - track.since > self._still_ticks
                and self._silent_ticks(other.node, senses.tick) > self._silence_ticks
            ):
                self.wrecks[other.node] = Wreck(other.node, senses.tick)
                found.append(other.node)
        return found

    def note_alive(self, node: int, tick: int) -> None:
        """Record that a robot was alive at `tick`."""
        wreck = self.wrecks.get(node)
        if wreck is not None and tick > wreck.tick:
            del self.wrecks[node]
            self._tracks.pop(node, None)
