"""The negotiation by which a robot leaves the complex: when it requests locks, how often, and with which messages.

The locks make leaving safe (`leave_lock`). This component decides when to request them, and when to try again. A robot
that leaves stays in body where it is until it is called to be the rear of a push. Nothing moves, so no robot loses a
landmark.
"""

from collections.abc import Iterable
from typing import ClassVar, Final

import numpy as np

from zwerm.agents.sensor_coverage.messages.locks import (
    ListRequest,
    LockDenial,
    LockGrant,
    LockProtocolMessage,
    LockRelease,
    LockRequest,
    NeighbourList,
)
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock

LEASE_S: Final = 40.0
# Bound of the random delay before the first attempt: neighbours become redundant at the same time.
SPREAD_TICKS: Final = 8
# Ticks between repeated lock requests, and between repeated list requests, and the bound of the latter.
REQUEST_TICKS: Final = 3
LIST_REQUEST_TICKS: Final = 4
LIST_REQUESTS_MAX: Final = 25
# Ticks to wait after a failed attempt, doubled each time up to a bound.
WAIT_TICKS: Final = 8
WAIT_TICKS_MAX: Final = 40
# Ticks after the end of a request at which the end is announced again.
ANNOUNCE_TICKS: Final = (4, 8, 14, 22, 32, 48, 70)


class LeaveNegotiation(Component):
    """One robot's part. `observe` comes first in every tick in which the robot is awake.

    Set `wanted` before `poll`: the robot is redundant as far as it knows, and is to leave. `versions` are neighbours'
    list versions for which a coordinator has found that. After `poll`, `left` is true if the robot left in this tick.
    `tries` counts failed attempts since `begin`.
    """

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = (NeighbourList, LockRequest, LockGrant, LockDenial, LockRelease, ListRequest)

    def __init__(self, node: int, dt_s: float, random: np.random.Generator, first_incarnation: bool) -> None:
        self.wanted = False
        self.versions: tuple[tuple[int, int], ...] | None = None
        self.left = False
        self.tries = 0
        self._node = node
        self._dt_s = dt_s
        self._random = random
        self._first_incarnation = first_incarnation
        self._tick = 0
        self._lock: LeaveLock | None = None
        self._outbox: list[Outgoing] = []
        self._announce_at: list[int] = []
        self._try_at: int | None = None  # None until there was something to try
        self._trying = False
        self._list_requests = 0
        self._unanswered: tuple[int, ...] = ()
        self._had_request = False

    # --- every tick -------------------------------------------------------------------------------------------------

    def observe(self, tick: int, visible: Iterable[int]) -> None:
        """Take in the visible robots."""
        self._tick = tick
        if self._lock is None:
            self._lock = LeaveLock(self._node, LEASE_S, self._now_s, 0.0 if self._first_incarnation else None)
            self._lock.depart()
        self._lock.update(visible, self._now_s)

    def update(self, stands: bool) -> None:
        """Take in whether the robot stands at a slot of the complex, and has nothing else to do."""
        lock = self._lock
        if lock is None or lock.stands == stands:
            return
        if stands:
            lock.settle()
        else:
            self._outbox += lock.depart()

    @property
    def neighbour_list(self) -> NeighbourList | None:
        """The list of visible robots with its version, or None before the first observation."""
        return self._lock.neighbour_list() if self._lock is not None else None

    @property
    def locked(self) -> bool:
        """True if the robot must stand still."""
        return self._lock is not None and self._lock.locked(self._now_s)

    @property
    def stays(self) -> bool:
        """True if the robot cannot leave, by lists that are all new."""
        lock = self._lock
        return lock is not None and self._list_requests > 0 and not self._unanswered and not lock.redundant()

    def begin(self) -> None:
        """Start over, as if the robot had never tried."""
        self.tries = 0
        self._try_at = None

    def receive(self, sender: int, message: LockProtocolMessage | ListRequest, tick: int) -> None:
        """Take in a message about neighbour lists and locks."""
        lock = self._lock
        if lock is None:
            return
        if isinstance(message, NeighbourList):
            self._unanswered = tuple(each for each in self._unanswered if each != sender)
        if not isinstance(message, ListRequest):
            self._outbox += lock.receive(sender, message, self._now_s)
        elif self._node in message.nodes:
            self._outbox.append(Outgoing(sender, lock.neighbour_list()))

    def poll(self, tick: int) -> None:
        """Leave if all neighbours have agreed; otherwise go on with the negotiation."""
        lock = self._lock
        self.left = False
        if lock is None:
            return
        if self._had_request and not lock.wants:
            self._request_ended()
        if self.wanted:
            release = lock.leave(self._now_s)
            self._outbox += release
            self.left = bool(release)
        if lock.wants and not self.wanted:
            self._outbox += lock.give_up()
        self._trying = self.wanted and not self.left
        if not self.wanted:
            self._list_requests = 0
        if self._trying and self._try_at is None:
            self._try_at = tick + 1 + int(self._random.integers(SPREAD_TICKS))
        elif self._trying and tick >= (self._try_at or 0):
            self._try(lock)
        if self._had_request and not lock.wants:
            self._request_ended()
        self._had_request = lock.wants
        if self._announce_at and tick >= self._announce_at[0]:
            del self._announce_at[0]
            self._outbox.append(Outgoing(None, lock.neighbour_list()))

    def outgoing(self) -> list[Outgoing]:
        """Return the messages to send now."""
        found, self._outbox = self._outbox, []
        return found

    def next_wake(self) -> int | None:
        """Return the next tick of an attempt or an announcement."""
        times = [*self._announce_at[:1], *([self._try_at] if self._trying and self._try_at is not None else [])]
        return min(times, default=None)

    # --- attempts -----------------------------------------------------------------------------------------------------

    @property
    def _now_s(self) -> float:
        return self._tick * self._dt_s

    def _try(self, lock: LeaveLock) -> None:
        """Request new lists unless `versions` are known, and then locks."""
        if not self._list_requests:
            self._unanswered = lock.listed if self.versions is None else ()
        if lock.wants or not self._unanswered:
            self._outbox += lock.request(self._now_s, self.versions)
            self._try_at = self._tick + REQUEST_TICKS
            if not lock.wants:
                self._back_off()
        elif self._list_requests < LIST_REQUESTS_MAX:
            self._list_requests += 1
            self._try_at = self._tick + LIST_REQUEST_TICKS
            self._outbox.append(Outgoing(None, ListRequest(self._unanswered)))
        else:
            self._back_off()

    def _request_ended(self) -> None:
        """Announce the end of a request again and again, because neighbours may have missed it."""
        self._announce_at = [self._tick + each for each in ANNOUNCE_TICKS]
        self._back_off()

    def _back_off(self) -> None:
        """Wait before the next attempt: longer after every failure, and for a random time."""
        if self._try_at is None or self._try_at <= self._tick + REQUEST_TICKS:
            self.tries += 1
            wait = min(WAIT_TICKS * 2.0**self.tries, WAIT_TICKS_MAX)
            self._try_at = self._tick + int(wait * (0.5 + float(self._random.random())))
            self._list_requests = 0
