"""The schedule of a run's faults: which of them are in force at a tick, and what follows from that.

Faults are read from the scenario's tables, and from those that were drawn at random. Each tick the schedule looks which
begin and end, and where something has changed it says anew who is down, paused or slow, what stands in the radio's way, and
what the sensors suffer.
"""

import json
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.faults import FaultTable, ticks
from zwerm.world.faults.nodes import CrashTable, JoinTable, PauseTable, RestartTable, SlowTable
from zwerm.world.faults.radio import (
    Blackout,
    BlackoutTable,
    Cut,
    CutTable,
    HealTable,
    Jam,
    JamTable,
    Partition,
    PartitionTable,
    RadioFaultTable,
    groups_of,
)
from zwerm.world.faults.sensing import (
    KINDS as SENSING_KINDS,
)
from zwerm.world.faults.sensing import (
    CameraBlackoutTable,
    DeadBeaconTable,
    SensingFault,
    SensorNoiseTable,
    StuckTouchTable,
)
from zwerm.world.faults.sensing import (
    nonsense as sensing_nonsense,
)
from zwerm.world.faults.when import Condition
from zwerm.world.radio import ROBOTS, UPLINK, LinkModel
from zwerm.world.radio.registry import node_id
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.tick.node_status import ProcessAction

KINDS: Final[dict[str, type[FaultTable]]] = {
    "partition": PartitionTable,
    "jam": JamTable,
    "blackout": BlackoutTable,
    "cut": CutTable,
    "heal": HealTable,
    "crash": CrashTable,
    "restart": RestartTable,
    "pause": PauseTable,
    "slow": SlowTable,
    "join": JoinTable,
    "sensor_noise": SensorNoiseTable,
    "stuck_touch": StuckTouchTable,
    "dead_beacon": DeadBeaconTable,
    "camera_blackout": CameraBlackoutTable,
}


class Fault:
    """One fault of the schedule: its table, the ids it names, and the ticks from and until which it is in force."""

    def __init__(self, kind: str, table: FaultTable, scenario: Scenario) -> None:
        dt_s = scenario.time.dt_s
        self.kind = kind
        self.table = table
        self.purpose = ""  # of the draws that are its own
        self.begins = None if table.at_s is None else ticks(table.at_s, dt_s)
        self.lasts = None if table.for_s is None else max(1, ticks(table.for_s, dt_s))
        self.ends = None if table.until_s is None else ticks(table.until_s, dt_s)
        self.condition = None if table.when is None else Condition(table.when, scenario)
        self.nodes: list[int] = [node_id(name, scenario) for name in getattr(table, "nodes", None) or ()]
        self.healed = False
        self.came = False
        if self.begins is not None:
            self._begin(self.begins)
        self._dt_s = dt_s
        self._stations = scenario.base.stations if scenario.base is not None else 0

    def draw(self, purpose: str, draws: Draws) -> None:
        """Take a purpose for its draws, and draw when it begins, if that is to be drawn."""
        self.purpose = purpose
        if self.table.between_s is not None:
            first_s, last_s = self.table.between_s
            time_s = first_s + float(draws.uniform(f"{purpose}/begins", 0)) * (last_s - first_s)
            self._begin(ticks(time_s, self._dt_s))

    def choose(self, scene: Scene, dead: Sequence[int]) -> bool:
        """Draw whom it strikes, if that is still to be drawn, once there is anybody; tell whether it did."""
        fraction = getattr(self.table, "fraction", None)
        if fraction is None or self.nodes:
            return False
        robots = np.setdiff1d(scene.present_ids(), [*range(self._stations), *dead])
        lot = scene.draws.uniform(f"{self.purpose}/struck", robots)
        struck = robots[np.argsort(lot, kind="stable")[: max(1, round(fraction * len(robots)))]]
        self.nodes = sorted(struck.tolist())
        return bool(self.nodes)

    def _begin(self, tick: int) -> None:
        self.begins = tick
        if self.lasts is not None:
            self.ends = tick + self.lasts

    def look(self, tick: int, scene: Scene) -> None:
        """Begin now if the condition is met."""
        if self.begins is None and self.condition is not None and self.condition.met(scene):
            self._begin(tick)

    def in_force(self, tick: int) -> bool:
        """Tell whether it is in force at `tick`; what takes no time is so at the tick at which it happens."""
        if self.begins is None or tick < self.begins or self.healed:
            return False
        if not self.table.lasts:
            return tick == self.begins
        return self.ends is None or tick < self.ends

    @property
    def as_written(self) -> str:
        """Its kind and the keys that the scenario gives, as JSON sorted by key. Defaults are left out."""
        written = self.table.model_dump(mode="json", exclude_unset=True)
        return json.dumps({"kind": self.kind, **written}, sort_keys=True)

    @property
    def in_words(self) -> str:
        """What kind it is, and when it is due, if that is known."""
        return (
            f"{self.kind} at {self.begins * self._dt_s:g} s"
            if self.begins is not None
            else f"{self.kind} on a condition"
        )

    @property
    def endless(self) -> bool:
        """Tell whether it has no end of its own."""
        return self.ends is None and self.lasts is None


class Schedule:
    """The faults of one run, each as `(path, table)`: where it stands and what it says."""

    def __init__(self, tables: Sequence[tuple[str, OpenTable]], scenario: Scenario, draws: Draws) -> None:
        """Raises ScenarioError with every mistake, each `path: rule, got value`."""
        count = scenario.robots.count
        self._nodes = count + (scenario.coordinator is not None)
        wrong: list[str] = []
        self.faults: list[Fault] = []
        for path, table in tables:
            fault = _read(path, table, scenario, wrong)
            if fault is not None:
                self.faults.append(fault)
        if wrong:
            raise ScenarioError(wrong)
        self._models: list[tuple[Fault, LinkModel]] = [
            (fault, _model(fault.table, scenario, self._nodes))
            for fault in self.faults
            if isinstance(fault.table, RadioFaultTable)
        ]
        made: Counter[str] = Counter()
        self._sensing: list[tuple[Fault, SensingFault]] = []
        for fault in self.faults:
            # Its draws are keyed by what the scenario gives: no other fault changes them, and neither does a new optional
            # key of its kind.
            written = fault.as_written
            made[written] += 1
            fault.draw(f"faults/{made[written]}/{written}", draws)
            sensing = SENSING_KINDS.get(type(fault.table))
            if sensing is not None:
                self._sensing.append((fault, sensing(fault.table, scenario, fault.purpose)))
        self._waiting = [fault for fault in self.faults if fault.condition is not None]
        self._now: list[Fault] = []

    @property
    def unborn(self) -> list[int]:
        """The nodes that are not started with the others, ascending."""
        return sorted({node for fault in self.faults if isinstance(fault.table, JoinTable) for node in fault.nodes})

    @property
    def missed(self) -> list[Fault]:
        """The faults that have not come, in the order of the schedule: at the end of a run, those that never did."""
        return [fault for fault in self.faults if not fault.came]

    @property
    def touches_programs(self) -> bool:
        """Tell whether a fault may be an order to somebody's program."""
        return any(isinstance(fault.table, CrashTable | RestartTable | PauseTable | JoinTable) for fault in self.faults)

    def turn(self, tick: int, scene: Scene, dead: Sequence[int] = ()) -> bool:
        """Let faults begin and end at `tick`; tell whether anything has changed. `dead` are nodes that never return."""
        for fault in self._waiting:
            fault.look(tick, scene)
        now = [fault for fault in self.faults if fault.in_force(tick)]
        for fault in now:
            fault.came = True
        if any(isinstance(fault.table, HealTable) for fault in now):
            for fault in now:
                if not isinstance(fault.table, CrashTable | RestartTable | JoinTable | HealTable):
                    fault.healed = True
            now = [fault for fault in now if not fault.healed]
        # What happens at once is a change each time.
        changed = now != self._now or any(not fault.table.lasts for fault in now)
        for fault in now:
            if fault.choose(scene, dead):
                dead, changed = [*dead, *fault.nodes], True
        self._now = now
        return changed

    def states(self, tick: int) -> tuple[Bools, Bools, Ints]:
        """Return (nodes,) who is down, who is paused, and how many ticks each takes over an answer."""
        down, paused = np.zeros(self._nodes, dtype=np.bool_), np.zeros(self._nodes, dtype=np.bool_)
        every = np.ones(self._nodes, dtype=np.int64)
        for fault in self._now:
            if isinstance(fault.table, CrashTable):
                down[fault.nodes] = True
            elif isinstance(fault.table, PauseTable):
                paused[fault.nodes] = True
            elif isinstance(fault.table, SlowTable):
                every[fault.nodes] = np.maximum(every[fault.nodes], fault.table.every_ticks)
        for fault in self.faults:
            if isinstance(fault.table, JoinTable) and (fault.begins is None or tick < fault.begins):
                down[fault.nodes] = True
        return down, paused, every

    def restarts(self) -> list[int]:
        """Return the nodes that lose their memory at this tick, ascending."""
        return sorted({node for fault in self._now if isinstance(fault.table, RestartTable) for node in fault.nodes})

    def gone(self) -> list[int]:
        """Return the nodes that are down and never return, ascending."""
        return sorted(
            {
                node
                for fault in self._now
                if isinstance(fault.table, CrashTable) and fault.endless
                for node in fault.nodes
            }
        )

    def on_sensors(self) -> list[SensingFault]:
        """Return what is wrong with the sensors now, in the order of the schedule."""
        return [sensing for fault, sensing in self._sensing if fault in self._now]

    def on_air(self) -> dict[str, list[LinkModel]]:
        """Return what stands in the way of each channel now, in the order of the schedule."""
        found: dict[str, list[LinkModel]] = {ROBOTS: [], UPLINK: []}
        for fault, model in self._models:
            if fault in self._now and isinstance(fault.table, RadioFaultTable):
                for channel in (fault.table.channel,) if fault.table.channel else found:
                    found[channel].append(model)
        return found


def _read(path: str, table: OpenTable, scenario: Scenario, wrong: list[str]) -> Fault | None:
    """Return the fault that `table` describes, or None with its mistakes added to `wrong`."""
    kind = KINDS.get(table.kind)
    if kind is None:
        wrong.append(f"{path}.kind: expected one of {', '.join(KINDS)}, got {table.kind!r}")
        return None
    try:
        found = kind.model_validate(table.parameters)
    except ValidationError as error:
        named = f"{scenario.place}: "
        wrong += [line.removeprefix(named) for line in mistakes(error, scenario.place, f"{path}.")]
        return None
    before = len(wrong)
    wrong += [f"{path}{line}" for line in _nonsense(found, scenario)]
    return None if len(wrong) > before else Fault(table.kind, found, scenario)


def _nonsense(table: FaultTable, scenario: Scenario) -> list[str]:
    """Return what is wrong with a fault in this scenario, a line each, led by the rest of its path."""
    found = _wrong_times(table, scenario)
    for key in ("nodes", "senders", "receivers", "robots"):
        found += _strangers(getattr(table, key, None) or (), f".{key}", scenario)
    found += sensing_nonsense(table, scenario)
    if isinstance(table, CrashTable) and (table.nodes is None) == (table.fraction is None):
        found.append(": expected either nodes or fraction")
    if isinstance(table, PartitionTable):
        for number, group in enumerate(table.groups):
            found += _strangers(group, f".groups.{number}", scenario)
        named = [name for group in table.groups for name in group]
        found += [f".groups: {name} is named twice" for name in sorted({str(n) for n in named if named.count(n) > 1})]
    if isinstance(table, JamTable) and (table.rectangle_m is None) == (
        table.center_m is None or table.radius_m is None
    ):
        found.append(": expected either center_m and radius_m, or rectangle_m")
    if isinstance(table, RadioFaultTable):
        if table.channel == UPLINK and scenario.coordinator is None:
            found.append(".channel: the scenario has no coordinator to lead to, got 'uplink'")
        elif scenario.radio is None and (table.channel == ROBOTS or scenario.coordinator is None):
            found.append(": the scenario has no radio to disturb")
    return found


def _wrong_times(table: FaultTable, scenario: Scenario) -> list[str]:
    found: list[str] = []
    duration_s = scenario.time.duration_s
    if [table.at_s, table.when, table.between_s].count(None) != 2:
        found.append(": expected one of at_s, between_s and when")
    if table.for_s is not None and table.until_s is not None:
        found.append(": expected for_s or until_s, not both")
    if not table.lasts and (table.for_s is not None or table.until_s is not None):
        found.append(": happens at once: no for_s and no until_s")
    if table.at_s is not None and table.at_s >= duration_s:
        found.append(f".at_s: the run ends after {duration_s:g} s, got {table.at_s:g}")
    if table.between_s is not None and not table.between_s[0] < table.between_s[1] < duration_s:
        found.append(
            f".between_s: expected [first, last] before the end at {duration_s:g} s, got {list(table.between_s)}"
        )
    if table.until_s is not None and table.until_s > duration_s:
        found.append(f".until_s: the run ends after {duration_s:g} s, got {table.until_s:g}")
    if table.until_s is not None and table.until_s <= (table.at_s or (table.between_s or (0.0, 0.0))[1]):
        found.append(f".until_s: expected later than it begins, got {table.until_s:g}")
    if table.when is not None:
        found += [f".when{line}" for line in _wrong_condition(table.when, scenario)]
    return found


def _wrong_condition(when: Any, scenario: Scenario) -> list[str]:
    if (when.metric is None) == (when.robot_deployed is None):
        return [": expected either metric and at_least, or robot_deployed"]
    if when.robot_deployed is not None:
        return _strangers([when.robot_deployed], ".robot_deployed", scenario, listed=False)
    if when.at_least is None:
        return [".at_least: required, and missing"]
    needed = "cells" if when.metric == "cell_coverage_fraction" else "coverage_radius_m"
    if getattr(scenario.metrics, needed) is None:
        return [f".metric: needs metrics.{needed}, got {when.metric!r}"]
    return []


def _strangers(names: Sequence[Any], path: str, scenario: Scenario, listed: bool = True) -> list[str]:
    found: list[str] = []
    for index, name in enumerate(names):
        try:
            node_id(name, scenario)
        except ValueError as error:
            found.append(f"{path}.{index}: {error}" if listed else f"{path}: {error}")
    return found


def _model(table: RadioFaultTable, scenario: Scenario, nodes: int) -> LinkModel:
    """Return the link model that a fault of the radio is."""
    made: Any
    if isinstance(table, PartitionTable):
        made = Partition(groups_of([[node_id(name, scenario) for name in group] for group in table.groups], nodes))
    elif isinstance(table, JamTable):
        made = Jam(table)
    elif isinstance(table, CutTable):
        ends = [np.zeros(nodes, dtype=np.bool_) for _ in range(2)]
        for end, names in zip(ends, (table.senders, table.receivers), strict=True):
            end[[node_id(name, scenario) for name in names]] = True
        made = Cut(ends[0], ends[1], table.both)
    else:
        made = Blackout()
    model: LinkModel = made
    return model


def unite(orders: Sequence[ProcessAction], restarts: Sequence[int]) -> list[ProcessAction]:
    """Return `orders`, and for each of `restarts` that they do not touch, that it is killed and started."""
    touched = {order.node for order in orders}
    return [
        *orders,
        *(ProcessAction(deed, node) for node in restarts if node not in touched for deed in ("kill", "start")),
    ]
