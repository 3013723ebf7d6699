"""How a robot comes to leave the complex: when it asks its neighbours, how often, and what it sends for that.

What makes leaving safe is agreed upon in `redundancy`; here is when to begin, and when to try again. Who leaves stays where it
is in body until it is called to be the rear of a push: nothing moves, and nobody's landmark is lost.
"""

from collections.abc import Iterable
from typing import Final

import numpy as np

from zwerm.agents.sensor_coverage.messages.peers import ListRequest, Word
from zwerm.agents.sensor_coverage.protocols import leave_lock as redundancy
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock, LockMessage

LEASE_S: Final = 40.0
# When it first tries, once it is redundant: by chance, since neighbours are so at once; and when it asks again [ticks].
SPREAD_TICKS: Final = 8
ASK_TICKS: Final = 3
ENQUIRE_TICKS: Final = 4
ENQUIRIES_MAX: Final = 25
# How long to wait after a wish that came to nothing [ticks]: doubled every time.
WAIT_TICKS: Final = 8
WAIT_TICKS_MAX: Final = 40
# When to say again that a wish is over [ticks after].
AGAIN_TICKS: Final = (4, 8, 14, 22, 32, 48, 70)


class LeaveNegotiation:
    """One robot's part. `watch` comes first in every tick that it is awake in."""

    def __init__(self, node: int, dt_s: float, random: np.random.Generator, newborn: bool) -> None:
        self._node = node
        self._dt_s = dt_s
        self._random = random
        self._newborn = newborn
        self._tick = 0
        self._agreement: LeaveLock | None = None
        self._outbox: list[tuple[int | None, Word]] = []
        self._again: list[int] = []
        self._try_at: int | None = None  # None as long as there never was anything to try
        self._redundant = False
        self.tries = 0
        self._enquiries = 0
        self._unanswered: tuple[int, ...] = ()
        self._wanted = False

    # --- every tick -------------------------------------------------------------------------------------------------

    def watch(self, tick: int, sight: Iterable[int]) -> None:
        """Take in whom the robot sees."""
        self._tick = tick
        if self._agreement is None:
            self._agreement = LeaveLock(self._node, LEASE_S, self._now_s, 0.0 if self._newborn else None)
            self._agreement.depart()
        self._agreement.see(sight, self._now_s)

    def note(self, stands: bool) -> None:
        """Take in whether the robot stands at a place of the complex, and has nothing else to do."""
        agreement = self._agreement
        if agreement is None or agreement.stands == stands:
            return
        if stands:
            agreement.settle()
        else:
            self._send(agreement.depart())

    @property
    def told(self) -> redundancy.NeighbourList | None:
        """What it tells of whom it sees, and under which version."""
        return self._agreement.tell() if self._agreement is not None else None

    @property
    def locked(self) -> bool:
        """Whether the robot has to stand still."""
        return self._agreement is not None and self._agreement.locked(self._now_s)

    def hear(self, sender: int, word: redundancy.Message | ListRequest) -> None:
        """Take in what another robot says."""
        agreement = self._agreement
        if agreement is None:
            return
        if isinstance(word, redundancy.NeighbourList):
            self._unanswered = tuple(each for each in self._unanswered if each != sender)
        if not isinstance(word, ListRequest):
            self._send(agreement.hear(sender, word, self._now_s))
        elif self._node in word.nodes:
            self._outbox.append((sender, agreement.tell()))

    def begin(self) -> None:
        """Try anew, as if for the first time; `tries` is how often that has come to nothing since."""
        self.tries = 0
        self._try_at = None

    @property
    def stays(self) -> bool:
        """Whether, by lists that are all new, the robot cannot leave."""
        agreement = self._agreement
        return agreement is not None and self._enquiries > 0 and not self._unanswered and not agreement.redundant()

    def turn(self, redundant: bool, versions: tuple[tuple[int, int], ...] | None = None) -> bool:
        """Go on; tell whether the robot leaves now.

        `redundant`: by all that it knows it could, and it should. `versions`: it was told so, for these of neighbours' lists.
        """
        agreement, tick = self._agreement, self._tick
        if agreement is None:
            return False
        if self._wanted and not agreement.wants:
            self._end()
        left = redundant and bool(self._send(agreement.leave(self._now_s)))
        if agreement.wants and not redundant:
            self._send(agreement.give_up())
        self._redundant = redundant and not left
        if not redundant:
            self._enquiries = 0
        if self._redundant and self._try_at is None:
            self._try_at = tick + 1 + int(self._random.integers(SPREAD_TICKS))
        elif self._redundant and tick >= (self._try_at or 0):
            self._try(agreement, versions)
        if self._wanted and not agreement.wants:
            self._end()
        self._wanted = agreement.wants
        if self._again and tick >= self._again[0]:
            del self._again[0]
            self._outbox.append((None, agreement.tell()))
        return left

    def letters(self) -> list[tuple[int | None, Word]]:
        """Return what is to be sent now, with whom it is for (None: all that hear it)."""
        found, self._outbox = self._outbox, []
        return found

    def next_tick(self) -> int | None:
        """Return when to be looked after, at the latest."""
        times = [*self._again[:1], *([self._try_at] if self._redundant and self._try_at is not None else [])]
        return min(times, default=None)

    # --- means ------------------------------------------------------------------------------------------------------

    @property
    def _now_s(self) -> float:
        return self._tick * self._dt_s

    def _try(self, agreement: LeaveLock, versions: tuple[tuple[int, int], ...] | None) -> None:
        """Ask for lists that are new, unless it is known which to rely on, and then for locks."""
        if not self._enquiries:
            self._unanswered = agreement.listed if versions is None else ()
        if agreement.wants or not self._unanswered:
            self._send(agreement.ask(self._now_s, versions))
            self._try_at = self._tick + ASK_TICKS
            if not agreement.wants:
                self._wait()
        elif self._enquiries < ENQUIRIES_MAX:
            self._enquiries += 1
            self._try_at = self._tick + ENQUIRE_TICKS
            self._outbox.append((None, ListRequest(self._unanswered)))
        else:
            self._wait()

    def _end(self) -> None:
        """A wish is over, and neighbours may not have heard so."""
        self._again = [self._tick + each for each in AGAIN_TICKS]
        self._wait()

    def _wait(self) -> None:
        if self._try_at is None or self._try_at <= self._tick + ASK_TICKS:
            self.tries += 1
            self._try_at = self._tick + self._patience()
            self._enquiries = 0

    def _patience(self) -> int:
        """Return how long to wait: longer after every wish that came to nothing, and by chance."""
        return int(min(WAIT_TICKS * 2.0**self.tries, WAIT_TICKS_MAX) * (0.5 + float(self._random.random())))

    def _send(self, sent: list[LockMessage]) -> list[LockMessage]:
        self._outbox += [(each.to, each.message) for each in sent]
        return sent
