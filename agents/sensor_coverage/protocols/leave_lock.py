"""Locks with which neighbours agree that one of them leaves the complex.

A robot may leave if and only if the flag complex of the graph that its neighbours induce is non-empty, connected and
without holes. Then neither b0 nor b1 changes (`zwerm.maths.simplicial.may_leave`). It knows that graph from its
neighbours' lists. Lists may be old, and two neighbours must not leave together. So the robot requests a lock from every
neighbour, and names the version of the list it relies on. It leaves only with a grant from each.

No loss, delay, copy or crash makes that unsafe. A robot that grants a lock has the list that the requester relies on.
It neither moves nor leaves nor grants a lock to another robot until the requester releases it or `lease_s` has passed
since the grant. The requester leaves within half of `lease_s` since its first request, which is before any grant. So
its neighbours still stand at the same places as when they granted. The edges among them are those of the lists. This
holds if the rates of the clocks differ by less than a factor of 2. The requester itself sees any other robot that
stands there. A robot that has left, or moves, or lost its memory less than `lease_s` ago, grants nothing: while it is
visible, no neighbour leaves.

Safety is guaranteed. Liveness requires that some messages arrive.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.messages.locks import (
    LockDenial,
    LockGrant,
    LockProtocolMessage,
    LockRelease,
    LockRequest,
    NeighbourList,
)
from zwerm.agents.sensor_coverage.protocols.component import Outgoing
from zwerm.maths.simplicial import may_leave

# Versions and numbers are never below the robot's clock in these units, so that a robot that lost its memory repeats
# none.
TICKS_PER_S: Final = 1_000


class _Lock(NamedTuple):
    """This robot stands still for `holder`."""

    holder: int
    number: int
    until_s: float


class _LeaveRequest(NamedTuple):
    """This robot's request to leave, the version of its own list, and the neighbours that have granted it, ascending."""

    message: LockRequest
    version: int
    until_s: float
    granted: tuple[int, ...]


class LeaveLock:
    """One robot's part: the neighbours' lists, the lock it has granted, and its own request.

    In every tick `update` comes first, with all robots that are visible, standing or not. Robots on the fence and base
    stations never `request`, but they answer. While `locked` a robot must not move. Before it moves for another reason
    it calls `depart`, and `settle` where it stands again. `now_s` is the robot's own clock, which must not be set back,
    not even by a restart.
    """

    def __init__(self, me: int, lease_s: float, now_s: float, quiet_s: float | None = None) -> None:
        """Stand still for `quiet_s`, because grants may have been forgotten: `lease_s`, except in a first incarnation."""
        self._me = me
        self._lease_s = lease_s
        self._quiet_until_s = now_s + (lease_s if quiet_s is None else quiet_s)
        self._stands = True
        self._version = _fresh(0, now_s)
        self._number = 0
        self._listed: tuple[int, ...] = ()
        self._lists: dict[int, NeighbourList] = {}
        self._over: dict[int, int] = {}
        self._lock: _Lock | None = None
        self._request: _LeaveRequest | None = None

    @property
    def wants(self) -> bool:
        """True if the robot has requested locks, and neither left nor given up."""
        return self._request is not None

    @property
    def stands(self) -> bool:
        """True if the robot is in the complex and stands still."""
        return self._stands

    @property
    def listed(self) -> tuple[int, ...]:
        """The visible robots, ascending."""
        return self._listed

    def locked(self, now_s: float) -> bool:
        """Return whether this robot must stand still."""
        return now_s < self._quiet_until_s or (self._lock is not None and now_s < self._lock.until_s)

    def update(self, neighbours: Iterable[int], now_s: float) -> None:
        """Take in the visible robots."""
        listed = tuple(sorted(neighbours))
        if listed != self._listed:
            self._listed = listed
            self._version = _fresh(self._version, now_s)
            self._lists = {node: each for node, each in self._lists.items() if node in listed}
            self._over = {node: each for node, each in self._over.items() if node in listed}

    def neighbour_list(self) -> NeighbourList:
        """Return the list to send to all neighbours periodically, when it has changed, and for some time after leaving."""
        return NeighbourList(self._version, self._listed, self._number if self._request is None else self._number - 1)

    def redundant(self) -> bool:
        """Return whether the robot could leave, if all lists that it knows are correct."""
        lists = {node: each.listed for node, each in self._lists.items()}
        if lists.keys() != set(self._listed) or not all(self._me in each for each in lists.values()):
            return False
        mutual = {node: [other for other in each if node in lists.get(other, ())] for node, each in lists.items()}
        return may_leave(self._me, {self._me: self._listed, **mutual})

    # --- leaving ----------------------------------------------------------------------------------------------------

    def request(self, now_s: float, versions: tuple[tuple[int, int], ...] | None = None) -> list[Outgoing]:
        """Request locks, or request the missing ones again; give up when the request has expired.

        `versions` are (neighbour, version of its list), ascending, for which another node has found that the criterion
        holds. Without them the robot checks the criterion on the lists that it knows. Neighbours answer the same in
        both cases.

        After giving up, wait before the next request, and longer each time: simultaneous requests disturb each
        other.
        """
        request = self._request
        if request is not None:
            if not self._may_still_act(request, now_s):
                return self.give_up()
            missing = tuple(each for each in request.message.versions if each[0] not in request.granted)
            return [Outgoing(None, LockRequest(request.message.number, missing))] if missing else []
        if not self._free_to_act(now_s):
            return []
        if versions is None:
            if not self.redundant():
                return []
            versions = tuple((node, self._lists[node].version) for node in self._listed)
        elif tuple(node for node, _ in versions) != self._listed:
            return []
        self._number = _fresh(self._number, now_s)
        message = LockRequest(self._number, versions)
        self._request = _LeaveRequest(message, self._version, now_s + self._lease_s / 2.0, ())
        return [Outgoing(None, message)]

    def give_up(self) -> list[Outgoing]:
        """Withdraw the request."""
        request, self._request = self._request, None
        return [] if request is None else [Outgoing(None, LockRelease(request.message.number))]

    def may_leave(self, now_s: float) -> bool:
        """Return whether the robot may leave now: all visible robots have granted, and nothing it knows has changed."""
        request = self._request
        return (
            request is not None
            and self._free_to_act(now_s)
            and self._may_still_act(request, now_s)
            and request.granted == self._listed
        )

    def leave(self, now_s: float) -> list[Outgoing]:
        """Leave the complex if that is allowed; return the release, or nothing if it is not allowed."""
        if not self.may_leave(now_s):
            return []
        self._stands = False
        return self.give_up()

    def depart(self) -> list[Outgoing]:
        """Begin to move for another reason; not while `locked`."""
        self._stands = False
        return self.give_up()

    def settle(self) -> None:
        """Stand still again."""
        self._stands = True

    # --- answering --------------------------------------------------------------------------------------------------

    def receive(self, sender: int, message: LockProtocolMessage, now_s: float) -> list[Outgoing]:
        """Take in a message from another robot, and return the answers."""
        match message:
            case NeighbourList():
                known = self._lists.get(sender)
                if sender in self._listed and (known is None or message.version > known.version):
                    self._lists[sender] = message
                self._end(sender, message.released)
            case LockRequest():
                return self._answer(sender, message, now_s)
            case LockGrant():
                request = self._request
                if request is not None and message.number == request.message.number:
                    self._request = request._replace(granted=tuple(sorted({*request.granted, sender})))
            case LockDenial():
                if self._request is not None and message.number == self._request.message.number:
                    return self.give_up()
            case LockRelease():
                self._end(sender, message.number)
        return []

    def _answer(self, requester: int, request: LockRequest, now_s: float) -> list[Outgoing]:
        relied_on = dict(request.versions).get(self._me)
        if relied_on is None or request.number <= self._over.get(requester, 0):
            return []
        lock = self._lock if self._lock is not None and now_s < self._lock.until_s else None
        if lock is not None and lock.holder == requester and lock.number >= request.number:
            return [Outgoing(requester, LockGrant(request.number))] if lock.number == request.number else []
        stands = self._stands and now_s >= self._quiet_until_s
        if not stands or (lock is not None and lock.holder != requester) or (self.wants and self._me < requester):
            return [Outgoing(requester, LockDenial(request.number))]
        if relied_on != self._version or requester not in self._listed:
            return [Outgoing(requester, LockDenial(request.number)), Outgoing(requester, self.neighbour_list())]
        given_up = self.give_up()
        self._lock = _Lock(requester, request.number, now_s + self._lease_s)
        return [*given_up, Outgoing(requester, LockGrant(request.number))]

    def _end(self, requester: int, number: int) -> None:
        """Record that the requester will not act on this or an earlier request."""
        self._over[requester] = max(number, self._over.get(requester, 0))
        if self._lock is not None and self._lock.holder == requester and self._lock.number <= number:
            self._lock = None

    # --- helpers ----------------------------------------------------------------------------------------------------

    def _free_to_act(self, now_s: float) -> bool:
        return self._stands and not self.locked(now_s)

    def _may_still_act(self, request: _LeaveRequest, now_s: float) -> bool:
        return now_s < request.until_s and request.version == self._version


def _fresh(last: int, now_s: float) -> int:
    return max(last + 1, int(now_s * TICKS_PER_S))
