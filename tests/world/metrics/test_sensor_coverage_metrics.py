"""The metrics of sensor coverage: which reports count, of which nodes, and over which incarnations."""

from typing import Any

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, encode_snapshot
from zwerm.run.assembly import prepare
from zwerm.scenario.load import load
from zwerm.world.metrics import MetricContext, Truth
from zwerm.world.metrics.sensor_coverage import Conclusion, Deployment
from zwerm.world.tick.telemetry import TelemetryRecord

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


def test_a_conclusion_is_early_only_where_a_living_robot_claims_a_frontier() -> None:
    def concluded(claims: dict[int, bool], dead: tuple[int, ...], completed: bool) -> float:
        metric = Conclusion(None, context("services.path=gradient"))
        for node, claim in claims.items():
            metric.report(record(node, {"claims_frontier": not claim}))
            metric.report(record(node, {"claims_frontier": claim}))
        metric.sample(Truth(None, dead, completed))  # type: ignore[arg-type]
        return metric.metrics()["concluded_early"]

    assert concluded({3: True}, (), True) == 1.0
    assert concluded({3: True}, (), False) == 0.0
    assert concluded({3: True}, (3,), True) == 0.0
    assert concluded({3: False}, (), True) == 0.0
    assert Conclusion(None, context()).metrics() == {}
