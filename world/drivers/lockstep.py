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


class LockStep(Driver):
    """Drives a world in lock-step. `run` raises StragglerError where a node misses the deadline."""

    def __init__(
        self,
        world: World,
        link: WorldLink,
        observers: Sequence[TickObserver] = (),
        programs: NodeProcesses | None = None,
    ) -> None:
        super().__init__(world, link, observers)
        self._processes = ProcessController(world, link, programs, self._take)
        self._straggler_s = world.scenario.time.straggler_s
        self._lost = 0

    @property
    def lost(self) -> int:
        """Number of observations that living nodes have not answered: at most those of the last tick."""
        return self._lost

    def _carry_out(self, actions: Sequence[ProcessAction]) -> None:
        self._processes.carry_out(actions)

    def _exchange(self) -> None:
        nodes, _ = self._world.observe(self._link.send)
        self._world.precompute()
        self._collect(len(nodes))

    def _collect(self, missing: int) -> None:
        """Receive until no node is awaited; `missing` bounds the number of answers that are still to come."""
        world = self._world
        deadline: float | None = None
        while missing > 0:
            timeout_s = self._straggler_s if deadline is None else max(0.0, deadline - time.monotonic())
            # All but a few: the last ones arrive while the others are decoded.
            arrivals = self._link.receive_many(missing - missing // _LAST, timeout_s)
            if not arrivals:
                self._lost += len(world.awaited())
                raise StragglerError(world.awaited(), world.tick, self._straggler_s)
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
                except ProtocolError:  # the world has counted it
                    # A refused message does not extend the deadline.
                    deadline = deadline or time.monotonic() + self._straggler_s

    def _take(self, arrival: Arrival) -> None:
        """Give an arrival to the world."""
        node, payload = arrival
        if payload is None:
            self._world.crash(node, "process ended")
            return
        with contextlib.suppress(ProtocolError):  # the world has counted it
            self._world.accept(node, payload)
