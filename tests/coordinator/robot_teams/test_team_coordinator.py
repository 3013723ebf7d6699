"""Cells planned by the coordinator: the hall is covered with no radio between robots, under loss, and when a robot dies."""

from pathlib import Path
from typing import Any, ClassVar

import pytest

from zwerm.agents.robot_teams.mapping.facts import BOTTOM, LEFT, RIGHT, TOP, End, SweptSegment, TracedArc, Void, Wreck
from zwerm.agents.robot_teams.protocols.central_membership import CoordinatedMembership, CoordinatorMembership
from zwerm.agents.robot_teams.protocols.team_messages import READY, Status, TeamBeacon, View, write_beacon
from zwerm.coordinator.robot_teams.team_coordinator import TeamCoordinator
from zwerm.run.runner import run
from zwerm.scenario.load import tables_of, validate
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Observation, Packet


def hall(count: int, **tables: Any) -> Scenario:
    """Return a scenario of `count` robots in a small hall whose cells the coordinator plans."""
    base, _ = tables_of("robot-teams", ())
    base["name"] = "small"
    base["arena"] = {"size_m": [9.0, 6.0], "obstacles": [[[4.0, 2.2], [5.9, 2.6], [5.3, 4.0]]]}
    base["robots"]["count"] = count
    base["robots"]["placement"] = {"kind": "poses", "poses": [[0.6 + 0.95 * i, 5.0, 0.0] for i in range(count)]}
    base["time"]["duration_s"] = 600.0
    base["services"] = {"cells": "coordinator"}
    del base["radio"]
    return validate(base | tables, "small.toml", Path())


@pytest.mark.parametrize("uplink", [{}, {"loss": 0.3}], ids=["no-loss", "loss"])
def test_robots_with_only_the_coordinator_in_reach_cover_the_hall(uplink: dict[str, Any]) -> None:
    result = run(hall(3, uplink=uplink), 1, "inline")
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.999
    assert result.metrics["certificate_satisfied"] == 1.0


def test_the_rest_covers_what_a_dead_robot_left() -> None:
    result = run(hall(2, faults=[{"kind": "crash", "nodes": [1], "at_s": 25.0}]), 1, "inline")
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.999


def test_without_the_uplink_nothing_is_called_complete() -> None:
    result = run(hall(2, uplink={"loss": 1.0}, time={"dt_s": 0.05, "duration_s": 30.0}), 1, "inline")
    assert result.outcome == "time-limit"
    assert result.metrics["certificate_satisfied"] == 0.0


def test_the_trace_is_the_same_inline_and_in_processes_and_another_with_another_seed(nothing_left: None) -> None:
    scenario = hall(2, uplink={"loss": 0.3}, time={"dt_s": 0.05, "duration_s": 10.0})
    inline = run(scenario, 1, "inline")
    assert run(scenario, 1, "processes").trace == inline.trace
    assert run(scenario, 2, "inline").trace != inline.trace


# --- membership -------------------------------------------------------------------------------------------------------

COORDINATOR = 3


def beacon(sender: int, tick: int, *views: View) -> TeamBeacon:
    status = Status(sender, tick, 0, 0, 1, 0, READY, None, False, False, None, None, None, (1, 0))
    return TeamBeacon(sender, views, (), (), (status,), 0, 0)


def test_the_coordinator_merges_received_messages_and_drops_silent_robots() -> None:
    membership = CoordinatorMembership(COORDINATOR, 1.0, 3.0)
    for tick in range(10):
        for node in (0, 1) if tick < 3 else (0,):
            membership.receive(beacon(node, tick, View(4, node, (node,))), tick, near=False)
        membership.poll(tick)
    assert membership.view.members == (0,)
    assert membership.view.epoch == 6
    membership.receive(beacon(1, 10, View(5, COORDINATOR, (0, 1))), 10, near=False)
    membership.poll(10)
    assert membership.view == View(7, COORDINATOR, (0, 1))


def test_a_robot_takes_later_views_that_include_it_and_no_others() -> None:
    membership = CoordinatedMembership(0, 1.0, 3.0)
    membership.receive(beacon(COORDINATOR, 1, View(2, COORDINATOR, (1,))), 1, near=False)
    assert membership.view.members == (0,)
    membership.receive(beacon(COORDINATOR, 2, View(3, COORDINATOR, (0, 1))), 2, near=False)
    membership.receive(beacon(COORDINATOR, 3, View(2, COORDINATOR, (0, 2))), 3, near=False)
    for tick in range(4, 30):
        membership.poll(tick)
    assert membership.view == View(3, COORDINATOR, (0, 1))
    assert not membership.leads


class CoordinatorSetup:
    """The setup of a coordinator that decides from the first tick on."""

    node, dt_s = COORDINATOR, 1.0
    parameters: ClassVar[dict[str, object]] = {}


@pytest.mark.parametrize(
    ("wreck", "placed", "unswept", "done", "gave_up"),
    [
        (False, False, False, True, ""),
        (True, False, False, False, ""),
        (True, True, False, True, ""),
        (True, True, True, False, "blocked: no way leads to 4 open ends and ports"),
    ],
)
def test_after_a_wreck_the_coordinator_waits_until_each_robot_has_a_place_again(
    wreck: bool, placed: bool, unswept: bool, done: bool, gave_up: str
) -> None:
    """The map is one swept slice; a wreck on the next slice hides nothing of it."""
    top, bottom = End(0, TOP, 5_000), End(0, BOTTOM, 0)
    coordinator = TeamCoordinator(CoordinatorSetup())
    coordinator.map.merge([SweptSegment(0, 0, 5_000)])
    coordinator.map.merge([TracedArc(top, way, bottom, 9_000, 0, 0) for way in (LEFT, RIGHT)])
    coordinator.map.merge([Void(1, 950, 2_000, 3_000, Wreck(1, 5))] if wreck else [])
    coordinator.map.merge([SweptSegment(9, 0, 5_000)] if unswept else [])
    status = Status(0, 1, 0, 0, 1, 0, READY, top if placed else None, False, False, None, None, None, (1, 0))
    views = (View(4, 0, (0,)),)
    sent = write_beacon(TeamBeacon(0, views, (), (), (status,), 0, 0))
    for tick in range(2):
        command = coordinator.step(Observation(tick, float(tick), inbox=(Packet("uplink", sent, 0),)))
    assert (command.done, command.gave_up) == (done, gave_up)
