"""Status of each node: running, down, paused or slow; crashed; or late to join.

A node that is down is neither observed nor awaited, and receives no packets. A paused node is not observed either, but its
packets wait. A slow node is observed again once it has finished its last observation; until then its answer is held back.
A change of status yields the actions that the runner of the nodes' programs has to carry out.
"""

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np

from zwerm.wire.messages import Command, Failure
from zwerm.world.scene import Bools, Ints

ActionKind = Literal["kill", "start", "pause", "resume"]
Event = Literal["crashed", "restarted", "paused", "slow", "late"]
NodeAnswer = tuple[int, Command | Failure]

FULL_SPEED_TICKS: Final = 1


class ProcessAction(NamedTuple):
    """An action on a node's program, to carry out before any node is observed at this tick."""

    kind: ActionKind
    node: int


class NodeStatus:
    """The status of `nodes` nodes; the nodes in `late_joiners` start later."""

    def __init__(self, nodes: int, late_joiners: Sequence[int] = ()) -> None:
        self.down: Bools = np.zeros(nodes, dtype=np.bool_)
        self.down[list(late_joiners)] = True
        self.paused: Bools = np.zeros(nodes, dtype=np.bool_)
        self.answer_ticks: Ints = np.full(nodes, FULL_SPEED_TICKS)  # ticks that a node takes over an answer
        self.withheld: Bools = np.zeros(nodes, dtype=np.bool_)  # nodes that the driver excludes from observation
        self.crashed: dict[int, str] = {}  # the reason by node, of programs that ended on their own, in order
        self.crash_ticks: dict[int, int] = {}  # the tick of the newest such end, by node
        self.failures: dict[int, Failure] = {}  # of controllers that raised
        self.gone: Sequence[int] = ()  # nodes that a fault keeps down to the end of the run
        self.history: dict[Event, list[int]] = {}  # the nodes to which each event ever happened, in order
        self._busy_until: Ints = np.zeros(nodes, dtype=np.int64)
        self._held: dict[int, list[NodeAnswer]] = {}  # answers of slow nodes, by the tick at which they act
        self._hindered = bool(late_joiners)
        for node in late_joiners:
            self.record("late", node)

    @property
    def dead(self) -> list[int]:
        """The nodes that are down and never return, ascending."""
        if not (self.crashed or self.gone):
            return []
        return sorted({*self.crashed, *self.gone})

    def ever(self, event: Event) -> list[int]:
        """Return the nodes to which `event` ever happened, in order."""
        return self.history.get(event, [])

    def record(self, event: Event, node: int) -> None:
        """Add a node to the history of an event, once."""
        nodes = self.history.setdefault(event, [])
        if node not in nodes:
            nodes.append(node)

    def change(self, down: Bools, paused: Bools, answer_ticks: Ints) -> list[ProcessAction]:
        """Set the status arrays (nodes,), and return the actions that follow, by node id."""
        actions: list[ProcessAction] = []
        for node in np.flatnonzero((down != self.down) | (paused != self.paused)).tolist():
            if down[node] and not self.down[node]:
                actions.append(ProcessAction("kill", node))
                self.record("crashed", node)
            elif self.down[node] and not down[node]:
                actions.append(ProcessAction("start", node))
            # A started program is not paused; a killed one is not resumed.
            was_paused = bool(self.paused[node] and not self.down[node])
            is_paused = bool(paused[node] and not down[node])
            if is_paused and not was_paused:
                actions.append(ProcessAction("pause", node))
                self.record("paused", node)
            elif was_paused and not is_paused and not down[node]:
                actions.append(ProcessAction("resume", node))
        for node in np.flatnonzero(answer_ticks > self.answer_ticks).tolist():
            self.record("slow", node)
        self.down, self.paused, self.answer_ticks = down, paused, answer_ticks
        slow = bool((answer_ticks > FULL_SPEED_TICKS).any())
        self._hindered = bool(down.any() or paused.any() or slow or self._held)
        return actions

    def observable(self, nodes: Ints, tick: int) -> Ints:
        """Return those of `nodes` that can take an observation at `tick`; slow nodes among them are busy from now on."""
        if not self._hindered and not self.withheld.any():
            return nodes
        excluded = self.down[nodes] | self.paused[nodes] | self.withheld[nodes]
        nodes = nodes[~excluded & (self._busy_until[nodes] <= tick)]
        self._busy_until[nodes] = tick + self.answer_ticks[nodes]
        return nodes

    def due_answers(self, answers: Sequence[NodeAnswer], tick: int) -> list[NodeAnswer]:
        """Take the answers of `tick`, and return those that act now: first the ones that slow nodes gave earlier."""
        if not self._hindered:
            return list(answers)
        due = self._held.pop(tick, [])
        for node, answer in answers:
            if self.answer_ticks[node] > FULL_SPEED_TICKS:
                self._held.setdefault(tick + int(self.answer_ticks[node]) - 1, []).append((node, answer))
            else:
                due.append((node, answer))
        return due

    def drop_unfinished(self, node: int) -> None:
        """Drop the held answers of a node: its program is dead."""
        self._busy_until[node] = 0
        for tick, held in self._held.items():
            self._held[tick] = [(other, answer) for other, answer in held if other != node]
