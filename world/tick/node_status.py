"""Lives: which nodes' programs run, which of their incarnations it is, and who is stopped or slow.

A node that is down is neither observed nor awaited, and its radio hears nothing; one that is paused is not observed either,
but its mail waits for it. A slow node is observed only once it is done with the observation before, and what it answers is
held back until then. Whatever changes here is an order for those who run the programs.
"""

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np

from zwerm.wire.messages import Command, Failure
from zwerm.world.scene import Bools, Ints

Deed = Literal["kill", "start", "pause", "resume"]
Held = tuple[int, Command | Failure]

ONE: Final = 1


class ProcessAction(NamedTuple):
    """What is to be done to a node's program, before anybody is observed at this tick."""

    deed: Deed
    node: int


class NodeStatus:
    """The lives of `nodes` nodes; `unborn` start later. Nodes that are present in the arena are not its business."""

    def __init__(self, nodes: int, unborn: Sequence[int] = ()) -> None:
        self.down: Bools = np.zeros(nodes, dtype=np.bool_)
        self.down[list(unborn)] = True
        self.paused: Bools = np.zeros(nodes, dtype=np.bool_)
        self.every: Ints = np.ones(nodes, dtype=np.int64)  # ticks that a node takes over an answer
        self.withheld: Bools = np.zeros(nodes, dtype=np.bool_)  # whom the driver does not want observed now
        self.ever: dict[str, list[int]] = {}  # who was ever crashed, restarted, paused, slow or late, in order
        self._busy_until: Ints = np.zeros(nodes, dtype=np.int64)
        self._held: dict[int, list[Held]] = {}
        self._hindered = bool(unborn)
        for node in unborn:
            self.note("late", node)

    def note(self, what: str, node: int) -> None:
        """Remember that this happened to a node."""
        nodes = self.ever.setdefault(what, [])
        if node not in nodes:
            nodes.append(node)

    def change(self, down: Bools, paused: Bools, every: Ints) -> list[ProcessAction]:
        """Make (nodes,) who is down, paused and slow as told; return the orders that follow, by node."""
        orders: list[ProcessAction] = []
        for node in np.flatnonzero((down != self.down) | (paused != self.paused)).tolist():
            if down[node] and not self.down[node]:
                orders.append(ProcessAction("kill", node))
                self.note("crashed", node)
            elif self.down[node] and not down[node]:
                orders.append(ProcessAction("start", node))
            # A program that is started is not stopped; one that dies needs no waking.
            stopped = bool(self.paused[node] and not self.down[node])
            stop = bool(paused[node] and not down[node])
            if stop and not stopped:
                orders.append(ProcessAction("pause", node))
                self.note("paused", node)
            elif stopped and not stop and not down[node]:
                orders.append(ProcessAction("resume", node))
        for node in np.flatnonzero(every > self.every).tolist():
            self.note("slow", node)
        self.down, self.paused, self.every = down, paused, every
        self._hindered = bool(down.any() or paused.any() or (every > ONE).any() or self._held)
        return orders

    def able(self, nodes: Ints, tick: int) -> Ints:
        """Return those of `nodes` that can take an observation at `tick`; the slow among them are busy from now on."""
        if not self._hindered and not self.withheld.any():
            return nodes
        kept_away = self.down[nodes] | self.paused[nodes] | self.withheld[nodes]
        nodes = nodes[~kept_away & (self._busy_until[nodes] <= tick)]
        self._busy_until[nodes] = tick + self.every[nodes]
        return nodes

    def finished(self, answers: Sequence[Held], tick: int) -> list[Held]:
        """Take the answers that came at `tick`, and return those that act now: the held ones first."""
        if not self._hindered:
            return list(answers)
        acting = self._held.pop(tick, [])
        for node, answer in answers:
            if self.every[node] > ONE:
                self._held.setdefault(tick + int(self.every[node]) - 1, []).append((node, answer))
            else:
                acting.append((node, answer))
        return acting

    def forget(self, node: int) -> None:
        """Drop what a node has not finished: its program is dead."""
        self._busy_until[node] = 0
        for tick, held in self._held.items():
            self._held[tick] = [(other, answer) for other, answer in held if other != node]
