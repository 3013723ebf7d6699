"""Carrying out what faults demand of nodes' programs.

In lock-step the undertaker does, and time stands still meanwhile. When an order has been carried out, the node it is about is
dead and buried, or has joined: whatever a dead program had still said is refused as stale, and its end has been reported, so
that nothing of it can be mistaken for its successor's. In real time nobody may wait for a program to die or to start: a
runner of errands does what is ordered in a thread of its own.
"""

import queue
import threading
import time
from collections.abc import Callable, Sequence
from typing import Final

from zwerm.errors import LinkError
from zwerm.link import Arrival, NodeProcesses, WorldLink
from zwerm.world.tick.node_status import ProcessAction
from zwerm.world.world import World

BURIAL_DEADLINE_S: Final = 10.0


def do(order: ProcessAction, programs: NodeProcesses | None) -> None:
    """Do to a program what is ordered. Raises LinkError where nobody can, or it does not join."""
    deed, node = order
    if programs is None:
        raise LinkError(f"node {node}: a fault would {deed} its program, which runs elsewhere")
    {"kill": programs.kill, "start": programs.start, "pause": programs.pause, "resume": programs.resume}[deed](node)


class ActionThread:
    """Carries out orders one after the other, in a thread of its own. `close` ends it after the order it is about."""

    def __init__(self, programs: NodeProcesses | None) -> None:
        self._programs = programs
        self._asked: queue.SimpleQueue[ProcessAction | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[ProcessAction | Exception] = queue.SimpleQueue()
        self._closing = False
        self._thread: threading.Thread | None = None

    def ask(self, order: ProcessAction) -> None:
        """Have an order carried out after those before it."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="zwerm-errands", daemon=True)
            self._thread.start()
        self._asked.put(order)

    def done(self) -> list[ProcessAction]:
        """Return the orders that have been carried out since the last call. Raises LinkError where one could not be."""
        found: list[ProcessAction] = []
        while not self._done.empty():
            order = self._done.get()
            if isinstance(order, Exception):
                raise order
            found.append(order)
        return found

    def close(self) -> None:
        """Drop what is not begun, and return when what is has ended; idempotent."""
        self._closing = True
        if self._thread is not None:
            self._asked.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (order := self._asked.get()) is not None and not self._closing:
            try:
                do(order, self._programs)
                self._done.put(order)
            except Exception as error:  # raised where somebody can do something about it
                self._done.put(error)


class ProcessController:
    """Carries out orders of `world` on `programs`, whose nodes are heard over `link`."""

    def __init__(
        self, world: World, link: WorldLink, programs: NodeProcesses | None, others: Callable[[Arrival], object]
    ) -> None:
        """`others` takes what other nodes say meanwhile."""
        self._world = world
        self._link = link
        self._programs = programs
        self._others = others

    def carry_out(self, orders: Sequence[ProcessAction]) -> None:
        """Do as told. Raises LinkError where a program does not die, or does not join."""
        for order in orders:
            do(order, self._programs)
            if order.deed == "kill":
                self._bury(order.node)
            elif order.deed == "start":
                self._forget_the_former(order.node)

    def _forget_the_former(self, node: int) -> None:
        """Take in what its former incarnation left: the new one has been sent nothing, and cannot have spoken."""
        while (arrival := self._link.receive(0.0)) is not None:
            if arrival.node != node:
                self._others(arrival)
            elif arrival.payload is not None:
                self._world.refused["stale-incarnation"] += 1

    def _bury(self, node: int) -> None:
        deadline = time.monotonic() + BURIAL_DEADLINE_S
        while (arrival := self._link.receive(max(0.0, deadline - time.monotonic()))) is not None:
            if arrival.node != node:
                self._others(arrival)
            elif arrival.payload is None:
                return
            else:
                self._world.refused["stale-incarnation"] += 1
        raise LinkError(f"node {node} was killed, and its end was not reported within {BURIAL_DEADLINE_S:g} s")
