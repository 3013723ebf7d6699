"""Who may leave, agreed upon among neighbours: the link criterion, and the locks that make it safe.

A robot may leave iff the flag complex of the graph that its neighbours induce is non-empty, connected and without holes
(`zwerm.maths.simplicial.may_leave`): then neither b0 nor b1 changes. It knows that graph from its neighbours' lists. Lists
may be old, and two neighbours must not leave at once; so it asks every neighbour for a lock, naming the version of the list it
relies on, and leaves only with a grant from each.

Why no loss, delay, copy or crash makes that unsafe. Who grants a lock has the list that was relied on, and neither moves nor
leaves, nor grants anybody else, until the asker says that it is over or `lease_s` has passed since the grant. The asker leaves
within half of `lease_s` since it first asked, which is before any grant: its neighbours then all stand as they stood when they
granted, so the edges among them are those of the lists, as long as clocks do not differ in pace by a factor of 2. Who else
stands there the asker sees itself. A robot that has left, or moves, or lost its memory less than `lease_s` ago, grants
nothing: where it is still seen, nobody leaves.

Promised is safety; liveness needs that messages get through now and then.
"""

from collections.abc import Iterable
from typing import Annotated, Final, NamedTuple

from msgspec import Meta, Struct

from zwerm.maths.simplicial import may_leave

Count = Annotated[int, Meta(ge=0, le=2**62)]

# Versions and numbers are never below the robot's clock in these units, so that one that lost its memory repeats none.
TICKS_PER_S: Final = 1_000


class _Message(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, led by its name."""


class NeighbourList(_Message, frozen=True, tag="neighbours"):
    """Whom the sender sees, ascending; the version is another one whenever that is another list.

    `over` says what `LockRelease` says, in case that was lost.
    """

    version: Count
    listed: tuple[Count, ...]
    over: Count = 0


class LockRequest(_Message, frozen=True, tag="ask"):
    """To all neighbours: the sender wants to leave, relying on these (neighbour, version of its list)."""

    number: Count
    versions: tuple[tuple[Count, Count], ...]


class LockGrant(_Message, frozen=True, tag="grant"):
    """The sender will stand still for the one who asked."""

    number: Count


class LockDenial(_Message, frozen=True, tag="deny"):
    """The sender will not."""

    number: Count


class LockRelease(_Message, frozen=True, tag="over"):
    """To all neighbours: the sender has left, or never will upon this or an earlier number."""

    number: Count


Message = NeighbourList | LockRequest | LockGrant | LockDenial | LockRelease


class LockMessage(NamedTuple):
    """A message to one robot, or to all that hear it."""

    to: int | None
    message: Message


class _Lock(NamedTuple):
    """This robot stands still for `holder`."""

    holder: int
    number: int
    until_s: float


class _LeaveRequest(NamedTuple):
    """This robot wants to leave; who has granted it is in `granted`."""

    ask: LockRequest
    version: int  # of this robot's own list
    until_s: float
    granted: tuple[int, ...]


class LeaveLock:
    """One robot's part: what it knows of its neighbours, whom it stands still for, and whether it may leave.

    In every tick `see` comes first, with everyone that the robot sees now, standing or not. Robots on the fence and base
    stations never `ask`, but they answer. While `locked` a robot must not move; before it moves for another reason than
    this it calls `depart`, and `settle` where it stands again. `now_s` is the robot's own clock, which must not be set back,
    not even by a restart.
    """

    def __init__(self, me: int, lease_s: float, now_s: float, quiet_s: float | None = None) -> None:
        """Stand still for `quiet_s`, since there may be grants that were forgotten: `lease_s`, unless this is a first life."""
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
        self._wish: _LeaveRequest | None = None

    @property
    def wants(self) -> bool:
        """Whether it has asked, and neither left nor given up."""
        return self._wish is not None

    @property
    def stands(self) -> bool:
        """Whether it is one of the swarm that stands."""
        return self._stands

    @property
    def listed(self) -> tuple[int, ...]:
        """Whom it sees, ascending."""
        return self._listed

    def locked(self, now_s: float) -> bool:
        """Tell whether this robot has to stand still."""
        return now_s < self._quiet_until_s or (self._lock is not None and now_s < self._lock.until_s)

    def see(self, neighbours: Iterable[int], now_s: float) -> None:
        """Take in whom the robot sees now."""
        listed = tuple(sorted(neighbours))
        if listed != self._listed:
            self._listed = listed
            self._version = _fresh(self._version, now_s)
            self._lists = {node: each for node, each in self._lists.items() if node in listed}
            self._over = {node: each for node, each in self._over.items() if node in listed}

    def tell(self) -> NeighbourList:
        """Return what to tell all neighbours now and then, and whenever it has changed; for some time after leaving, too."""
        return NeighbourList(self._version, self._listed, self._number if self._wish is None else self._number - 1)

    def redundant(self) -> bool:
        """Tell whether the robot could leave, if all lists that it knows are true."""
        lists = {node: each.listed for node, each in self._lists.items()}
        if lists.keys() != set(self._listed) or not all(self._me in each for each in lists.values()):
            return False
        mutual = {node: [other for other in each if node in lists.get(other, ())] for node, each in lists.items()}
        return may_leave(self._me, {self._me: self._listed, **mutual})

    # --- leaving ----------------------------------------------------------------------------------------------------

    def ask(self, now_s: float, versions: tuple[tuple[int, int], ...] | None = None) -> list[LockMessage]:
        """Ask for locks, or ask again; give up once it has been too long.

        `versions`: somebody has found that the criterion holds for these lists of all neighbours, ascending; else the robot
        has to find so by those that it knows. What neighbours answer does not depend on who found it.

        To ask again after giving up is better left for later, and for longer each time: all who want to leave disturb each
        other.
        """
        wish = self._wish
        if wish is not None:
            if not self._may_still_act(wish, now_s):
                return self.give_up()
            missing = tuple(each for each in wish.ask.versions if each[0] not in wish.granted)
            return [LockMessage(None, LockRequest(wish.ask.number, missing))] if missing else []
        if not self._free_to_act(now_s):
            return []
        if versions is None:
            if not self.redundant():
                return []
            versions = tuple((node, self._lists[node].version) for node in self._listed)
        elif tuple(node for node, _ in versions) != self._listed:
            return []
        self._number = _fresh(self._number, now_s)
        ask = LockRequest(self._number, versions)
        self._wish = _LeaveRequest(ask, self._version, now_s + self._lease_s / 2.0, ())
        return [LockMessage(None, ask)]

    def give_up(self) -> list[LockMessage]:
        """Want to leave no more."""
        wish, self._wish = self._wish, None
        return [] if wish is None else [LockMessage(None, LockRelease(wish.ask.number))]

    def may_leave(self, now_s: float) -> bool:
        """Tell whether the robot may leave now: all that it sees have granted it, and nothing it knows has changed."""
        wish = self._wish
        return (
            wish is not None
            and self._free_to_act(now_s)
            and self._may_still_act(wish, now_s)
            and wish.granted == self._listed
        )

    def leave(self, now_s: float) -> list[LockMessage]:
        """Leave, if that is allowed: from now on the robot is none of the swarm that stands, and `wants` no more."""
        if not self.may_leave(now_s):
            return []
        self._stands = False
        return self.give_up()

    def depart(self) -> list[LockMessage]:
        """Begin to move, for another reason; not while `locked`."""
        self._stands = False
        return self.give_up()

    def settle(self) -> None:
        """Stand again."""
        self._stands = True

    # --- answering --------------------------------------------------------------------------------------------------

    def hear(self, sender: int, message: Message, now_s: float) -> list[LockMessage]:
        """Take in a message from another robot, and return what to answer."""
        match message:
            case NeighbourList():
                known = self._lists.get(sender)
                if sender in self._listed and (known is None or message.version > known.version):
                    self._lists[sender] = message
                self._end(sender, message.over)
            case LockRequest():
                return self._answer(sender, message, now_s)
            case LockGrant():
                wish = self._wish
                if wish is not None and message.number == wish.ask.number:
                    self._wish = wish._replace(granted=tuple(sorted({*wish.granted, sender})))
            case LockDenial():
                if self._wish is not None and message.number == self._wish.ask.number:
                    return self.give_up()
            case LockRelease():
                self._end(sender, message.number)
        return []

    def _answer(self, asker: int, ask: LockRequest, now_s: float) -> list[LockMessage]:
        relied_on = dict(ask.versions).get(self._me)
        if relied_on is None or ask.number <= self._over.get(asker, 0):
            return []
        lock = self._lock if self._lock is not None and now_s < self._lock.until_s else None
        if lock is not None and lock.holder == asker and lock.number >= ask.number:
            return [LockMessage(asker, LockGrant(ask.number))] if lock.number == ask.number else []
        stands = self._stands and now_s >= self._quiet_until_s
        if not stands or (lock is not None and lock.holder != asker) or (self.wants and self._me < asker):
            return [LockMessage(asker, LockDenial(ask.number))]
        if relied_on != self._version or asker not in self._listed:
            return [LockMessage(asker, LockDenial(ask.number)), LockMessage(asker, self.tell())]
        given_up = self.give_up()
        self._lock = _Lock(asker, ask.number, now_s + self._lease_s)
        return [*given_up, LockMessage(asker, LockGrant(ask.number))]

    def _end(self, asker: int, number: int) -> None:
        """Take note that the asker will not act upon this or an earlier number."""
        self._over[asker] = max(number, self._over.get(asker, 0))
        if self._lock is not None and self._lock.holder == asker and self._lock.number <= number:
            self._lock = None

    # --- means ------------------------------------------------------------------------------------------------------

    def _free_to_act(self, now_s: float) -> bool:
        return self._stands and not self.locked(now_s)

    def _may_still_act(self, wish: _LeaveRequest, now_s: float) -> bool:
        return now_s < wish.until_s and wish.version == self._version


def _fresh(last: int, now_s: float) -> int:
    return max(last + 1, int(now_s * TICKS_PER_S))
