"""The schedule of a run: the faults that are active at a tick, and their effects.

Input: the `[[faults]]` tables of the scenario, and those of its random schedule. At each tick the schedule begins and ends
faults. After a change it gives the new states of programs, judges of packets, and faults of sensors.
"""

import json
from collections import Counter
from collections.abc import Sequence

import numpy as np

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.faults import Fault, FaultContext, FaultTable, ProgramStates, ticks
from zwerm.world.faults.registry import checked
from zwerm.world.faults.when import Condition
from zwerm.world.radio import ROBOTS, UPLINK, PacketJudge
from zwerm.world.radio.nodes import node_count
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.tick.node_status import ProcessAction


class ScheduledFault:
    """A fault with its times. `fault` has the effects; it is active from tick `begins` to before tick `ends`."""

    def __init__(self, kind: str, table: FaultTable, fault: Fault, context: FaultContext, draws: Draws) -> None:
        scenario = context.scenario
        self.kind = kind
        self.fault = fault
        self.purpose = context.purpose
        self.healed = False
        self.came = False
        self._dt_s = scenario.time.dt_s
        self._duration = None if table.for_s is None else max(1, ticks(table.for_s, self._dt_s))
        self.begins: int | None = None
        self.ends = None if table.until_s is None else ticks(table.until_s, self._dt_s)
        self.endless = self.ends is None and self._duration is None
        self.condition = None if table.when is None else Condition(table.when, scenario)
        if table.at_s is not None:
            self._begin(ticks(table.at_s, self._dt_s))
        elif table.between_s is not None:
            first_s, last_s = table.between_s
            time_s = first_s + float(draws.uniform(f"{context.purpose}/begins", 0)) * (last_s - first_s)
            self._begin(ticks(time_s, self._dt_s))

    def _begin(self, tick: int) -> None:
        self.begins = tick
        if self._duration is not None:
            self.ends = tick + self._duration

    def begin_if_met(self, tick: int, scene: Scene) -> None:
        """Begin now if the condition is met."""
        if self.begins is None and self.condition is not None and self.condition.met(scene):
            self._begin(tick)

    def active(self, tick: int) -> bool:
        """Return whether it is active at `tick`. A fault that does not last is active at its first tick only."""
        if self.begins is None or tick < self.begins or self.healed:
            return False
        if not self.fault.lasts:
            return tick == self.begins
        return self.ends is None or tick < self.ends

    def pending(self, tick: int) -> bool:
        """Return whether it begins after `tick`."""
        return self.begins is None or tick < self.begins

    @property
    def in_words(self) -> str:
        """Its kind, and the time of its beginning, if that is known."""
        if self.begins is None:
            return f"{self.kind} on a condition"
        return f"{self.kind} at {self.begins * self._dt_s:g} s"


class Schedule:
    """The faults of one run. `tables` are their tables as (path, table); `faults` has them in the same order."""

    def __init__(self, tables: Sequence[tuple[str, OpenTable]], scenario: Scenario, draws: Draws) -> None:
        """Raises ScenarioError with every mistake, each `path: rule, got value`."""
        self.tables = [table for _, table in tables]
        self.faults: list[ScheduledFault] = []
        self._nodes = node_count(scenario)
        wrong: list[str] = []
        counts: Counter[str] = Counter()
        for path, table in tables:
            try:
                kind, parameters = checked(path, table, scenario)
            except ScenarioError as error:
                wrong += error.mistakes
                continue
            # The keys that the scenario gives, without defaults, key the random numbers: neither another fault nor a new
            # optional key of its kind changes them.
            given = as_written(table.kind, parameters)
            counts[given] += 1
            context = FaultContext(scenario, f"faults/{counts[given]}/{given}")
            self.faults.append(ScheduledFault(table.kind, parameters, kind(parameters, context), context, draws))
        if wrong:
            raise ScenarioError(wrong)
        self._waiting = [each for each in self.faults if each.condition is not None]
        self._now: list[ScheduledFault] = []
        self._gone: list[int] = []

    @property
    def late_joiners(self) -> list[int]:
        """The nodes that are not started with the others, ascending."""
        states = ProgramStates(self._nodes)
        for each in self.faults:
            each.fault.before(states)
        return _ids(states.down)

    @property
    def missed(self) -> list[ScheduledFault]:
        """The faults that have not begun, in the order of the schedule; at the end of a run, those that never did."""
        return [each for each in self.faults if not each.came]

    @property
    def touches_programs(self) -> bool:
        """True if a fault may kill, start, pause or resume a program."""
        return any(each.fault.touches_programs for each in self.faults)

    def turn(self, tick: int, scene: Scene, dead: Sequence[int] = ()) -> bool:
        """Begin and end faults at `tick`; return whether the effects changed. `dead` are nodes that never return."""
        for each in self._waiting:
            each.begin_if_met(tick, scene)
        now = [each for each in self.faults if each.active(tick)]
        for each in now:
            each.came = True
        if any(each.fault.heals for each in now):
            for each in now:
                each.healed = each.fault.healable
            now = [each for each in now if not each.healed]
        # A fault that does not last is a change each time.
        changed = now != self._now or any(not each.fault.lasts for each in now)
        for each in now:
            struck = each.fault.strike(scene, dead)
            if struck:
                dead, changed = [*dead, *struck], True
        self._now = now
        if changed:
            self._gone = _ids(self._states([each for each in now if each.endless]).down)
        return changed

    def states(self, tick: int) -> tuple[Bools, Bools, Ints]:
        """Return (nodes,) whether each node is down, whether it is paused, and the ticks that it takes for an answer."""
        states = self._states(self._now)
        for each in self.faults:
            if each.pending(tick):
                each.fault.before(states)
        return states.down, states.paused, states.every_ticks

    def restarts(self) -> list[int]:
        """Return the nodes that are killed and started again at this tick, ascending."""
        return _ids(self._states(self._now).restarted)

    def gone(self) -> list[int]:
        """Return the nodes that are down and never return, ascending."""
        return self._gone

    def on_sensors(self) -> list[Fault]:
        """Return the active faults of sensors, in the order of the schedule."""
        return [each.fault for each in self._now if each.fault.alters_sensors]

    def on_air(self) -> dict[str, list[PacketJudge]]:
        """Return the active judges of packets of each channel, in the order of the schedule."""
        return {
            channel: [judge for each in self._now for judge in each.fault.on_radio(channel)]
            for channel in (ROBOTS, UPLINK)
        }

    def _states(self, faults: Sequence[ScheduledFault]) -> ProgramStates:
        states = ProgramStates(self._nodes)
        for each in faults:
            each.fault.on_programs(states)
        return states


def as_written(kind: str, parameters: FaultTable) -> str:
    """Return the kind and the keys that the scenario gives, as JSON sorted by key. Defaults are left out."""
    given = parameters.model_dump(mode="json", exclude_unset=True)
    return json.dumps({"kind": kind, **given}, sort_keys=True)


def unite(actions: Sequence[ProcessAction], restarts: Sequence[int]) -> list[ProcessAction]:
    """Return `actions`, and a kill and a start for each of `restarts` that has none of them."""
    touched = {action.node for action in actions}
    return [
        *actions,
        *(
            action
            for node in restarts
            if node not in touched
            for action in (ProcessAction("kill", node), ProcessAction("start", node))
        ),
    ]


def _ids(flags: Bools) -> list[int]:
    """Return the nodes whose flag is true, ascending."""
    ids: list[int] = np.flatnonzero(flags).tolist()
    return ids
