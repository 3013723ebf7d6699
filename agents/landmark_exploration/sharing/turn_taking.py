"""When a robot that assigns itself considers the open frontiers, and when it claims the one that it prefers.

Without a coordinator nobody compares the robots. If each claimed a frontier as soon as it considered it, a far robot
would often go, and the nearest one would stay. So all idle robots consider a frontier that opens, and each waits for
TICKS_PER_VERTEX ticks a vertex of its path. The nearest robot claims it first, and the others receive its claim in time.
Where many frontiers are free, robots do not wait: each has one near it.
"""

from collections.abc import Collection
from typing import Final

# Ticks after which a robot that found no frontier to explore looks for one again: at first, and at most.
RETRY_TICKS: Final = 10
RETRY_TICKS_MAX: Final = 80
# Ticks to wait for each vertex of the path: a claim is received within about two, and a robot needs 10 to 20 to drive so far.
TICKS_PER_VERTEX: Final = 2


class TurnTaking:
    """The times at which a robot considers frontiers, and claims one. All times are ticks of its own clock."""

    def __init__(self) -> None:
        self._retry_at = 0
        self._retry_ticks = RETRY_TICKS
        self._since: int | None = None
        self._left: frozenset[int] | None = frozenset()

    def considers(self, free: Collection[int] | None, tick: int) -> bool:
        """Return whether it is time to consider frontiers, or one is free that was not when the robot last did so.

        `free` are the free frontiers, None where there are many: then only robots without a path to any of them wait.
        """
        opened = free is not None and self._left is not None and not self._left.issuperset(free)
        self._left = None if free is None else frozenset(free)
        return opened or tick >= self._retry_at

    def found_none(self, tick: int) -> None:
        """Take note that no free frontier can be reached: the time to the next consideration doubles."""
        self._since = None
        self._retry_at = tick + self._retry_ticks
        self._retry_ticks = min(2 * self._retry_ticks, RETRY_TICKS_MAX)

    def claims(self, vertices: int, tick: int) -> bool:
        """Return whether to claim a frontier now that so many vertices lead to; else it is considered again in time."""
        self._retry_ticks = RETRY_TICKS
        if self._since is None:
            self._since = tick
        due = self._since + TICKS_PER_VERTEX * vertices
        if tick < due and self._left is not None:
            self._retry_at = due
            return False
        self._since = None
        return True
