"""Whether the base is within reach, hop by hop: the base counts, and the robots pass its count on with their hops.

A swarm can come apart. Robots of a part without the base that see each other would name each other as the way to the
base, with more hops each time. So hops come with the count of the base that arrived on the same way, as in a
destination-sequenced distance vector (Perkins and Bhagwat 1994): more hops replace fewer ones only if their count is
newer by more than `LAG`. Where the base is out of reach the count stays, and so do the hops, which are fewest where the
part was cut off.
"""

from collections.abc import Iterable, Mapping
from typing import Final

# Ticks of one count of the base. It passes on with the robots' periodic messages.
COUNT_TICKS: Final = 100
# More hops replace fewer ones if their count is newer by more than this.
LAG: Final = 2
# Ticks without a newer count after which the base counts as out of reach.
CUT_TICKS: Final = 600
# A robot then waits so many ticks for robots with fewer hops: they drive back first.
TURN_TICKS: Final = 200


class BaseReach:
    """The fewest `hops` to the base, and the `count` of the base that came that way. `unknown` stands for unknown hops."""

    def __init__(self, unknown: int) -> None:
        self.hops = self._unknown = unknown
        self.count = 0
        self.newest = 0
        self._newest_at = 0
        self._turn_since: int | None = None

    def be_base(self, tick: int, before: int) -> None:
        """Count on as the base; `before` is the greatest count of earlier incarnations."""
        self.hops, self.count = 0, before + 1 + tick // COUNT_TICKS

    def leave(self) -> None:
        """Forget the hops: they are those of the former slot."""
        self.hops, self.count = self._unknown, 0

    def update(self, tick: int, neighbours: Iterable[tuple[int, int]]) -> bool:
        """Take in the hops and the counts of the neighbours; return whether that changed anything."""
        changed = False
        for hops, count in neighbours:
            if hops >= self._unknown:
                continue
            fewer, newer = self.hops - (hops + 1), count - self.count
            if newer > LAG or (fewer >= 0 and newer > 0) or (fewer > 0 and newer >= -LAG):
                self.hops, self.count, changed = hops + 1, count, True
            if count > self.newest:
                self.newest, self._newest_at, self._turn_since, changed = count, tick, None, True
        return changed

    def is_lost(self, tick: int) -> bool:
        """Return whether the base is out of reach, as far as this robot knows."""
        return tick - self._newest_at > CUT_TICKS

    def is_turn(self, tick: int, node: int, neighbours: Mapping[int, int]) -> bool:
        """Return whether the base is out of reach, and no neighbour has fewer hops, so this robot is to drive back.

        `neighbours` has the hops of the neighbours; of equal hops, the smaller id is first.
        """
        first = all((self.hops, node) < (hops, other) for other, hops in neighbours.items())
        if not (first and neighbours and self.is_lost(tick)):
            self._turn_since = None
            return False
        if self._turn_since is None:
            self._turn_since = tick
        return tick - self._turn_since >= TURN_TICKS

    def tried(self, tick: int) -> None:
        """Record that the robot has driven back: wait again for a newer count."""
        self._newest_at, self._turn_since = tick, None
