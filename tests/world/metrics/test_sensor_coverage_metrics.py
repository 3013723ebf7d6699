"""The metrics of sensor coverage: which reports count, of which nodes, and over which incarnations."""

from typing import Any

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, MembershipSnapshot, encode_snapshot
from zwerm.maths.keyed_random import Draws
from zwerm.run.assembly import prepare
from zwerm.scenario.load import load
from zwerm.wire.messages import Command
from zwerm.world.metrics import MetricContext, Truth
from zwerm.world.metrics.sensor_coverage import Conclusion, Deployment, removals
from zwerm.world.scene import Scene
from zwerm.world.tick.telemetry import TelemetryRecord, TelemetrySink

# Robots 0 to 29, of which 0 is the base station; the coordinator is node 30.
SMALL = ("arena.size_m=[2.4,1.8]", "base.pose=[0.2,0.9,0.0]", "robots.count=30")
COORDINATOR = 30


def context(*settings: str) -> MetricContext:
    scenario = load("sensor-coverage", (*SMALL, *settings))
    return MetricContext(prepare(scenario).arena, None, scenario.time.dt_s, scenario)


def record(node: int, numbers: dict[str, float] | None = None, snapshot: bytes = b"") -> TelemetryRecord:
    return TelemetryRecord(0, 0.0, node, numbers or {}, snapshot, np.zeros((0, 2)), np.zeros(0, dtype=np.bool_))


def a_complex(cycle: int) -> dict[str, Any]:
    return {"snapshot": encode_snapshot(ComplexSnapshot(cycle, (), (), (), ()))}


def cycles(*reports: dict[str, Any], node: int = COORDINATOR) -> float | None:
    metric = Deployment(None, context())
    for each in reports:
        metric.report(record(node, **each))
    return metric.metrics().get("deployment_cycles")


def test_cycles_are_counted_over_all_incarnations_of_the_node_that_reports_them() -> None:
    numbers = [{"numbers": {"deployment_cycles": float(each)}} for each in (1, 2, 2, 5, 1, 4)]
    three = [a_complex(each) for each in (1, 2, 3)]
    assert cycles(*three, {"numbers": {"deployment_cycles": 3.0}}) == 3.0
    assert cycles(*three, *(a_complex(each) for each in (1, 2)), {"numbers": {"deployment_cycles": 2.0}}) == 3.0 + 2.0
    assert cycles(*(a_complex(each) for each in (1, 1, 1, 2))) == 1.0 + 1.0 + 2.0
    assert cycles(*numbers) == 5.0 + 4.0
    assert cycles() is None


@pytest.mark.parametrize(("node", "counts"), [(0, True), (COORDINATOR, True), (1, False), (29, False)])
def test_cycles_and_numbers_count_from_the_base_and_the_coordinator_and_from_no_robot(node: int, counts: bool) -> None:
    metric = Deployment(None, context())
    metric.report(record(node, {"pushes": 7.0, "redundant_robots": 2.0}, a_complex(3)["snapshot"]))
    found = {"pushes": 7.0, "redundant_robots": 2.0, "deployment_cycles": 3.0}
    assert metric.metrics() == (found if counts else {})


def test_a_snapshot_that_cannot_be_decoded_is_ignored_and_counted() -> None:
    metric = Deployment(None, context())
    whole = a_complex(3)["snapshot"]
    for snapshot in (b"\xc1", whole[:-1], whole + b"\x00", b"\x91" * 9_000):
        metric.report(record(COORDINATOR, snapshot=snapshot))
    assert metric.metrics() == {"undecodable_snapshots": 4.0}


def truth_at(places: list[tuple[float, float]], dead: tuple[int, ...], completed: bool, telemetry: Any = None) -> Truth:
    """The truth with robots at some places of the small hall."""
    arena = prepare(load("sensor-coverage", SMALL)).arena
    position, count = np.array(places, dtype=np.float64), len(places)
    there, still = np.ones(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    scene = Scene(7, 0.7, position, np.zeros(count), there, still, 0.07, arena, Draws(1))
    return Truth(scene, dead, completed, TelemetrySink() if telemetry is None else telemetry)


# A lattice that covers the hall, the base first.
FULL = [(0.2 + 0.5 * x, 0.4 + 0.5 * y) for x in range(5) for y in range(3)]


@pytest.mark.parametrize(
    ("claims", "dead", "completed", "places", "early"),
    [
        ({3: True}, (), True, FULL, 1.0),
        ({3: True}, (), False, FULL, 0.0),
        ({3: True}, (3,), True, FULL, 0.0),
        ({3: False}, (), True, FULL, 0.0),
        ({}, (), True, FULL[:2], 1.0),
        ({}, (), False, FULL[:2], 0.0),
        ({}, tuple(range(2, 15)), True, FULL, 1.0),
    ],
)
def test_a_conclusion_is_early_where_a_living_robot_claims_or_the_hall_is_not_covered(
    claims: dict[int, bool], dead: tuple[int, ...], completed: bool, places: list[tuple[float, float]], early: float
) -> None:
    metric = Conclusion(None, context("services.path=gradient"))
    for node, claim in claims.items():
        metric.report(record(node, {"claims_frontier": not claim}))
        metric.report(record(node, {"claims_frontier": claim}))
    truth = truth_at(places, dead, completed)
    metric.sample(truth)
    unseen = completed and (len(places) < len(FULL) or len(dead) > 1)
    assert metric.metrics() == {"concluded_early": early, "falsely_completed": unseen}
    assert Conclusion(None, context()).metrics() == {}
    central = Conclusion(None, context())
    central.sample(truth)
    assert central.metrics() == {"falsely_completed": unseen}


@pytest.mark.parametrize(("down_then", "dead_later", "unsafe"), [((), (), 1.0), ((), (0,), 1.0), ((0,), (0,), 0.0)])
def test_a_departure_is_judged_by_the_robots_that_ran_then(
    down_then: tuple[int, ...], dead_later: tuple[int, ...], unsafe: float
) -> None:
    """Robot 1 connects 0 and 2. If 0 is down when 1 leaves, 2 is connected as before; a later death changes nothing."""
    places = [(0.2, 0.9), (1.1, 0.9), (2.0, 0.9)]
    scene = truth_at(places, (), False).scene
    telemetry = TelemetrySink()
    down = np.isin(np.arange(3), down_then)
    telemetry.accept(scene, 1, Command(snapshot=encode_snapshot(MembershipSnapshot(False))), down)
    assert removals(truth_at(places, dead_later, False, telemetry), 1.0) == {"removals": 1.0, "unsafe_removals": unsafe}
