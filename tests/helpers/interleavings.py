"""Every interleaving of the redundancy protocol on a small graph, by explicit exploration of its states.

The network is the set of all messages ever sent. Any of them can be delivered at any time, any number of times, or
never. This is loss, delay, reordering and duplication at once. Robots request, give up, leave, observe, lose their
memory, arrive and are moved at any time. Time is a few ticks. A robot's state is interned, and the effect of an event
on it is computed once.

Events without influence are left out. A denial has the effect of giving up, which can happen at any time. A grant only
allows more, so it arrives at once; a robot may ignore it. The leave requests in a list are also in messages that were
sent. A message that its receiver will always ignore is deleted.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

from zwerm.agents.sensor_coverage.messages.locks import (
    LockDenial,
    LockGrant,
    LockProtocolMessage,
    LockRelease,
    LockRequest,
    NeighbourList,
)
from zwerm.agents.sensor_coverage.protocols.component import Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock
from zwerm.maths.simplicial import FlagComplex, betti, bits

LEASE_TICKS = 2

Graph = Mapping[int, tuple[int, ...]]


class Budget(NamedTuple):
    """The largest number of each kind of event in one run of the swarm."""

    asks: tuple[int, ...]  # one each of these robots
    ticks: int = 0
    amnesias: int = 0
    moving: tuple[int, tuple[int, ...]] | None = None  # this robot is moved to where it has these neighbours
    comes: bool = False  # and is not there at first


class State(NamedTuple):
    """A swarm: ids of the robots' states, a bit for every message ever sent, and a bit for every robot that stands or
    is visible."""

    now: int
    robots: tuple[int, ...]
    sent: int
    standing: int
    seen: int
    asks: tuple[int, ...]
    amnesias: int
    moving: int  # 2 before the move, 1 on the way, 0 after it


BEFORE, UNDER_WAY, AFTER = 2, 1, 0


class Violation(Exception):
    """A state that violates the guarantees."""


class Explorer:
    """The states that a swarm can reach."""

    def __init__(self, graph: Graph, budget: Budget, kind: type[LeaveLock] = LeaveLock) -> None:
        self.graph = graph
        self.later = _moved(graph, *budget.moving) if budget.moving is not None else graph
        self.mover = budget.moving[0] if budget.moving is not None else -1
        self.budget = budget
        self.kind = kind
        self._objects: list[LeaveLock] = []
        self._numbers: dict[Any, int] = {}
        self._messages: list[tuple[int, int, LockProtocolMessage]] = []
        self._message_numbers: dict[Any, int] = {}
        self._done: dict[Any, tuple[int, tuple[Any, ...]]] = {}
        self._useless: dict[tuple[int, int], bool] = {}
        self._bare: dict[int, int] = {}
        self.departures = 0

    def explore(self) -> int:
        """Visit every state, and return how many there are. Raises Violation."""
        first = self._first()
        known = {first}
        reached: set[State] = set()  # before messages are deleted: most events lead to a state again
        stack = [first]
        while stack:
            state = stack.pop()
            self._check_exclusion(state)
            for raw in self._events(state):
                if raw in reached:
                    continue
                reached.add(raw)
                after = self._forgotten(raw)
                if after not in known and self._anybody_may_leave(after):
                    known.add(after)
                    stack.append(after)
        return len(known)

    # --- what is promised -------------------------------------------------------------------------------------------

    def _check_exclusion(self, state: State) -> None:
        able = [node for node in self.graph if self._about_to_leave(state, node)]
        for node in able:
            if any(other in able for other in self._graph(state)[node]):
                raise Violation(f"adjacent robots {able} may leave at once")

    def _about_to_leave(self, state: State, node: int) -> bool:
        robot = self._objects[state.robots[node]]
        return robot.wants and not self._objects[self._try(state, node, "leave")[0]]._stands

    def _anybody_may_leave(self, state: State) -> bool:
        return bool(state.asks) or any(self._objects[number].wants for number in state.robots)

    def _check_removal(self, state: State, node: int) -> None:
        graph = tuple(sorted(self._graph(state).items()))
        before, after = _holes(graph, state.standing), _holes(graph, state.standing & ~(1 << node))
        if before != after:
            raise Violation(f"robot {node} left {state.standing:b}: b0 and b1 were {before}, are {after}")

    # --- what can happen --------------------------------------------------------------------------------------------

    def _events(self, state: State) -> Iterator[State]:
        for number in bits(state.sent):
            sender, receiver, message = self._messages[number]
            if not self._only_forbids(state, sender, receiver, message):
                yield self._after(state, receiver, "receive", sender, message)
        for node in self.graph:
            bit = 1 << node
            if any(requester in state.asks for requester in (node, *self._graph(state)[node])):
                yield self._after(state, node, "look")
            if state.standing & bit:
                yield from self._acts(state, node)
            elif state.seen & bit and node != self.mover:
                yield state._replace(seen=state.seen & ~bit)
        if state.moving == UNDER_WAY:
            bit = 1 << self.mover
            there = state._replace(standing=state.standing | bit, seen=state.seen | bit, moving=AFTER)
            yield self._after(there, self.mover, "settle")
        if state.now < self.budget.ticks:
            yield state._replace(now=state.now + 1)

    def _acts(self, state: State, node: int) -> Iterator[State]:
        """Yield what a robot that stands may do."""
        gone = state.standing & ~(1 << node)
        robot = self._objects[state.robots[node]]
        if robot.wants:
            yield self._after(state, node, "give_up")
            if self._about_to_leave(state, node):
                self._check_removal(state, node)
                self.departures += 1
                yield self._after(state, node, "leave")._replace(standing=gone)
        elif node in state.asks:
            after = self._after(state, node, "request")
            if self._objects[after.robots[node]].wants:
                yield after._replace(asks=_less(state.asks, node))
        if node == self.mover and state.moving == BEFORE and not robot.locked(state.now):
            yield self._after(state, node, "depart")._replace(standing=gone, moving=UNDER_WAY)
        if state.amnesias:
            yield self._after(state, node, "forget")._replace(amnesias=state.amnesias - 1)

    def _graph(self, state: State) -> Graph:
        return self.graph if state.moving else self.later

    def _only_forbids(self, state: State, sender: int, receiver: int, message: LockProtocolMessage) -> bool:
        """Return whether a message only makes its receiver refuse others, which has the effect of their loss."""
        lock = self._objects[state.robots[receiver]]._lock
        return isinstance(message, LockRelease) and (
            lock is None or lock.holder != sender or lock.number > message.number
        )

    def _in_sight(self, state: State, node: int) -> tuple[int, ...]:
        return tuple(other for other in self._graph(state)[node] if state.seen >> other & 1)

    # --- robots, interned -------------------------------------------------------------------------------------------

    def _first(self) -> State:
        """All robots stand, and have all lists."""
        standing = sum(1 << node for node in self.graph if not (self.budget.comes and node == self.mover))
        robots = {node: self.kind(node, LEASE_TICKS, -LEASE_TICKS) for node in self.graph}
        for node, robot in robots.items():
            robot.update((other for other in self.graph[node] if standing >> other & 1), 0)
            if not standing >> node & 1:
                robot.depart()
        for node, robot in robots.items():
            for other in self.graph[node]:
                robot.receive(other, robots[other].neighbour_list(), 0)
        numbers = tuple(self._number(robots[node]) for node in sorted(robots))
        moving = AFTER if self.mover < 0 else UNDER_WAY if self.budget.comes else BEFORE
        return State(0, numbers, 0, standing, standing, self.budget.asks, self.budget.amnesias, moving)

    def _number(self, robot: LeaveLock) -> int:
        key = tuple(tuple(sorted(each.items())) if isinstance(each, dict) else each for each in vars(robot).values())
        if key not in self._numbers:
            self._numbers[key] = len(self._objects)
            self._objects.append(robot)
        return self._numbers[key]

    def _after(self, state: State, node: int, event: str, *what: Any) -> State:
        number, sent = self._try(state, node, event, *what)
        robots = [*state.robots[:node], number, *state.robots[node + 1 :]]
        messages = state.sent
        for to, message in sent:
            for receiver in self._graph(state)[node] if to is None else (to,):
                if isinstance(message, LockGrant):
                    robots[receiver], _ = self._step(robots[receiver], state.now, None, "receive", node, message)
                    continue
                if isinstance(message, NeighbourList):
                    message = NeighbourList(message.version, message.listed)
                if not isinstance(message, LockDenial):
                    messages |= 1 << self._message(node, receiver, message)
        return state._replace(robots=tuple(robots), sent=messages)

    def _forgotten(self, state: State) -> State:
        """Return the state without messages that cannot matter any more."""
        if state.amnesias:
            return state
        robots = tuple(
            number if node in state.asks else self._without_lists(number) for node, number in enumerate(state.robots)
        )
        left = 0
        for number in bits(state.sent):
            sender, receiver, message = self._messages[number]
            if self._still_matters(state, sender, receiver, message):
                key = number, robots[receiver]
                if key not in self._useless:
                    self._useless[key] = self._ignores(self._objects[key[1]], sender, message)
                if not self._useless[key]:
                    left |= 1 << number
        return state._replace(robots=robots, sent=left)

    def _still_matters(self, state: State, sender: int, receiver: int, message: LockProtocolMessage) -> bool:
        """Return whether a message can allow anything to a present or future requester."""
        match message:
            case NeighbourList():
                return receiver in state.asks
            case LockRequest():
                return sender in state.asks or self._objects[state.robots[sender]].wants
        return True

    def _without_lists(self, number: int) -> int:
        """Return the robot's state without the parts that only a future requester uses."""
        if number not in self._bare:
            robot = _copy(self._objects[number])
            robot._lists = {}
            self._bare[number] = self._number(robot)
        return self._bare[number]

    def _ignores(self, robot: LeaveLock, sender: int, message: LockProtocolMessage) -> bool:
        if self.mover in (robot._me, sender):
            return False
        if sender not in robot._listed or (not robot._stands and not isinstance(message, LockRequest)):
            return True
        match message:
            case LockRequest() if not robot._stands:
                return not any(isinstance(each.message, LockGrant) for each in _copy(robot).receive(sender, message, 0))
            case LockRequest() | LockRelease():
                return message.number <= robot._over.get(sender, -1)
            case NeighbourList():
                known = robot._lists.get(sender)
                return known is not None and message.version <= known.version
        return False

    def _message(self, *sent: Any) -> int:
        if sent not in self._message_numbers:
            self._message_numbers[sent] = len(self._messages)
            self._messages.append(sent)
        return self._message_numbers[sent]

    def _try(self, state: State, node: int, event: str, *what: Any) -> tuple[int, tuple[Any, ...]]:
        return self._step(state.robots[node], state.now, self._in_sight(state, node), event, *what)

    def _step(
        self, number: int, now: int, seen: tuple[int, ...] | None, event: str, *what: Any
    ) -> tuple[int, tuple[Any, ...]]:
        """Let a robot observe its neighbours, and then apply an event; return its new state and its messages."""
        key = (number, now, seen, event, *what)
        if key not in self._done:
            robot = _copy(self._objects[number])
            if event == "forget":
                vars(robot).update(vars(self.kind(robot._me, LEASE_TICKS, now)))
            before = robot.neighbour_list()
            if seen is not None:
                robot.update(seen, now)
            told = [] if robot.neighbour_list() == before else [Outgoing(None, robot.neighbour_list())]
            match event:
                case "receive":
                    sender, message = what
                    told += robot.receive(sender, message, now)
                case "request" | "leave":
                    told += getattr(robot, event)(now)
                case "give_up" | "depart":
                    told += getattr(robot, event)()
                case "settle":
                    robot.settle()
            self._done[key] = self._number(robot), tuple(told)
        return self._done[key]


def _moved(graph: Graph, mover: int, neighbours: tuple[int, ...]) -> Graph:
    """Return the graph with other neighbours of one robot."""
    return {
        node: neighbours
        if node == mover
        else tuple(sorted({*(each for each in listed if each != mover), *([mover] if node in neighbours else [])}))
        for node, listed in graph.items()
    }


def _less(asks: tuple[int, ...], node: int) -> tuple[int, ...]:
    at = asks.index(node)
    return asks[:at] + asks[at + 1 :]


def _copy(robot: LeaveLock) -> LeaveLock:
    twin = object.__new__(type(robot))
    vars(twin).update({name: dict(each) if isinstance(each, dict) else each for name, each in vars(robot).items()})
    return twin


@cache
def _holes(graph: tuple[tuple[int, tuple[int, ...]], ...], standing: int) -> tuple[int, int]:
    return betti(FlagComplex({node: each for node, each in graph if standing >> node & 1}))
