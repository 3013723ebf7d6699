"""Lock-step: virtual time advances when every node that is awake has answered, and not before.

A node without an answer until a wall-clock deadline ends the run with its name; the deadline never changes a result.
"""

import contextlib
import time
from collections.abc import Sequence
from typing import Final

from zwerm.errors import ProtocolError, StragglerError
from zwerm.link import Arrival, NodeProcesses, WorldLink
from zwerm.world.drivers.driver import Driver, TickObserver
from zwerm.world.drivers.process_control import ProcessController
from zwerm.world.tick.node_status import ProcessAction
from zwerm.world.world import World

# The last 1 / 8 of the answers is awaited only after the rest has been decoded.
_LAST: Final = 8

# After a crash that ends the run, the driver takes in other answers for this time. So it names the first of several
# crashes in id order, and not the first to arrive.
CRASH_GRACE_S: Final = 1.0

# Time in which a node without an answer must leave on request. A node that leaves was not busy, so a message was lost.
PROBE_S: Final = 1.0

# Time that the driver waits for the exit code of a lost node's process. The connection ends before the process does.
EXIT_CODE_S: Final = 2.0


class LockStep(Driver):
    """Drives a world in lock-step. `run` raises StragglerError where a node misses the deadline."""

    def __init__(
        self,
        world: World,
        link: WorldLink,
        observers: Sequence[TickObserver] = (),
        programs: NodeProcesses | None = None,
    ) -> None:
        super().__init__(world, link, observers, programs)
        self._processes = ProcessController(world, link, programs, self._take)
        self._straggler_s = world.scenario.time.straggler_s
        self._lost = 0

    @property
    def lost(self) -> int:
        """The number of messages that the middleware lost. A node that is busy, hangs or is stopped has lost none."""
        return self._lost

    def _carry_out(self, actions: Sequence[ProcessAction]) -> None:
        self._processes.carry_out(actions)

    def _exchange(self) -> None:
        nodes, _ = self._world.observe(self._link.send_many)
        self._world.precompute()
        self._collect(len(nodes))

    def _collect(self, missing: int) -> None:
        """Receive until no node is awaited; `missing` bounds the number of answers that are still to come."""
        world = self._world
        fatal = False
        # Neither an answer, nor a loss, nor a refused message extends the deadline.
        deadline = time.monotonic() + self._straggler_s
        while missing > 0:
            timeout_s = max(0.0, deadline - time.monotonic())
            # All but a few: the last ones arrive while the others are decoded.
            arrivals = self._link.receive_many(missing - missing // _LAST, timeout_s)
            if not arrivals:
                if fatal:
                    return
                awaited = world.awaited()
                self._lost += len(self._link.idle(awaited, PROBE_S))
                raise StragglerError(awaited, world.tick, self._straggler_s)
            unread = iter(arrivals)
            while True:
                accepted, other = world.accept_plain(unread)
                missing -= accepted
                if other is None:
                    break
                node, payload = other
                if payload is None:
                    self._lose(node, EXIT_CODE_S)
                    missing = len(world.awaited())
                    continue
                try:
                    world.accept(node, payload)
                except ProtocolError:
                    continue  # the world has counted the refusal
                missing -= 1
            if self._evicted:
                missing, self._evicted = len(world.awaited()), False
            if not fatal and world.ending(within_tick=True) is not None:
                fatal = True
                deadline = min(deadline, time.monotonic() + CRASH_GRACE_S)

    def _take(self, arrival: Arrival) -> None:
        """Pass an arrival to the world."""
        node, payload = arrival
        if payload is None:
            self._lose(node, EXIT_CODE_S)
            return
        with contextlib.suppress(ProtocolError):  # the world has counted the refusal
            self._world.accept(node, payload)
