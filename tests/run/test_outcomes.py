"""The end of a deployment: its completion, and every reason for failure, each with its line and exit status."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from halls import HALL, Link, drive
from support import ROOT, ZWERM

from zwerm.run.measurement import measure
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.wire.messages import BodyVelocity, Command, decode_observation, encode, open_answer
from zwerm.world.world import World

STATIONS = ("arena.size_m=[4.2,2.6]", "robots.count=40", "base.poses=[[0.2,1.3,0.0],[4.0,1.3,3.0]]")


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        (("robots.count=6",), "depot-dry: the depot is empty; frontier edges left: 6"),
        (
            ("arena.size_m=[0.5,0.5]", "base.pose=[0.2,0.2,0.0]", 'coordinator.parameters.walls="paper"'),
            "source-blocked: no robot can leave the base; frontier edges left: 0",
        ),
        (
            ('faults=[{kind="crash",at_s=30,nodes=["base"]}]',),
            "source-lost: no base station answers; frontier edges left: 4",
        ),
        (
            ('faults=[{kind="crash",at_s=0.5,nodes=["base"]}]',),
            "source-lost: no base station answers; frontier edges left: 0",
        ),
        (("coordinator.parameters.cycles_max=5",), "no-end: too many cycles; frontier edges left: 5"),
    ],
)
def test_a_deployment_that_cannot_continue_states_its_reason(settings: tuple[str, ...], reason: str) -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, *settings])
    assert result.outcome == "failed"
    assert result.reason == f"node {result.robots} gave up: {reason}"
    assert result.metrics["deployment_cycles"] >= 3


def test_a_frontier_that_no_path_leads_to_is_cut_off() -> None:
    """In a corridor the robots in the middle die, and their replacements die, until no robot is sent there again."""
    corridor = (
        "arena.size_m=[6.0,0.5]",
        "base.pose=[0.2,0.25,0.0]",
        "robots.on_crash=continue",
        'coordinator.parameters.walls="paper"',  # robots that follow walls are sent there until the depot is empty
    )

    def strike(world: World) -> None:
        position = world.scene.position
        alive = [robot for robot in world.scene.present_ids().tolist() if robot not in world.status.crashed]
        if world.status.crashed or position[alive, 0].max() > 3.4:
            for robot in alive:
                if 1.6 < position[robot, 0] < 2.6 and world.tick % 40 == 0:
                    world.crash(robot, "struck by lightning")

    outcome, world = drive(load("sensor-coverage", corridor), strike)
    assert outcome == "failed"
    ending = world.ending()
    assert ending is not None
    assert ending.reason.startswith("node 160 gave up: cut-off: no path leads to the frontier; ")
    assert len(world.status.crashed) > 2


def test_a_failed_deployment_exits_with_1_and_one_clear_line(tmp_path: Path) -> None:
    sets = [word for each in (*HALL, "robots.count=6") for word in ("--set", each)]
    command = [sys.executable, *ZWERM, "run", "sensor-coverage", "--inline", "--json", *sets]
    ran = subprocess.run(
        command, cwd=tmp_path, env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert ran.returncode == 1
    assert ran.stderr.splitlines()[-1] == "zwerm: node 6 gave up: depot-dry: the depot is empty; frontier edges left: 6"
    assert '"outcome":"failed"' in ran.stdout


@pytest.mark.parametrize(
    "fault",
    [
        'kind="crash",at_s=64,nodes=[7]',  # the one that has just come out of the depot
        'kind="crash",at_s=65,nodes=[4]',  # the one that goes into the unknown
        'kind="crash",at_s=66,nodes=[7,4]',
        'kind="pause",at_s=64,for_s=500,nodes=[7]',
        'kind="pause",at_s=60,for_s=60,nodes=[3,4]',  # they come back, when their places are taken
        'kind="crash",at_s=60,for_s=30,nodes=[4]',  # it comes back and remembers nothing
        'kind="crash",at_s=60,for_s=3,nodes=["base"]',
        'kind="crash",at_s=60,for_s=3,nodes=["coordinator"]',
    ],
)
def test_a_node_that_dies_or_stops_on_its_way_is_replaced_or_found_again(fault: str) -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, f"faults=[{{{fault}}}]"])
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.99
    assert result.metrics["holes"] == 0.0


def test_a_coordinator_that_restarts_finds_the_current_state_of_the_swarm() -> None:
    fault = 'faults=[{kind="crash",at_s=60,for_s=3,nodes=["coordinator"]}]'
    through, anew = (run("sensor-coverage", runner="inline", overrides=[*HALL, *more]) for more in ((), (fault,)))
    assert anew.metrics["robots_deployed"] == through.metrics["robots_deployed"]


def with_dead_motors(robot: int, from_tick: int) -> Callable[[int, Link], Link]:
    def around(node: int, answer: Link) -> Link:
        def through(payload: bytes) -> bytes:
            command = open_answer(answer(payload))
            assert isinstance(command, Command)
            if decode_observation(payload).tick > from_tick and command.drive is not None:
                command.drive = BodyVelocity()
            return encode(command)

        return through if node == robot else answer

    return around


@pytest.mark.parametrize(("robot", "from_tick"), [(3, 350), (5, 350), (7, 350), (7, 640)])
def test_a_robot_that_cannot_reach_its_slot_is_replaced_by_another(robot: int, from_tick: int) -> None:
    scenario = load("sensor-coverage", HALL)
    outcome, world = drive(scenario, around=with_dead_motors(robot, from_tick))
    assert outcome == "completed"
    assert measure(world)["coverage_fraction"] >= 0.99


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6])
def test_with_two_stations_the_deployment_continues_if_one_dies(seed: int) -> None:
    fault = 'faults=[{kind="crash",at_s=20,nodes=[1]}]'
    result = run("sensor-coverage-multi-source", seed, "inline", [*STATIONS, fault])
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.99


@pytest.mark.parametrize("walls", ["paper", "followed"])
def test_with_two_stations_the_deployment_continues_if_one_is_blocked(walls: str) -> None:
    box = "arena.walls=[[[3.85,1.1],[3.85,1.5]],[[3.85,1.1],[4.2,1.1]],[[3.85,1.5],[4.2,1.5]]]"
    rules = f'coordinator.parameters.walls="{walls}"'
    result = run("sensor-coverage-multi-source", runner="inline", overrides=[*STATIONS, box, rules])
    assert result.metrics["coverage_fraction"] >= 0.99
    if walls == "followed" and "unproven" in result.reason:
        pytest.xfail("three bodies fill the closet of the station, and an arc of 12 degrees stays open there")
    assert result.outcome == "completed"
