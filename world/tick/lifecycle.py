"""Lifecycle of nodes: the effect on the world when a node enters, leaves, crashes, or suffers a fault of its program."""

from typing import Final

from zwerm.world.bodies.bodies import Bodies
from zwerm.world.radio.medium import Medium
from zwerm.world.tick.completion import Completion
from zwerm.world.tick.node_status import NodeStatus, ProcessAction
from zwerm.world.tick.wakes import Wakes

CRASHED: Final = "receiver-crashed"
LEFT: Final = "receiver-left"
DOWN: Final = "receiver-down"


class Lifecycle:
    """Keeps status, wake rule, bodies and radio consistent when a node comes or goes."""

    def __init__(
        self,
        status: NodeStatus,
        wakes: Wakes,
        bodies: Bodies,
        medium: Medium,
        completion: Completion,
        deadman_ticks: int,
    ) -> None:
        """The motors of a paused robot stop `deadman_ticks` ticks after its program."""
        self._status = status
        self._wakes = wakes
        self._bodies = bodies
        self._medium = medium
        self._completion = completion
        self._deadman_ticks = deadman_ticks
        self._stops_at: dict[int, int] = {}  # the tick at which the motors of a paused robot stop
        for node, down in enumerate(status.down.tolist()):
            if down:
                medium.switch_off(node, DOWN)

    def admit(self, node: int) -> None:
        """Observe a node from now on, if its program runs."""
        if not self._status.down[node]:
            self._wakes.admit(node)

    def pass_entrance(self) -> None:
        """Let robots leave and enter the arena, and observe those that entered."""
        left, entered = self._bodies.pass_entrance()
        for node in left:
            self._retire(node, LEFT)
        for node in entered:
            self.admit(node)

    def crash(self, node: int, reason: str) -> None:
        """Record that a running program ended: its motors stop, it is never awaited again, its body stays."""
        if node not in self._status.crashed and not self._status.down[node]:
            self._status.crashed[node] = reason
            self._retire(node, CRASHED)

    def stop_paused(self, tick: int) -> None:
        """Stop the motors of robots that have been paused for the deadman time."""
        for node, stops_at in list(self._stops_at.items()):
            if tick >= stops_at:
                self._bodies.stop(node)
                del self._stops_at[node]

    def apply(self, action: ProcessAction, tick: int) -> bool:
        """Give an action its effect on the world; return whether there is a program to carry it out on."""
        kind, node = action
        status = self._status
        if kind == "kill":
            alive = status.crashed.pop(node, None) is None
            status.record("crashed", node)
            status.drop_unfinished(node)
            self._retire(node, CRASHED)
            self._completion.restart(node)
            self._stops_at.pop(node, None)
            return alive
        if kind == "start":
            if node in status.ever("crashed"):
                status.record("restarted", node)
            if node not in self._bodies.exited:
                self._medium.switch_on(node)
            present = self._bodies.scene.present
            if node >= len(present) or present[node]:
                self.admit(node)
        elif kind == "pause":
            self._stops_at[node] = tick + self._deadman_ticks
        else:
            self._stops_at.pop(node, None)
        return node not in status.crashed

    def _retire(self, node: int, cause: str) -> None:
        self._wakes.retire(node)
        self._bodies.stop(node)
        self._medium.switch_off(node, cause)
