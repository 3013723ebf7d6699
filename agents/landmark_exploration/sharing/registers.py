"""Registers: the newest state that each robot has announced. It holds claims with leases, and which robots have nothing
left to explore.

Registers merge by the greatest (incarnation, stamp), in any order. A robot raises its stamp with every beacon. A claim
is void if no newer register of its robot arrived for the time of a lease, by the listener's own clock. So clocks are
not compared.

**Termination.** A robot with nothing left to explore *freezes*: it adds nothing to its log until it receives an entry
that it lacks. Its register then holds the digest of its logs. If every robot has announced that it is frozen with the
same digest, no robot can add an entry again. The first to do so would need an entry that none of them has, from a robot
that is not among them. It does not matter when each of them said it. So a conclusion can be wrong only about three
kinds of robots. They are unknown, or have lost their memory since, or are presumed dead after a long silence. All must
agree for `settle_ticks`. In this time a robot in reach that lost its memory is found.
"""

from collections.abc import Iterable, Iterator
from typing import Final

from zwerm.agents.landmark_exploration.sharing.landmark_messages import Register

# Ticks for which all robots must agree: a few beacons, of which some may be lost.
SETTLE_TICKS: Final = 60


class Registers:
    """The newest register of every known robot, by node, and the tick at which it came."""

    def __init__(
        self, lease_ticks: int, dead_ticks: int, robots_expected: int, settle_ticks: int = SETTLE_TICKS
    ) -> None:
        self.newest: dict[int, Register] = {}
        self._heard: dict[int, int] = {}
        self._forwarded: dict[int, int] = {}  # tick at which each was last forwarded
        self._lease_ticks = lease_ticks
        self._dead_ticks = dead_ticks
        self._robots_expected = robots_expected
        self._settle_ticks = settle_ticks
        self._agreed: tuple[int, int] | None = None  # a digest, and the tick since which all agree on it

    def merge(self, register: Register, tick: int) -> bool:
        """Take in a register heard at `tick`; return whether it was newer than what is known of its robot."""
        return self.merge_all((register,), None, tick)

    def merge_all(self, registers: Iterable[Register], me: int | None, tick: int) -> bool:
        """Take in the registers of others than `me` heard at `tick`; return whether any was newer than what is known."""
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
                self._heard[node] = tick
                news = True
        return news

    def is_silent(self, node: int, tick: int) -> bool:
        """Return whether a robot is presumed dead, because no new register of it has come for `dead_ticks`."""
        return tick - self._heard.get(node, 0) >= self._dead_ticks

    def is_fresh(self, me: int, tick: int, ticks: int) -> bool:
        """Return whether a new register of every known robot but `me` came in the last `ticks`."""
        return all(tick - heard < ticks for node, heard in self._heard.items() if node != me)

    def last_heard(self, me: int) -> int | None:
        """Return the tick since which half of the known robots but `me` are silent, or None where none is known."""
        heard = sorted([heard for node, heard in self._heard.items() if node != me])
        return heard[len(heard) // 2] if heard else None

    def claims(self, me: int, tick: int) -> Iterator[int]:
        """Yield the keys of the frontiers that other robots claim, by a lease that has not run out."""
        for node, register in self.newest.items():
            if node != me and register.claim and tick - self._heard[node] < self._lease_ticks:
                yield register.claim - 1

    def to_tell(self, first: Iterable[int], most: int, tick: int) -> tuple[Register, ...]:
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
        """Return whether all robots have nothing left to explore, with the logs of this digest. To be asked once a tick."""
        living = [node for node in self.newest if not self.is_silent(node, tick)]
        unheard = self._robots_expected - len(self.newest)
        agreed = living and all(self.newest[node].frozen == digest + 1 for node in living)
        if not agreed or (unheard > 0 and tick < self._dead_ticks):
            self._agreed = None
            return False
        if self._agreed is None or self._agreed[0] != digest:
            self._agreed = digest, tick
        return tick - self._agreed[1] >= self._settle_ticks
