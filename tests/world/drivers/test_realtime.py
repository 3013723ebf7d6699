"""In real time the driver waits for no program: neither for one that starts nor for one that hangs."""

import math
import os
import signal
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from support import ROOT, ZWERM, scenario, stop
from waiting import until

from zwerm.agents.runtime.node import Node
from zwerm.deploy import swarm as swarm_module
from zwerm.deploy.identity import router_settings
from zwerm.deploy.node_specs import node_specs, restart_spec
from zwerm.deploy.runtime_directory import private_directory
from zwerm.deploy.swarm import LocalSwarm
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.run.runner import new_run_id
from zwerm.world.drivers.realtime import UNANSWERED_BYTES_MAX, UNANSWERED_MAX, RealTime
from zwerm.world.world import World

SOON_S = 30.0
WAIT_BEFORE_CLOSE_US = "transport/link/tx/queue/congestion_control/block/wait_before_close"


def test_the_world_goes_on_while_a_program_starts_and_observes_it_once_it_has() -> None:
    chosen = scenario(faults=[{"kind": "restart", "nodes": [1], "at_s": 0.5}], time={"duration_s": 4.0})
    world = assemble(chosen, 1)
    link = MemoryLink(
        {node: Node(*spec).answer for node, spec in node_specs(chosen, 1).items()},
        lambda node, life: Node(*restart_spec(chosen, 1, node, life)).answer,
    )
    tick_15, started, observed = threading.Event(), threading.Event(), Counter[int]()
    start, send = link.start, link.send
    waited: list[bool] = []

    def start_when_the_world_has_gone_on(node: int) -> None:
        waited.append(tick_15.wait(SOON_S))
        start(node)
        started.set()

    def counted(node: int, payload: bytes) -> None:
        observed[node] += 1
        send(node, payload)

    def on_tick(world: World) -> None:
        if world.tick == 15:
            assert observed[1] == 5, "a program that does not run yet is not observed"
            tick_15.set()
        elif world.tick == 20:
            assert started.wait(SOON_S)

    link.start, link.send = start_when_the_world_has_gone_on, counted  # type: ignore[method-assign]
    assert RealTime(world, link, 20.0, [on_tick], link).run() == "time-limit"
    assert waited == [True]
    assert world.status.history == {"crashed": [1], "restarted": [1]}
    assert 5 < observed[1] <= 40 - 10
    assert observed[0] == 40


def test_a_hung_robot_gets_a_bounded_number_of_observations_and_is_observed_again_when_it_goes_on(
    nothing_left: None,
) -> None:
    chosen = scenario(time={"dt_s": 0.01, "duration_s": 2.0})
    with LocalSwarm(new_run_id(), node_specs(chosen, 1), paced=True) as swarm:
        world, observed = assemble(chosen, 1), Counter[int]()
        send = swarm.link.send

        def counted(node: int, payload: bytes) -> None:
            observed[node] += 1
            send(node, payload)

        def on_tick(world: World) -> None:
            if world.tick == 10:
                swarm.pause(2)
            elif world.tick == 120:
                assert observed[2] <= 10 + UNANSWERED_MAX
                swarm.resume(2)

        swarm.link.send = counted  # type: ignore[method-assign]
        driver = RealTime(world, swarm.link, 1.0, [on_tick], swarm)
        assert driver.run() == "time-limit"
        assert observed[0] == observed[1] == observed[3] == 200
        assert 10 + UNANSWERED_MAX < observed[2] < 200
        assert driver.deadman_stops >= 1


@pytest.mark.parametrize("size_bytes", [100, 2_100, 3_750, 20_000, 60_000])
def test_all_unanswered_observations_of_a_hung_robot_fit_into_the_buffers_of_the_link(
    nothing_left: None, size_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def patient(*arguments: Any) -> dict[str, Any]:
        return router_settings(*arguments) | {WAIT_BEFORE_CLOSE_US: round(4e6 * SOON_S)}

    # The middleware would drop what does not fit after 5 s.
    monkeypatch.setattr(swarm_module, "router_settings", patient)
    most = min(UNANSWERED_MAX, math.ceil(UNANSWERED_BYTES_MAX / size_bytes))
    with LocalSwarm(new_run_id(), node_specs(scenario(robots={"count": 1}), 1), paced=True) as swarm:
        stop(swarm.supervisor.pids[0])

        def send_all() -> None:
            for _ in range(most):
                swarm.link.send(0, bytes(size_bytes))

        sending = threading.Thread(target=send_all, daemon=True)
        sending.start()
        sending.join(SOON_S)
        blocked = sending.is_alive()
        swarm.kill(0)
        sending.join()
        assert not blocked


def test_a_run_removes_the_directories_of_killed_runs_and_not_those_of_living_ones(private_tmp: Path) -> None:
    command = [sys.executable, *ZWERM, "run", "beacon-twin", "--realtime", "1", "--json"]
    with subprocess.Popen(command, env=os.environ | {"PYTHONPATH": str(ROOT)}) as world:
        until(lambda: list(private_tmp.glob("zwerm-*/router")), "the world listens")
        living = list(private_tmp.glob("zwerm-*"))  # of the router, and of the fork server
        with private_directory() as own:
            assert sorted(private_tmp.glob("zwerm-*")) == sorted([*living, own]), "those of a living run are held"
            os.kill(world.pid, signal.SIGKILL)
            world.wait()
            with private_directory() as another:
                assert sorted(private_tmp.glob("zwerm-*")) == sorted([own, another])
    assert list(private_tmp.glob("zwerm-*")) == []
