"""What a robot tells all who hear it: its state and its way, when they are new, when asked, and now and then."""

from typing import Final

import msgspec

from zwerm.agents.sensor_coverage.messages.peers import UNSAID, PathVector, StateBeacon, Word
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap

# Where words were lost of late, when what is new is told again, and after how long a silence the state as it is [ticks].
AGAIN_TICKS: Final = (4, 10, 22)
LOSSY_HEARTBEAT_TICKS: Final = 24
LOSSY_TICKS: Final = 600
# Who is new cannot know, and speaks for so long as if they were.
NEW_TICKS: Final = 100
# A way is often found by and by: it is told no more often than that.
WAY_TICKS: Final = 4
# The same where nothing is lost.
HEARTBEAT_TICKS: Final = 100


class Beaconing:
    """One robot's broadcasts. `heartbeat` is the tick at which it speaks, whatever happens."""

    def __init__(self, node: int) -> None:
        self.heartbeat = 0
        self._node = node
        self._state: StateBeacon | None = None
        self._of: object = None
        self._number = 0
        self._again: list[int] = []
        self._way = UNSAID
        self._way_again: list[int] = []
        self._way_at = -WAY_TICKS
        self._lossy_until: int | None = None

    def again(self, tick: int) -> None:
        """Tell the state at this tick: somebody asked, or may know less than it should."""
        self._again[:0] = [tick]

    def missed(self, tick: int) -> None:
        """Take note that words are lost."""
        self._lossy_until = tick + LOSSY_TICKS

    def say(self, tick: int, vicinity: LocalMap, waiting: bool) -> list[Word]:
        """Return what to tell now."""
        if self._lossy_until is None:
            self._lossy_until = tick + NEW_TICKS
        return [*self._say_state(tick, vicinity, waiting), *self._say_way(tick, vicinity)]

    def next_tick(self) -> int:
        """Return when there is something to tell, if nothing else happens."""
        return min((self.heartbeat, *self._again[:1], *self._way_again[:1]))

    def _say_state(self, tick: int, vicinity: LocalMap, waiting: bool) -> list[Word]:
        of = vicinity.version, vicinity.looks, waiting
        if of != self._of:
            self._of = of
            state = vicinity.state(waiting)
            if state != self._state:
                self._state = state
                self._number += 1
                self._again = self._times(tick, tick)
        if self._state is None or not (tick >= self.heartbeat or (self._again and tick >= self._again[0])):
            return []
        self._again = [each for each in self._again if each > tick]
        self._way_again = [each for each in self._way_again if each > tick]
        self.heartbeat = tick + (LOSSY_HEARTBEAT_TICKS if self._lossy(tick) else HEARTBEAT_TICKS) + self._node % 10
        return [msgspec.structs.replace(self._state, number=self._number, way=self._now(tick, vicinity))]

    def _say_way(self, tick: int, vicinity: LocalMap) -> list[Word]:
        """Tell the way alone, where nothing else is new."""
        told = self._way
        if not self._way_again and (told.place, told.route) != (vicinity.place, vicinity.route):
            self._way_again = self._times(tick, max(tick, self._way_at + WAY_TICKS))
        if not self._way_again or tick < self._way_again[0]:
            return []
        self._way_again = [each for each in self._way_again if each > tick]
        return [self._now(tick, vicinity)]

    def _times(self, tick: int, first: int) -> list[int]:
        return [first, *(first + each for each in AGAIN_TICKS if self._lossy(tick))]

    def _lossy(self, tick: int) -> bool:
        return self._lossy_until is not None and tick < self._lossy_until

    def _now(self, tick: int, vicinity: LocalMap) -> PathVector:
        """Return the way as it is now."""
        self._way_at = tick
        place, route, home = vicinity.place, vicinity.route, vicinity.home
        if (self._way.place, self._way.route, self._way.home) != (place, route, home):
            self._way = PathVector(self._way.number + 1, place, route, vicinity.gradient.ended, home)
        return self._way
