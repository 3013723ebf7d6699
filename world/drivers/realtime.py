"""Real time: ticks are paced by the wall clock, and nobody is waited for.

A command that misses its tick is counted and applied when it arrives. A robot that stays silent longer than the deadman
time is stopped until it speaks again; one that owes many answers is not observed until it has given one, so that what is sent
to it always fits into the buffers on the way and sending never waits. While a fault has a program killed or started, its
node is not observed either, and time goes on. Runs in real time are not repeatable, and promise no trace.
"""

import contextlib
import time
from collections import Counter, deque
from collections.abc import Sequence
from typing import Final

from zwerm.errors import ProtocolError
from zwerm.link import Arrival, NodeProcesses, WorldLink
from zwerm.world.drivers.lockstep import COMPLETED, FAILED, TIME_LIMIT, OnTick
from zwerm.world.tick.node_status import ProcessAction
from zwerm.world.tick.process_control import ActionThread
from zwerm.world.world import World

# So many answers, and observations of so many bytes, a node may owe and still be observed.
OWED_MAX: Final = 64
OWED_BYTES_MAX: Final = 131_072


class RealTime:
    """Drives a world over a link at `factor` times the speed of the wall clock."""

    def __init__(
        self,
        world: World,
        link: WorldLink,
        factor: float,
        on_tick: OnTick | None = None,
        programs: NodeProcesses | None = None,
        on_sense: OnTick | None = None,
    ) -> None:
        """`on_sense` is called between sensing and sending, `on_tick` when a tick is over."""
        self._world = world
        self._errands = ActionThread(programs)
        self._link = link
        self._dt_s = world.scenario.time.dt_s / factor
        self._on_tick = on_tick
        self._on_sense = on_sense
        self._last_tick = round(world.scenario.time.duration_s / world.scenario.time.dt_s)
        self._unanswered_since_s: dict[int, float] = {}
        self._owed: dict[int, deque[int]] = {}  # the sizes of the observations that a node has not answered
        self._dying: Counter[int] = Counter()  # nodes whose end has been ordered, and not reported yet
        self._starting: Counter[int] = Counter()
        self._stopped: dict[int, None] = {}
        self.deadman_stops = 0
        self.overruns = 0
        self.reason = ""
        world.answers.late_allowed = True

    @property
    def lost(self) -> int:
        """Return how many observations living nodes have not answered yet, besides each one's newest."""
        crashed = self._world.crashed
        return sum(max(0, len(owed) - 1) for node, owed in self._owed.items() if node not in crashed)

    def run(self) -> str:
        """Go on until the run is over, and return its outcome. Raises LinkError where a fault cannot be carried out."""
        try:
            return self._run()
        finally:
            self._errands.close()

    def _run(self) -> str:
        world = self._world
        start = time.monotonic()
        while world.tick < self._last_tick:
            deadline = start + (world.tick + 1) * self._dt_s
            self._bring_about(world.begin())
            nodes, observations = world.observe()
            if self._on_sense is not None:
                self._on_sense(world)
            for node, observation in zip(nodes, observations, strict=True):
                self._link.send(node, observation)
                self._owed.setdefault(node, deque()).append(len(observation))
                self._withhold(node)
                self._unanswered_since_s.setdefault(node, world.time_s)
            self._listen(deadline)
            self._stop_the_silent()
            world.advance()
            if self._on_tick is not None:
                self._on_tick(world)
            if world.crashed and world.scenario.robots.on_crash == "fail":
                node, why = next(iter(world.crashed.items()))
                self.reason = f"node {node} crashed at tick {world.tick}: {why}"
                return FAILED
            if world.telemetry.gave_up:
                self.reason = world.telemetry.gave_up
                return FAILED
            if world.completed:
                return COMPLETED
        return TIME_LIMIT

    def _listen(self, deadline: float) -> None:
        """Take what arrives until `deadline` on the monotonic clock; once, without waiting, where that has passed."""
        if time.monotonic() > deadline:
            self.overruns += 1
        while (arrival := self._link.receive(max(0.0, deadline - time.monotonic()))) is not None:
            self._take(arrival)
        # A link in memory answers at once and cannot wait: sleep the rest of the tick away.
        time.sleep(max(0.0, deadline - time.monotonic()))

    def _take(self, arrival: Arrival) -> None:
        """Tell the world what has come."""
        node, payload = arrival
        if self._dying[node]:  # the last words of a program that is killed, and its end
            if payload is None:
                self._dying[node] -= 1
            else:
                self._world.refused["stale-incarnation"] += 1
            return
        if payload is None:
            self._world.crash(node, "process ended")
            return
        if owed := self._owed.get(node):
            owed.popleft()
            self._withhold(node)
        self._unanswered_since_s.pop(node, None)
        self._stopped.pop(node, None)
        with contextlib.suppress(ProtocolError):  # counted by the world
            self._world.accept(node, payload)

    def _withhold(self, node: int) -> None:
        """Let a node be observed, or not: its program is being started, or it owes too much."""
        owed = self._owed.get(node, ())
        too_much = len(owed) >= OWED_MAX or sum(owed) >= OWED_BYTES_MAX
        self._world.lives.withheld[node] = bool(self._starting[node]) or too_much

    def _bring_about(self, orders: Sequence[ProcessAction]) -> None:
        """Have done to programs what faults demand; a dead one owes no answers."""
        for order in orders:
            deed, node = order
            if deed == "kill":
                self._dying[node] += 1
                for kept in (self._owed, self._unanswered_since_s, self._stopped):
                    kept.pop(node, None)
            elif deed == "start":
                self._starting[node] += 1
            self._withhold(node)
            self._errands.ask(order)
        for deed, node in self._errands.done():
            if deed == "start":
                self._starting[node] -= 1
                self._withhold(node)

    def _stop_the_silent(self) -> None:
        limit_s = self._world.time_s - self._world.scenario.time.deadman_s
        for node, since_s in self._unanswered_since_s.items():
            if since_s < limit_s and node not in self._stopped and node not in self._world.crashed:
                self._world.halt(node)
                self._stopped[node] = None
                self.deadman_stops += 1
