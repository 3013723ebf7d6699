"""Faults of real processes: SIGKILL, SIGSTOP and new incarnations, with the trace that the same run has inline."""

import os
import signal
from pathlib import Path
from typing import Any

import pytest
from support import robots_of_this_process, scenario, state_of, stop
from waiting import until

from zwerm.deploy.node_specs import node_specs
from zwerm.deploy.swarm import LocalSwarm
from zwerm.errors import LinkError, ScenarioError, StragglerError
from zwerm.link.node_link import ZenohNodeLink
from zwerm.run.assembly import assemble
from zwerm.run.progress import NullProgress
from zwerm.run.runner import drive, new_run_id, run, serve
from zwerm.scenario.tables import Scenario

EVERY_FAULT: list[dict[str, Any]] = [
    {"kind": "crash", "nodes": [1], "at_s": 0.4, "for_s": 0.5},
    {"kind": "restart", "nodes": [2, "coordinator"], "at_s": 0.6},
    {"kind": "pause", "nodes": [3], "at_s": 0.5, "for_s": 0.6},
    {"kind": "crash", "nodes": [3], "at_s": 0.8, "for_s": 0.6},
    {"kind": "slow", "nodes": [0], "every_ticks": 3, "at_s": 0.3, "for_s": 0.9},
    {"kind": "join", "nodes": [4], "at_s": 0.7},
    {"kind": "partition", "groups": [[0, 1], ["coordinator", 2]], "at_s": 0.9, "for_s": 0.3},
    {"kind": "jam", "center_m": [0.5, 0.5], "radius_m": 0.7, "at_s": 1.2},
    {"kind": "cut", "senders": [2], "receivers": [3, 4], "at_s": 0.2},
    {"kind": "blackout", "channel": "uplink", "at_s": 1.1, "for_s": 0.2},
    {"kind": "heal", "at_s": 1.7},
    {"kind": "pause", "nodes": [0], "at_s": 1.8},
    {
        "kind": "sensor_noise",
        "sensor": "bearings",
        "sd": 0.1,
        "missed_fraction": 0.2,
        "false_fraction": 0.2,
        "at_s": 0.0,
    },
    {"kind": "stuck_touch", "robots": [1], "switch": 2, "closed": True, "at_s": 0.5},
    {"kind": "dead_beacon", "robots": [2], "at_s": 0.3, "for_s": 0.5},
    {"kind": "camera_blackout", "robots": [3], "at_s": 0.0, "for_s": 0.3},
]
EVERY_MODEL: list[dict[str, Any]] = [
    {"kind": "path_loss", "tx_power_dbm": -45.0},
    {"kind": "gilbert_elliott", "loss_fraction": 0.1, "burst_packets": 3.0},
    {"kind": "delay", "jitter_s": 0.2, "distribution": "exponential"},
    {"kind": "duplication", "fraction": 0.2},
    {"kind": "corruption", "bit_error_rate": 0.0005},
    {"kind": "collision", "airtime_s": 0.005},
]


def everything() -> Scenario:
    return scenario(
        robots={
            "count": 5,
            "controller": "radioed:Babbles",
            "body": {"drive_noise_fraction": 0.05},
            "sensors": [{"kind": "bearings", "sd_rad": 0.05}, {"kind": "touch"}, {"kind": "line_of_sight"}],
        },
        radio={"models": EVERY_MODEL, "loss": 0.1, "check": True},
        uplink={"loss": 0.2},
        coordinator={"controller": "radioed:Babbles"},
        faults=EVERY_FAULT,
    )


def test_ten_seeds_with_every_fault_and_model_give_one_trace_each_inline_and_in_processes(
    nothing_left: None,
) -> None:
    chosen = everything()
    traces = []
    for seed in range(1, 11):
        inline, processes = run(chosen, seed, "inline"), run(chosen, seed, "processes")
        assert (processes.outcome, processes.reason) == ("time-limit", "")
        assert processes.trace == inline.trace
        assert processes.radio == inline.radio
        assert processes.as_json()["nodes"] == inline.as_json()["nodes"]
        assert processes.middleware_lost == 0
        traces.append(inline.trace)
    assert inline.crashed == [1, 2, 3, 5]
    assert inline.restarted == [1, 2, 3, 5]
    assert len(set(traces)) == 10, "another seed must give another trace"


def test_a_crash_is_a_sigkill_and_a_pause_a_sigstop(nothing_left: None) -> None:
    faults = [{"kind": "crash", "nodes": [1], "at_s": 0.5}, {"kind": "pause", "nodes": [2], "at_s": 0.5}]
    chosen = scenario(faults=faults, time={"duration_s": 1.0})
    with LocalSwarm(new_run_id(), node_specs(chosen, 1)) as swarm:
        pids = swarm.supervisor.pids
        world = assemble(chosen, 1)
        drive(world, swarm.link, 1, "processes", programs=swarm)
        assert swarm.supervisor.exit_codes == {1: -signal.SIGKILL}
        until(lambda: state_of(pids[2]) == "T", "the paused process is stopped")
        assert state_of(pids[0]) != "T"


def test_a_process_that_is_stopped_from_outside_ends_the_run_with_its_name(nothing_left: None) -> None:
    chosen = scenario(time={"straggler_s": 2.0, "duration_s": 60.0})
    with LocalSwarm(new_run_id(), node_specs(chosen, 1)) as swarm:
        world = assemble(chosen, 1)
        stop(swarm.supervisor.pids[2])
        result = drive(world, swarm.link, 1, "processes", programs=swarm)
        assert result.outcome == "failed"
        assert result.reason == str(StragglerError([2], 0, 2.0))


def test_a_late_joiner_has_no_process_before_its_time(nothing_left: None) -> None:
    chosen = scenario(faults=[{"kind": "join", "nodes": [3], "at_s": 1.0}])
    world = assemble(chosen, 1)
    with LocalSwarm(new_run_id(), node_specs(chosen, 1), late_joiners=world.schedule.late_joiners) as swarm:
        assert len(robots_of_this_process()) == 3
        result = drive(world, swarm.link, 1, "processes", programs=swarm)
        assert len(robots_of_this_process()) == 4
        assert result.trace == run(chosen, 1, "inline").trace


def test_a_stale_incarnation_is_refused_and_counted(nothing_left: None) -> None:
    chosen = scenario()
    with LocalSwarm(new_run_id(), node_specs(chosen, 1)) as swarm:
        old = next(credential for credential in swarm.credentials.nodes if credential.node == 1)
        endpoint = swarm.supervisor._endpoint
        swarm.restart(1)
        swarm.kill(1)
        swarm.link.wait_joined(lambda joined: 1 not in joined, 10.0)
        # The first incarnation, back from the dead: the second is the one that is expected.
        ghost = ZenohNodeLink(swarm.credentials.run, old, endpoint, deadline_s=10.0)
        try:
            with pytest.raises(LinkError, match=r"the world refuses it: incarnation: the run expects another"):
                ghost.join()
        finally:
            ghost.close()
        assert swarm.link.refusals.by_reason["incarnation"] == 1


def test_late_commands_of_a_killed_robot_are_refused_in_real_time_and_its_next_incarnation_runs(
    nothing_left: None,
) -> None:
    faults = [
        {"kind": "restart", "nodes": [1], "at_s": 0.5},
        {"kind": "pause", "nodes": [2], "at_s": 0.5, "for_s": 0.3},
    ]
    result = run(scenario(faults=faults, time={"duration_s": 2.0}), 1, "processes", realtime=1.0)
    assert result.outcome == "time-limit"
    assert (result.crashed, result.restarted) == ([1], [1])


def test_a_crash_of_robots_that_run_elsewhere_is_refused(tmp_path: Path) -> None:
    chosen = scenario(faults=[{"kind": "crash", "nodes": [1], "at_s": 0.5}])
    with pytest.raises(ScenarioError, match=r"^small.toml: faults: robots that run elsewhere cannot be killed"):
        serve(chosen, 1, ["tcp/127.0.0.1:0"], tmp_path / "robots.key")


class Interrupter(NullProgress):
    """Presses Ctrl-C once the run is a second old."""

    def ticked(self, tick: int, ticks: int) -> None:
        if tick == 12:
            os.kill(os.getpid(), signal.SIGINT)


def test_an_interrupt_while_robots_are_paused_ends_them_all(nothing_left: None) -> None:
    chosen = scenario(faults=[{"kind": "pause", "nodes": [0, 1, 2], "at_s": 0.2}], time={"duration_s": 600.0})
    result = run(chosen, 1, "processes", realtime=1.0, watcher=Interrupter())
    assert result.outcome == "interrupted"
    assert 12 <= result.ticks < 100
