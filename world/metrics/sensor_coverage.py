"""The metrics of sensor coverage: the reports of its coordinator and base stations, and the robots' decisions judged by
the truth.

A report counts only from a node that may give it. The coordinator and the base stations report cycles, pushes and
numbers of robots. Each robot reports its own frontier claim and its own membership. Others are ignored.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Final

import shapely

from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, MembershipSnapshot, decode_snapshot
from zwerm.catalogue import BASE
from zwerm.maths.simplicial import betti
from zwerm.scenario.tables import Scenario
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.metrics.sight import SeenArea, complex_of, living, reachable
from zwerm.world.tick.telemetry import TelemetryRecord

# Numbers that the coordinator and the base stations report; the newest of each is the metric.
NUMBERS: Final = ("pushes", "robots_released", "redundant_robots")
CYCLES: Final = "deployment_cycles"
CLAIM: Final = "claims_frontier"
# Coverage of the reachable space from which on a deployment is complete.
ENOUGH: Final = 0.98


class Deployment(Metric):
    """Cycles, pushes and robots of a deployment, by the reports of the coordinator and the base stations."""

    names: ClassVar[Mapping[str, str]] = {
        CYCLES: (
            "cycles of a deployment, each of which asks what robots see and moves some; the last ones only find "
            "that all is done; over all lives of a coordinator that began anew"
        ),
        "pushes": (
            "pushes that placed a robot; of a coordinator that began anew, those of its last life, since none "
            "is reported before it ends"
        ),
        "robots_released": "robots that the base station let out",
        "redundant_robots": (
            "robots at the end that coverage would not miss, by relative H2; with `services.redundancy=link` "
            "those that have left the complex; only with a coordinator that finds the path"
        ),
        "ticks_per_cycle_mean": "ticks of the run by deployment cycles",
        "messages_per_cycle_mean": "transmissions of all nodes, the coordinator too, by deployment cycles",
        "undecodable_snapshots": "snapshots of nodes that could not be decoded; absent where there are none",
    }

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        centre = [] if context.coordinator is None else [context.coordinator]
        self._reporters = dict.fromkeys([*context.stations, *centre])
        self._newest: dict[str, float] = {}
        self._cycle: dict[int, float] = {}  # the newest cycle, by node
        self._before: dict[int, float] = {}  # cycles of earlier incarnations, by node
        self._undecodable = 0
        self._truth: Truth | None = None

    def report(self, record: TelemetryRecord) -> None:
        """Take the numbers and the cycle that a node reports."""
        snapshot = decode_snapshot(record.snapshot) if record.snapshot else None
        self._undecodable += bool(record.snapshot) and snapshot is None
        if record.node not in self._reporters:
            return
        for name in NUMBERS:
            if name in record.numbers:
                self._newest[name] = record.numbers[name]
        if isinstance(snapshot, ComplexSnapshot):
            self._count(record.node, float(snapshot.cycle), snapshot.cycle <= self._cycle.get(record.node, 0.0))
        elif CYCLES in record.numbers:
            cycle = record.numbers[CYCLES]
            self._count(record.node, cycle, cycle < self._cycle.get(record.node, 0.0))

    def sample(self, truth: Truth) -> None:
        """Take the tick and the number of messages at the end."""
        self._truth = truth

    def metrics(self) -> dict[str, float]:
        """Return the newest reports, and ticks and messages by cycle."""
        found = dict(self._newest)
        cycles = found.get(CYCLES)
        if cycles and self._truth is not None:
            found["ticks_per_cycle_mean"] = self._truth.scene.tick / cycles
            found["messages_per_cycle_mean"] = self._truth.messages / cycles
        if self._undecodable:
            found["undecodable_snapshots"] = float(self._undecodable)
        return found

    def _count(self, node: int, cycle: float, restarted: bool) -> None:
        """Count the cycles of a node over all its incarnations.

        A restarted node starts its count again. A complex of a cycle that is not later, or fewer cycles than before,
        begin a new count.
        """
        if restarted:
            self._before[node] = self._before.get(node, 0.0) + self._cycle.get(node, 0.0)
        self._cycle[node] = cycle
        self._newest[CYCLES] = self._before.get(node, 0.0) + cycle


class Conclusion(Metric):
    """`falsely_completed`: 1 where a completed run has unseen space, by the truth at that time, else 0; and
    `concluded_early`.

    Unseen space is a coverage of the space that robots can reach below `ENOUGH`, measured where `metrics.sight_range_m` is
    given. `concluded_early` is 1 where the base station has concluded too early.

    Too early is a coverage of the space that robots can reach below `ENOUGH`, measured where `metrics.sight_range_m` is given;
    or a claim of a running robot that it stands at a frontier. A robot that has restarted reports its claim again.
    """

    names: ClassVar[Mapping[str, str]] = {
        "concluded_early": (
            "with `services.path=gradient`: 1 if the base station concluded while less than 0.98 of the "
            "reachable space was in sight, or a living robot knew where to expand, else 0; its mean over runs "
            "is the rate of wrong conclusions"
        ),
        "falsely_completed": (
            "1 if a completed run has less than 0.98 of the reachable space in sight, else 0, where "
            "`metrics.sight_range_m` is given; its mean over runs is the rate of false completions"
        ),
    }

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        variant, range_m = context.scenario.variant, context.scenario.metrics.sight_range_m
        self._applies = variant is not None and variant.decides == BASE
        self._arena = context.arena
        self._sight = None if range_m is None else SeenArea(context.arena, range_m)
        self._claims: dict[int, bool] = {}
        self._truth: Truth | None = None

    def report(self, record: TelemetryRecord) -> None:
        """Take a robot's claim that it stands at a frontier, or that it no longer does."""
        if CLAIM in record.numbers:
            self._claims[record.node] = bool(record.numbers[CLAIM])

    def sample(self, truth: Truth) -> None:
        """Take the state at the end: the run ends when the base station concludes."""
        self._truth = truth

    def metrics(self) -> dict[str, float]:
        """Return whether the conclusion was wrong: by the base station where it concludes, and by coverage if measured."""
        truth = self._truth
        if truth is None:
            return {}
        found = {}
        unseen = truth.completed and not self._is_covered(truth)
        if self._applies:
            claimed = any(claims and node not in truth.dead for node, claims in self._claims.items())
            found["concluded_early"] = float(truth.completed and (claimed or unseen))
        if self._sight is not None:
            found["falsely_completed"] = float(unseen)
        return found

    def _is_covered(self, truth: Truth) -> bool:
        """Return whether the living robots see the space that they can reach, as far as that is measured."""
        if self._sight is None:
            return True
        scene = truth.scene
        position = scene.position[living(scene.present_ids(), truth.dead)]
        if not len(position):
            return False
        inside = reachable(self._arena, scene.radius_m, position)
        return bool(shapely.intersection(self._sight.area(position), inside).area >= ENOUGH * inside.area)


class Removals(Metric):
    """Number of robots that have left the complex, and number of these departures that changed its true b0 or b1.

    Each departure is judged by the truth at its own time. The complex is that of all running robots in the arena that
    have not left the complex, by true visibility within `metrics.sight_range_m`. It is measured only if that range is
    given and robots leave by agreement.
    """

    names: ClassVar[Mapping[str, str]] = {
        "removals": (
            "robots that left the complex; with `services.redundancy=link`, or with a coordinator and "
            "`services.path=gradient`"
        ),
        "unsafe_removals": (
            "how many of these departures changed b0 or b1 of the complex of all that see each other, in truth"
        ),
    }

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        self._range_m: float | None = context.scenario.metrics.sight_range_m
        self._applies = self._range_m is not None and robots_leave(context.scenario)
        self._truth: Truth | None = None

    def sample(self, truth: Truth) -> None:
        """Take the snapshots at the end."""
        self._truth = truth

    def metrics(self) -> dict[str, float]:
        """Return both counts."""
        if not self._applies or self._truth is None or self._range_m is None:
            return {}
        return removals(self._truth, self._range_m)


def robots_leave(scenario: Scenario) -> bool:
    """Return whether the robots of a scenario leave the complex by agreement among neighbours."""
    services = {} if scenario.variant is None else dict(scenario.variant.services)
    return services.get("redundancy") == "link" or services == {"path": "gradient", "redundancy": "coordinator"}


def removals(truth: Truth, range_m: float) -> dict[str, float]:
    """Return how many robots have left the complex, and how many departures changed b0 or b1; sight within `range_m`."""
    out: dict[int, None] = {}
    count = unsafe = 0
    sight = Visibility()
    for record in truth.telemetry.snapshots:
        change = decode_snapshot(record.snapshot)
        if not isinstance(change, MembershipSnapshot):
            continue
        if change.member:
            out.pop(record.node, None)
            continue
        scene = replace(truth.scene, tick=record.tick, position=record.position, present=record.present)
        members = [node for node in scene.present_ids().tolist() if node not in out and node not in record.down]
        whole = complex_of(sight.pairs(scene, range_m), members)
        count += 1
        unsafe += betti(whole) != betti(whole.without([record.node]))
        out[record.node] = None
    return {"removals": float(count), "unsafe_removals": float(unsafe)}
