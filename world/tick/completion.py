"""Completion: the one rule that decides when a run ends, and with which outcome.

A run ends for one of these reasons, in this order of precedence:

1. A node crashed, and the scenario has `robots.on_crash = "fail"`.
2. A deciding node gave up.
3. The task is done.
4. Without a deciding node: every living robot is done or gave up.
5. Every robot is lost for good.
6. The time limit is reached.

Both drivers apply this rule after every tick.
"""

from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

import numpy as np

from zwerm.catalogue import BASE
from zwerm.scenario.tables import Scenario
from zwerm.wire.text import printable_line
from zwerm.world.scene import Bools

# The outcomes of a run. The driver's caller sets INTERRUPTED.
COMPLETED: Final = "completed"
TIME_LIMIT: Final = "time-limit"
FAILED: Final = "failed"
INTERRUPTED: Final = "interrupted"


class Ending(NamedTuple):
    """The outcome of a run, and the reason of a failure."""

    outcome: str
    reason: str = ""


class Completion:
    """Collects the nodes' reports on the task: done, or given up.

    The deciding nodes are the coordinator, unless the algorithm's bases decide, and then the base stations. If there are any,
    the first one alone completes the task. Otherwise all living robots have to be done, and robots that left count as done.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._robots = scenario.robots.count
        self._coordinator = self._robots if scenario.coordinator is not None else None
        self._last_tick = round(scenario.time.duration_s / scenario.time.dt_s)
        self._fails_on_crash = scenario.robots.on_crash == "fail"
        stations = range(scenario.base.stations if scenario.base is not None else 0)
        bases_decide = scenario.variant is not None and scenario.variant.decides == BASE
        centre = [] if self._coordinator is None or bases_decide else [self._coordinator]
        self._deciding = [*centre, *stations]
        self._done: Bools = np.zeros(self._robots + (self._coordinator is not None), dtype=np.bool_)
        self.any_done = False
        self.any_gave_up = False
        self._gave_up = ""
        self._robots_gave_up: dict[int, str] = {}

    def report(self, node: int, done: bool) -> None:
        """Take the `done` field of a node's newest command. A false `done` needs no call while no node has reported
        `any_done`."""
        self._done[node] = done
        self.any_done = True

    def give_up(self, node: int, reason: str, dead: Collection[int]) -> None:
        """Record that a node gave up; where any node decides, it has an effect only if this one does.

        A base station decides beside a deciding coordinator only while the coordinator is in `dead`. Where no node decides, a
        robot withdraws it with an empty `reason`.
        """
        centre = self._coordinator
        if not self._deciding:
            self._robots_gave_up.pop(node, None)
            if reason:
                self._robots_gave_up[node] = printable_line(reason)
                self.any_gave_up = True
            return
        if node in self._deciding and (centre not in self._deciding or node == centre or centre in dead):
            self._gave_up = f"node {node} gave up: {printable_line(reason)}"

    def restart(self, node: int) -> None:
        """Drop a node's report: its program lost its memory."""
        self._done[node] = False
        self._robots_gave_up.pop(node, None)

    @property
    def done_fraction(self) -> float:
        """The fraction of robots whose newest command says that their part is done."""
        return float(self._done[: self._robots].mean())

    def crash_ending(self, tick: int, crashed: Mapping[int, str]) -> Ending | None:
        """Return the ending that the `crashed` node of the smallest id causes at `tick`, or None."""
        if not crashed or not self._fails_on_crash:
            return None
        node = min(crashed)
        return Ending(FAILED, f"node {node} crashed at tick {tick}: {crashed[node]}")

    def completed(self, exited: Collection[int], dead: Collection[int]) -> bool:
        """Return whether the task is done; `exited` are the robots that left, `dead` the nodes that never return."""
        if self._deciding:
            return bool(self._done[self._deciding[0]])
        if not (self.any_done or exited):
            return False
        over = self._done.copy()
        over[list(exited)] = True
        over[list(dead)] = True
        return bool(over.all()) and len(dead) < self._robots

    def ending(
        self, tick: int, crashed: Mapping[int, str], exited: Collection[int], dead: Collection[int]
    ) -> Ending | None:
        """Return how the run ends before `tick`, or None if it goes on."""
        failed = self.crash_ending(tick, crashed)
        if failed is not None:
            return failed
        if self._gave_up:
            return Ending(FAILED, self._gave_up)
        if self.completed(exited, dead):
            return Ending(COMPLETED)
        if self._robots_gave_up:
            left = [node for node in self._robots_gave_up if node not in dead and node not in exited]
            if left and self.completed({*exited, *left}, dead):
                return Ending(FAILED, f"node {min(left)} gave up: {self._robots_gave_up[min(left)]}")
        if len(dead) >= self._robots and all(robot in dead for robot in range(self._robots)):
            return Ending(FAILED, "every robot was lost")
        return Ending(TIME_LIMIT) if tick >= self._last_tick else None
