"""Same scenario and seed, same trace: inline and in processes, for every start order, load and hash seed."""

import json
import os
import random
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from support import ROBOTS, ROOT, ZWERM, scenario

from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.swarm import LocalSwarm
from zwerm.run.assembly import assemble
from zwerm.run.result import RunResult
from zwerm.run.runner import drive, new_run_id, run
from zwerm.scenario.tables import Scenario

SEEDS = range(1, 21)


def chattering(**tables: object) -> Scenario:
    """Return a scenario in which radio, sleep, contacts, noise and controllers' own randomness all reach the trace."""
    robots = {
        "count": 6,
        "controller": "troubled:Chatter",
        "body": {"latency_ticks": 1, "drive_noise_fraction": 0.05},
        "placement": {"kind": "disc", "radius_m": 0.3},
        "sensors": [{"kind": "bearings", "range_m": 1.0, "sd_rad": 0.1}, {"kind": "touch"}, {"kind": "odometry"}],
    }
    return scenario(robots=robots, radio={"range_m": 1.0, "line_of_sight": True}, time={"duration_s": 4.0}, **tables)


def in_processes(chosen: Scenario, seed: int, order: list[int] | None = None) -> RunResult:
    with LocalSwarm(new_run_id(), node_specs(chosen, seed), order=order) as swarm:
        return drive(assemble(chosen, seed), swarm.link, seed, "processes")


@contextmanager
def cpu_hog() -> Iterator[None]:
    """Keep every core busy while the block lasts."""
    hogs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def test_twenty_seeds_give_one_trace_each_inline_and_in_processes_in_any_start_order(nothing_left: None) -> None:
    chosen = chattering()
    traces = []
    for seed in SEEDS:
        order = list(range(6))
        random.Random(seed).shuffle(order)
        inline = run(chosen, seed, "inline")
        processes = in_processes(chosen, seed, order)
        assert processes.trace == inline.trace
        assert processes.metrics == inline.metrics
        assert processes.radio == inline.radio
        assert inline.radio["delivered"] > 0
        assert inline.ticks == 40
        traces.append(inline.trace)
    assert len(set(traces)) == len(SEEDS), "another seed must give another trace"


def test_a_busy_machine_changes_nothing(nothing_left: None) -> None:
    chosen = chattering()
    with cpu_hog():
        loaded = in_processes(chosen, 3)
    assert loaded.trace == run(chosen, 3, "inline").trace


@pytest.mark.parametrize("hash_seed", ["0", "1", "random"])
def test_the_hash_seed_of_python_changes_nothing(hash_seed: str) -> None:
    command = [sys.executable, *ZWERM, "run", "computation-free", "--json"]
    command += ["--set", "time.duration_s=3", "--set", "robots.count=4", "--seed", "5"]
    environment = os.environ | {"PYTHONHASHSEED": hash_seed, "PYTHONPATH": f"{ROOT}:{ROBOTS}"}
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60)
    found = json.loads(ran.stdout)
    inline = run("computation-free", 5, "inline", ["time.duration_s=3", "robots.count=4"])
    assert found["runner"] == "processes"
    assert found["trace"] == inline.trace


def test_a_start_shifted_by_a_picometre_changes_the_trace() -> None:
    def starting_at(x_m: float) -> Scenario:
        poses = {"kind": "poses", "poses": [[x_m, 0.5, 0.0]]}
        return scenario(
            robots={"count": 1, "controller": "random-walk", "sensors": [{"kind": "pose"}], "placement": poses}
        )

    assert run(starting_at(0.5), 1, "inline").trace == run(starting_at(0.5), 1, "inline").trace
    assert run(starting_at(0.5), 1, "inline").trace != run(starting_at(0.5 + 1e-12), 1, "inline").trace


def test_an_additional_robot_far_away_changes_no_other_robots_draws() -> None:
    poses = [[0.5, 0.5, 0.0], [1.0, 0.5, 1.0], [1.5, 1.5, 2.0]]
    body = {"drive_noise_fraction": 0.05}
    walk = {"controller": "random-walk", "body": body, "sensors": []}
    three = scenario(
        arena={"size_m": [9.0, 9.0]}, robots=walk | {"count": 3, "placement": {"kind": "poses", "poses": poses}}
    )
    far = [*poses, [8.0, 8.0, 0.0]]
    four = scenario(
        arena={"size_m": [9.0, 9.0]}, robots=walk | {"count": 4, "placement": {"kind": "poses", "poses": far}}
    )
    a, b = run(three, 1, "inline"), run(four, 1, "inline")
    assert (a.history.arrays().position[-1] == b.history.arrays().position[-1][:3]).all()
