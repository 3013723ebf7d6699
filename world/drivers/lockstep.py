"""Lock-step: virtual time goes on when every node that is awake has answered, and not before.

A node that stays silent past a wall-clock deadline ends the run with its name; it never changes the result.
"""

import time
from collections.abc import Callable
from typing import Final

from zwerm.errors import ProtocolError, StragglerError
from zwerm.link import Arrival, NodeProcesses, WorldLink
from zwerm.world.tick.process_control import ProcessController
from zwerm.world.world import World

# A part of this many of the answers is waited for after the rest.
_LAST: Final = 8

OnTick = Callable[[World], None]

# What a run may end with; "interrupted" is the caller's to say.
COMPLETED: Final = "completed"
TIME_LIMIT: Final = "time-limit"
FAILED: Final = "failed"
INTERRUPTED: Final = "interrupted"


class LockStep:
    """Drives a world over a link. `lost` counts observations that were never answered by a living node."""

    def __init__(
        self, world: World, link: WorldLink, on_tick: OnTick | None = None, programs: NodeProcesses | None = None
    ) -> None:
        self._world = world
        self._link = link
        self._undertaker = ProcessController(world, link, programs, self._take)
        self._on_tick = on_tick
        self._last_tick = round(world.scenario.time.duration_s / world.scenario.time.dt_s)
        self.reason = ""
        self.lost = 0

    def run(self) -> str:
        """Go on until the run is over, and return its outcome; `reason` then says why it failed.

        Raises StragglerError where a node misses the deadline.
        """
        world = self._world
        while world.tick < self._last_tick:
            self._tick()
            if world.crashed and world.scenario.robots.on_crash == "fail":
                return self._fail()
            if world.telemetry.gave_up:
                self.reason = world.telemetry.gave_up
                return FAILED
            if world.completed:
                return COMPLETED
        return TIME_LIMIT

    def _tick(self) -> None:
        world, link = self._world, self._link
        self._undertaker.carry_out(world.begin())
        nodes, _ = world.observe(link.send)
        world.foresee()
        self._collect(len(nodes))
        if world.crashed and world.scenario.robots.on_crash == "fail":
            return
        world.advance()
        if self._on_tick is not None:
            self._on_tick(world)

    def _collect(self, missing: int) -> None:
        """Receive until nobody is awaited; `missing` bounds the answers that can come in order."""
        world = self._world
        straggler_s = world.scenario.time.straggler_s
        deadline: float | None = None
        while missing > 0:
            patience_s = straggler_s if deadline is None else max(0.0, deadline - time.monotonic())
            # All but a few: those still come while the others are read.
            arrivals = self._link.receive_many(missing - missing // _LAST, patience_s)
            if not arrivals:
                self.lost += len(world.awaited())
                raise StragglerError(world.awaited(), world.tick, straggler_s)
            accept = world.accept
            for arrival in arrivals:
                node, payload = arrival
                if payload is None:
                    self._take(arrival)
                    missing = len(world.awaited())
                    continue
                try:
                    accept(node, payload)
                    missing -= 1
                except ProtocolError:  # counted by the world
                    # Time that a babbling node uses up is not given back to it.
                    deadline = deadline or time.monotonic() + straggler_s

    def _take(self, arrival: Arrival) -> bool:
        """Tell the world what has come; return whether it was an answer to this tick's observation."""
        node, payload = arrival
        if payload is None:
            self._world.crash(node, "process ended")
            return False
        try:
            self._world.accept(node, payload)
        except ProtocolError:
            return False  # counted by the world
        return True

    def _fail(self) -> str:
        node, reason = next(iter(self._world.crashed.items()))
        self.reason = f"node {node} crashed at tick {self._world.tick}: {reason}"
        return FAILED
