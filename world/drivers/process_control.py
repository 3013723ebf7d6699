"""Process control: carries out on nodes' programs the actions that faults demand.

In lock-step `ProcessController` carries them out, and virtual time stops meanwhile. After an action the node is dead and its
end has been reported, or it has joined. Messages of its former incarnation are refused as stale, and cannot be taken
for messages of its successor. In real time the world cannot wait for a program to end or to start: `ActionThread`
carries out actions in a thread of its own.
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

EXIT_DEADLINE_S: Final = 10.0


def carry_out(action: ProcessAction, programs: NodeProcesses | None) -> None:
    """Carry out one action. Raises LinkError where the programs run elsewhere, or one does not join."""
    kind, node = action
    if programs is None:
        raise LinkError(f"node {node}: a fault would {kind} its program, which runs elsewhere")
    {"kill": programs.kill, "start": programs.start, "pause": programs.pause, "resume": programs.resume}[kind](node)


class ActionThread:
    """Carries out actions one after the other in a thread of its own. `close` waits for the action in progress."""

    def __init__(self, programs: NodeProcesses | None) -> None:
        self._programs = programs
        self._requested: queue.SimpleQueue[ProcessAction | None] = queue.SimpleQueue()
        self._finished: queue.SimpleQueue[ProcessAction | Exception] = queue.SimpleQueue()
        self._closing = False
        self._thread: threading.Thread | None = None

    def request(self, action: ProcessAction) -> None:
        """Queue an action behind those requested before."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="zwerm-process-actions", daemon=True)
            self._thread.start()
        self._requested.put(action)

    def finished(self) -> list[ProcessAction]:
        """Return the actions carried out since the last call. Raises the LinkError of an action that failed."""
        found: list[ProcessAction] = []
        while not self._finished.empty():
            action = self._finished.get()
            if isinstance(action, Exception):
                raise action
            found.append(action)
        return found

    def close(self) -> None:
        """Drop the actions that have not begun, and return when the one in progress has ended; idempotent."""
        self._closing = True
        if self._thread is not None:
            self._requested.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (action := self._requested.get()) is not None and not self._closing:
            try:
                carry_out(action, self._programs)
                self._finished.put(action)
            except Exception as error:  # raised again by `finished`, in the driver's thread
                self._finished.put(error)


class ProcessController:
    """Carries out actions on `programs`, whose nodes send over `link`, and waits for their effect."""

    def __init__(
        self, world: World, link: WorldLink, programs: NodeProcesses | None, take: Callable[[Arrival], object]
    ) -> None:
        """`take` receives the messages that other nodes send meanwhile."""
        self._world = world
        self._link = link
        self._programs = programs
        self._take = take

    def carry_out(self, actions: Sequence[ProcessAction]) -> None:
        """Carry out actions in order. Raises LinkError where a program does not end, or does not join."""
        for action in actions:
            carry_out(action, self._programs)
            if action.kind == "kill":
                self._await_exit(action.node)
            elif action.kind == "start":
                self._drop_stale(action.node)

    def _drop_stale(self, node: int) -> None:
        """Refuse the messages of the former incarnation: the new one has received nothing and has sent no answer."""
        while (arrival := self._link.receive(0.0)) is not None:
            if arrival.node != node:
                self._take(arrival)
            elif arrival.payload is not None:
                self._world.refuse_stale(node)

    def _await_exit(self, node: int) -> None:
        """Wait until the link has reported the node lost. Raises LinkError after EXIT_DEADLINE_S."""
        deadline = time.monotonic() + EXIT_DEADLINE_S
        while (arrival := self._link.receive(max(0.0, deadline - time.monotonic()))) is not None:
            if arrival.node != node:
                self._take(arrival)
            elif arrival.payload is None:
                return
            else:
                self._world.refuse_stale(node)
        raise LinkError(f"node {node} was killed, and the link did not report its end within {EXIT_DEADLINE_S:g} s")
