"""Registers: the newest state that each robot has announced: its claim, which has a lease, and whether it is frozen.

Registers merge by the greatest (incarnation, stamp), in any order. A robot raises its stamp with every beacon. A claim
is void if no newer register of its robot arrived for the time of a lease, by the listener's own clock. So clocks are
not compared.

**Termination.** A robot without an open frontier *freezes*: it adds no entry to its log until it receives one that it
lacks. Its register then holds the digest of its logs. If all robots are frozen with the same digest, none adds an entry
again: the first to do so would need an entry that none of them has. The times of the announcements do not matter. So a
conclusion can be wrong only because of three kinds of robots: unknown ones, those that have lost their memory since, and
those that are presumed dead after a long silence. All must agree for `settle_ticks`, in which a robot in reach that lost
its memory announces a new register.
"""

from collections.abc import Iterable, Iterator
from typing import Final

from zwerm.agents.landmark_exploration.sharing.landmark_messages import Register

# Ticks for which all robots must agree: a few beacons, of which some may be lost.
SETTLE_TICKS: Final = 60


class Registers:
    """The newest register of every known robot, by node, and the tick at which it arrived."""

    def __init__(
        self, lease_ticks: int, dead_ticks: int, robots_expected: int, settle_ticks: int = SETTLE_TICKS
    ) -> None:
        self.newest: dict[int, Register] = {}
        self._received_at: dict[int, int] = {}
        self._forwarded: dict[int, int] = {}  # tick at which each was last forwarded
        self._lease_ticks = lease_ticks
        self._dead_ticks = dead_ticks
        self._robots_expected = robots_expected
        self._settle_ticks = settle_ticks
        self._agreed: tuple[int, int] | None = None  # a digest, and the tick since which all agree on it

    def merge(self, register: Register, tick: int) -> bool:
        """Store a register received at `tick`; return whether it is newer than the known one of its robot."""
        return self.merge_all((register,), None, tick)

    def merge_all(self, registers: Iterable[Register], me: int | None, tick: int) -> bool:
        """Store the registers of nodes but `me` received at `tick`; return whether any is newer than the known one."""
        newest, news = self.newest, False
        for each in registers:
            node = each.node
            known = newest.get(node)
            is_newer = known is None or (
                each.stamp > known.stamp
                if each.incarnation == known.incarnation
                else each.incarnation > known.incarnation
            )
            if is_newer and node != me:
                newest[node] = each
                self._received_at[node] = tick
                news = True
        return news

    def is_silent(self, node: int, tick: int) -> bool:
        """Return whether a robot is presumed dead: no new register of it arrived for `dead_ticks`."""
        return tick - self._received_at.get(node, 0) >= self._dead_ticks

    def is_fresh(self, me: int, tick: int, ticks: int) -> bool:
        """Return whether a new register of every known robot but `me` arrived in the last `ticks`."""
        return all(tick - at < ticks for node, at in self._received_at.items() if node != me)

    def half_silent_since(self, me: int) -> int | None:
        """Return the tick since which half of the known robots but `me` are silent, or None where none is known."""
        ticks = sorted([at for node, at in self._received_at.items() if node != me])
        return ticks[len(ticks) // 2] if ticks else None

    def claims(self, me: int, tick: int) -> Iterator[int]:
        """Yield the keys of the frontiers that other robots claim, each with a valid lease."""
        for node, register in self.newest.items():
            if node != me and register.claim and tick - self._received_at[node] < self._lease_ticks:
                yield register.claim - 1

    def to_send(self, first: Iterable[int], most: int, tick: int) -> tuple[Register, ...]:
        """Return up to `most` registers: first of the robots in `first`, then those that were forwarded longest ago."""
        leading = list(first)
        rest = sorted(
            (node for node in self.newest if node not in leading),
            key=lambda node: (self._forwarded.get(node, -1), node),
        )
        chosen = (leading + rest)[:most]
        for node in chosen:
            self._forwarded[node] = tick
        return tuple(self.newest[node] for node in chosen)

    def concluded(self, digest: int, tick: int) -> bool:
        """Return whether all robots are frozen with the logs of this digest, for `settle_ticks`. Call it once a tick."""
        living = [node for node in self.newest if not self.is_silent(node, tick)]
        unknown = self._robots_expected - len(self.newest)
        agreed = living and all(self.newest[node].frozen == digest + 1 for node in living)
        if not agreed or (unknown > 0 and tick < self._dead_ticks):
            self._agreed = None
            return False
        if self._agreed is None or self._agreed[0] != digest:
            self._agreed = digest, tick
        return tick - self._agreed[1] >= self._settle_ticks
