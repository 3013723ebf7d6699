"""Telemetry in whole runs: it changes neither the trace nor any metric, and what breaks its rules is a crash of its node."""

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader
from support import scenario

from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Command, encode

CELLS = {"cells": [4, 4]}


def reporting(controller: str, **robots: object) -> Scenario:
    return scenario(robots={"controller": f"reporters:{controller}", "sensors": [], **robots}, metrics=CELLS)


def test_adding_a_line_of_telemetry_keeps_the_trace_and_another_drive_does_not() -> None:
    silent, reports = (run(reporting(each), 1, "inline") for each in ("Silent", "Reports"))
    assert silent.trace == reports.trace
    assert run(scenario(robots={"controller": "troubled:Finishes"}), 1, "inline").trace != silent.trace


def test_telemetry_and_trace_are_equal_inline_and_in_processes(nothing_left: None) -> None:
    inline, processes = (run(reporting("Reports"), 1, runner) for runner in ("inline", "processes"))
    assert inline.trace == processes.trace
    assert inline.metrics == processes.metrics
    for name in ("tick", "node", "name", "value"):
        assert getattr(inline.telemetry, name).tolist() == getattr(processes.telemetry, name).tolist()


def test_telemetry_ends_in_the_result_by_node_and_tick_and_in_the_metrics_by_name() -> None:
    result = run(reporting("Reports"), 1, "inline")
    time_s, value = result.telemetry.of("tick", node=2)
    assert value.tolist() == list(range(20))
    assert time_s.tolist() == pytest.approx([0.1 * tick for tick in range(20)])
    assert result.metrics["telemetry.tick"] == 19.0
    assert result.metrics["telemetry.node"] == 1.5
    assert result.metrics["telemetry.half"] == 0.5
    assert result.metrics["telemetry.even"] == 0.0
    assert len(result.snapshots) == 4 * 20


def test_a_robot_that_reports_by_the_name_of_a_metric_changes_no_metric() -> None:
    honest, forged = (run(reporting(each), 1, "inline") for each in ("Silent", "Forges"))
    assert {
        name: value for name, value in forged.metrics.items() if not name.startswith("telemetry.")
    } == honest.metrics
    assert forged.metrics["telemetry.robots_in_arena"] == 1e6
    assert forged.metrics["robots_in_arena"] == 4.0


@pytest.mark.parametrize(
    ("controller", "reason"),
    [
        ("Misreports", "TypeError: telemetry.complex: expected a number, got {}"),
        ("MisreportsText", "TypeError: telemetry.x: expected a number, got 'many'"),
        ("MisreportsNan", "ValueError: telemetry.x: expected a finite number, got nan"),
        (
            "MisreportsName",
            "ValueError: telemetry: expected a name of [a-z][a-z0-9_]*, at most 64 characters, got 'X y'",
        ),
    ],
)
def test_invalid_telemetry_fails_the_run_with_node_tick_rule_and_value(controller: str, reason: str) -> None:
    result = run(reporting(controller), 1, "inline")
    assert result.outcome == "failed"
    assert result.reason.startswith(f"node 1 crashed at tick 3: {reason} (reporters.py:")


def test_invalid_telemetry_ends_only_its_node_if_on_crash_is_continue() -> None:
    result = run(reporting("Misreports", on_crash="continue"), 1, "inline")
    assert (result.outcome, result.crashed, result.ticks) == ("time-limit", [1], 20)


def test_forged_telemetry_on_the_wire_crashes_its_node_is_counted_and_does_not_stop_the_others() -> None:
    world = assemble(reporting("Silent", on_crash="continue"), 1)
    world.observe()
    forged = encode(Command()).replace(b"\x81\xa4type", b"\x82\xa9telemetry\x81\xa7complex\x80\xa4type")
    world.accept(1, forged)
    assert world.intake.refusals.by_reason == {"telemetry": 1}
    assert list(world.status.crashed) == [1]
    assert world.status.crashed[1].startswith("its command was refused: telemetry: ")
    assert world.awaited() == [0, 2, 3]


def test_a_recording_holds_telemetry_as_json_numbers_by_name(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorded = run(reporting("Reports"), 1, "inline", record=path)
    with path.open("rb") as file:
        messages = list(make_reader(file).iter_messages(topics=["/node/2/telemetry"]))
    assert [json.loads(message.data)["tick"] for _, _, message in messages] == list(range(20))
    assert [message.sequence for _, _, message in messages] == list(range(20))
    assert recorded.trace == run(reporting("Silent"), 1, "inline").trace


def test_a_flood_of_telemetry_is_bounded_and_counted() -> None:
    result = run(reporting("Floods", count=1), 1, "inline")
    assert len(result.telemetry) == 20 * 64
    assert "telemetry_dropped" not in result.metrics
