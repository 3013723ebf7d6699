"""A simulated network: connections, clocks and deaths of robots as events in virtual time, each run a function of its seed.

The drivers, the world, the nodes and the admission of nodes are the real ones. Link, transport and processes are
replaced. The replacements have latency, a cable that is cut and repaired, and a lease that ends. A process may be
killed or hang, and a program may return.
"""

import heapq
import itertools
import random
from collections.abc import Callable, Iterable, Sequence
from functools import partial

import pytest
from network import NIL

from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.link import Arrival
from zwerm.link.admission import Admission, ExpectedNode
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Hello
from zwerm.wire.refusals import Refusals
from zwerm.world.drivers import lockstep, realtime

LEASE_S = 10.0


class VirtualTime:
    """The clock that drivers see in place of the module `time`."""

    def __init__(self, network: "VirtualNetwork") -> None:
        self._network = network

    def monotonic(self) -> float:
        """Return the virtual time [s]."""
        return self._network.now

    def sleep(self, duration_s: float) -> None:
        """Let virtual time pass."""
        self._network.advance(self._network.now + duration_s)


class VirtualNetwork:
    """The world's end of a simulated network to all nodes of a scenario, with random latencies and the failures asked for.

    `lost_at` is the time at which each node was reported lost, `refusals` counts refused messages and refused returns.
    """

    def __init__(self, scenario: Scenario, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        self.refusals = Refusals()
        self.lost_at: dict[int, float] = {}
        self._random = random.Random(seed)
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._number = itertools.count()
        self._arrivals: list[Arrival] = []
        self._nodes = {node: Node(*spec) for node, spec in node_specs(scenario, 1).items()}
        self.admission = Admission({node: ExpectedNode(1, "", NIL) for node in self._nodes})
        self._cut: dict[int, float] = {}  # the time at which each node behind a cut cable is reachable again
        self._silent: set[int] = set()  # dead or hanging
        self._last: dict[tuple[str, int], float] = {}  # messages of one direction stay in order
        for node in self._nodes:
            assert self.admission.greet(node, Hello(node, 1)) == ""
        for module in (lockstep, realtime):
            monkeypatch.setattr(module, "time", VirtualTime(self))

    # --- failures ---------------------------------------------------------------------------------------------------

    def cut(self, nodes: Sequence[int], at_s: float, for_s: float) -> None:
        """Cut the cable to `nodes` at a time, and repair it after `for_s`. Their programs then try to go on, or to join
        again."""

        def begin() -> None:
            for node in nodes:
                self._cut[node] = max(self._cut.get(node, 0.0), at_s + for_s)

        def expire(node: int) -> None:
            if self._cut.get(node, 0.0) > self.now:
                self._lose(node)

        def mend(node: int) -> None:
            if self._cut.get(node, 0.0) > self.now:
                return  # cut again meanwhile
            self._cut.pop(node, None)
            if node not in self.admission.joined:
                self.refusals.count(node, self.admission.greet(node, Hello(node, 1)))

        self._at(at_s, begin)
        for node in nodes:
            self._at(at_s + LEASE_S, partial(expire, node))
            self._at(at_s + for_s, partial(mend, node))

    def kill(self, node: int, at_s: float = -1.0) -> None:
        """Kill a node's process: the kernel closes its connection at once."""

        def die() -> None:
            self._silent.add(node)
            self._lose(node)

        self._at(max(at_s, self.now), die)

    def hang(self, node: int, at_s: float) -> None:
        """Let a node's controller hang: its connection stays."""
        self._at(at_s, lambda: self._silent.add(node))

    # --- the world's end --------------------------------------------------------------------------------------------

    def send(self, node: int, payload: bytes) -> None:
        """Carry a message to a node, and its answer back."""

        def arrive() -> None:
            if node in self._silent or node not in self.admission.joined:
                return
            answer = self._nodes[node].answer(payload)
            self._later("in", node, lambda: self._receive(node, answer))

        self._later("out", node, arrive)

    def send_many(self, messages: Iterable[tuple[int, bytes]]) -> None:
        """Carry messages to nodes, and their answers back."""
        for node, payload in messages:
            self.send(node, payload)

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout_s` of virtual time."""
        self._wait(1, timeout_s)
        return self._arrivals.pop(0) if self._arrivals else None

    def receive_many(self, count: int, timeout_s: float) -> list[Arrival]:
        """Return all arrivals once there are `count`, or a node is lost, or `timeout_s` of virtual time has passed."""
        self._wait(count, timeout_s)
        arrivals, self._arrivals = self._arrivals, []
        return arrivals

    def idle(self, nodes: Sequence[int], timeout_s: float) -> list[int]:
        """Return those of `nodes` that would leave when told to."""
        self.advance(self.now + timeout_s)
        return [node for node in nodes if node not in self._silent and node not in self._cut]

    def evict(self, node: int) -> None:
        """Lose a node."""
        self._lose(node)

    def close(self) -> None:
        """Drop all events."""
        self._events.clear()

    def advance(self, until_s: float) -> None:
        """Let everything happen up to a time."""
        while self._events and self._events[0][0] <= until_s:
            self.now, _, happen = heapq.heappop(self._events)
            happen()
        self.now = max(self.now, until_s)

    # --- inside -----------------------------------------------------------------------------------------------------

    def _wait(self, count: int, timeout_s: float) -> None:
        end_s = self.now + timeout_s
        while len(self._arrivals) < count and not any(each.payload is None for each in self._arrivals):
            if not self._events or self._events[0][0] > end_s:
                self.now = max(self.now, end_s)
                return
            self.now, _, happen = heapq.heappop(self._events)
            happen()

    def _at(self, time_s: float, happen: Callable[[], None]) -> None:
        heapq.heappush(self._events, (time_s, next(self._number), happen))

    def _later(self, direction: str, node: int, happen: Callable[[], None]) -> None:
        """Delay a message: in order, and over a cut cable until the repair, if the connection is alive then."""
        time_s = max(self.now + self._random.uniform(0.0001, 0.02), self._cut.get(node, 0.0))
        time_s = max(time_s, self._last.get((direction, node), 0.0))
        self._last[direction, node] = time_s
        self._at(time_s, happen)

    def _receive(self, node: int, payload: bytes) -> None:
        if node not in self.admission.joined:
            self.refusals.count(node, "not-joined")
        elif self._cut.get(node, 0.0) > self.now:
            self._later("in", node, lambda: self._receive(node, payload))
        else:
            self._arrivals.append(Arrival(node, payload))

    def _lose(self, node: int) -> None:
        if self.admission.lose(node):
            self.lost_at[node] = self.now
            self._arrivals.append(Arrival(node, None))
