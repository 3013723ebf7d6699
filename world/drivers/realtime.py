"""Real time: the wall clock paces the ticks, and the world waits for no node.

A command that misses its tick is counted and applied when it arrives. A robot without an answer for the deadman time is
stopped until it answers again. A node with too many unanswered observations is not observed until it answers one. So
all messages to it fit into the buffers of the link, and sending never blocks. While a fault kills or starts a program,
its node is not observed either. Runs in real time are not repeatable, and their traces differ.
"""

import contextlib
import time
from collections import Counter, deque
from collections.abc import Sequence
from typing import Final

from zwerm.errors import ProtocolError
from zwerm.link import Arrival, NodeProcesses, WorldLink
from zwerm.world.drivers.driver import Driver, TickObserver
from zwerm.world.drivers.process_control import ActionThread
from zwerm.world.tick.node_status import ProcessAction
from zwerm.world.world import World

EXIT_CODE_S: Final = 0.05  # how long a tick may wait for the exit code of a lost node's process

# The unanswered observations at which a node is no longer observed: their number, and their total size in bytes. All fit into
# a Unix socket of 208 KiB and the batches of the link: 51 of 2 KB (measured).
UNANSWERED_MAX: Final = 48
UNANSWERED_BYTES_MAX: Final = 131_072


class RealTime(Driver):
    """Drives a world at `factor` times the speed of the wall clock.

    `deadman_stops` counts robots stopped because they were silent, `overruns` ticks that took longer than their period.
    """

    def __init__(
        self,
        world: World,
        link: WorldLink,
        factor: float,
        observers: Sequence[TickObserver] = (),
        programs: NodeProcesses | None = None,
        before_send: TickObserver | None = None,
    ) -> None:
        """`before_send` is called between sensing and sending."""
        super().__init__(world, link, observers, programs)
        self._actions = ActionThread(programs)
        self._tick_s = world.scenario.time.dt_s / factor
        self._deadman_s = world.scenario.time.deadman_s
        self._before_send = before_send
        self._start_s = 0.0  # on the monotonic clock
        # The tick and size [bytes] of each node's unanswered observations.
        self._unanswered: dict[int, deque[tuple[int, int]]] = {}
        self._silent_since_s: dict[int, float] = {}  # virtual time of the first of them
        self._dying: Counter[int] = Counter()  # kills that have been requested and not yet reported, by node
        self._starting: Counter[int] = Counter()
        self._stopped: dict[int, None] = {}
        self.deadman_stops = 0
        self.overruns = 0
        self._lost = 0

    @property
    def lost(self) -> int:
        """The number of observations that were never answered although the node answered a later one."""
        return self._lost

    def run(self) -> str:
        """Drive until the run ends, and return its outcome. Raises LinkError where a fault cannot be carried out."""
        self._start_s = time.monotonic()
        try:
            return super().run()
        finally:
            self._actions.close()

    def _carry_out(self, actions: Sequence[ProcessAction]) -> None:
        """Request the actions of this tick; no answers are expected of a dead node."""
        for action in actions:
            kind, node = action
            if kind == "kill":
                self._dying[node] += 1
                for kept in (self._unanswered, self._silent_since_s, self._stopped):
                    kept.pop(node, None)
            elif kind == "start":
                self._starting[node] += 1
            self._withhold(node)
            self._actions.request(action)
        for kind, node in self._actions.finished():
            if kind == "start":
                self._starting[node] -= 1
                self._withhold(node)

    def _exchange(self) -> None:
        world = self._world
        time_s = world.scene.time_s
        deadline_s = self._start_s + (world.tick + 1) * self._tick_s
        nodes, observations = world.observe()
        if self._before_send is not None:
            self._before_send(world)
        for node, observation in zip(nodes, observations, strict=True):
            self._link.send(node, observation)
            self._unanswered.setdefault(node, deque()).append((world.tick, len(observation)))
            self._withhold(node)
            self._silent_since_s.setdefault(node, time_s)
        self._listen(deadline_s)
        self._stop_the_silent(time_s)

    def _listen(self, deadline_s: float) -> None:
        """Take all arrivals until `deadline_s` on the monotonic clock; if that has passed, take those that wait."""
        if time.monotonic() > deadline_s:
            self.overruns += 1
        while (arrival := self._link.receive(max(0.0, deadline_s - time.monotonic()))) is not None:
            self._take(arrival)
        # A link in memory does not wait: sleep for the rest of the tick.
        time.sleep(max(0.0, deadline_s - time.monotonic()))

    def _take(self, arrival: Arrival) -> None:
        """Pass an arrival to the world, unless it is of a program that is being killed."""
        node, payload = arrival
        if self._dying[node]:
            if payload is None:
                self._dying[node] -= 1
            else:
                self._world.refuse_stale(node)
            return
        if payload is None:
            self._lose(node, EXIT_CODE_S)
            return
        self._silent_since_s.pop(node, None)
        self._stopped.pop(node, None)
        with contextlib.suppress(ProtocolError):  # the world has counted the refusal
            self._world.accept(node, payload, late_allowed=True)
        self._note_answer(node)

    def _note_answer(self, node: int) -> None:
        """Remove the observations that a node has answered, and count those that it skipped: nodes answer in order."""
        unanswered, newest = self._unanswered.get(node), self._world.newest_answer(node)
        if not unanswered:
            return
        while unanswered and unanswered[0][0] <= newest:
            tick, _ = unanswered.popleft()
            self._lost += tick < newest
        self._withhold(node)

    def _withhold(self, node: int) -> None:
        """Exclude a node from observation while its program starts or it has too many unanswered observations."""
        sizes = [size for _, size in self._unanswered.get(node, ())]
        too_many = len(sizes) >= UNANSWERED_MAX or sum(sizes) >= UNANSWERED_BYTES_MAX
        self._world.withhold(node, bool(self._starting[node]) or too_many)

    def _stop_the_silent(self, time_s: float) -> None:
        """Stop the motors of robots without an answer for the deadman time."""
        dead = self._world.dead
        for node, since_s in self._silent_since_s.items():
            if since_s < time_s - self._deadman_s and node not in self._stopped and node not in dead:
                self._world.stop(node)
                self._stopped[node] = None
                self.deadman_stops += 1
