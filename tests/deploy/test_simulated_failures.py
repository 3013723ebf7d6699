"""Link, drivers and admission under every mixture of failures, in virtual time: a few hundred published seeds.

Seed N of a schedule is seed N here: a failure is repeated by its number alone.
"""

import random

import numpy as np
import pytest
from seeds import explored
from support import scenario
from virtual_network import LEASE_S, VirtualNetwork

from zwerm.errors import StragglerError
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.lockstep import CRASH_GRACE_S, LockStep
from zwerm.world.drivers.realtime import RealTime
from zwerm.world.world import World

ROBOTS = 5
STRAGGLER_S = 30.0
SEEDS = explored(150)
NAMED_WITHIN_S = LEASE_S + 5.0  # the promise of docs/concepts/security.md


def chosen(on_crash: str) -> Scenario:
    return scenario(robots={"count": ROBOTS, "on_crash": on_crash}, time={"straggler_s": STRAGGLER_S})


def fail(network: VirtualNetwork, seed: int) -> float:
    """Add one to three failures to a network, and return when the first one that cannot heal begins [s]; inf for none."""
    draw = random.Random(1_000 + seed)
    first = float("inf")
    for _ in range(draw.randint(1, 3)):
        at_s, nodes = draw.uniform(0.0, 0.3), draw.sample(range(ROBOTS), draw.randint(1, ROBOTS))
        kind = draw.choice(("short", "long", "kill", "hang"))
        if kind in ("short", "long"):
            for_s = draw.uniform(0.1, LEASE_S - 0.5) if kind == "short" else draw.uniform(LEASE_S + 0.5, 60.0)
            network.cut(nodes, at_s, for_s)
        elif kind == "kill":
            network.kill(nodes[0], at_s)
        else:
            network.hang(nodes[0], at_s)
        if kind != "short":
            first = min(first, at_s)
    return first


@pytest.mark.parametrize("on_crash", ["fail", "continue"])
def test_every_run_in_lock_step_ends_in_time_and_with_a_reason(on_crash: str, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = run(chosen(on_crash), 1, "inline").trace
    outcomes = set()
    for seed in SEEDS:
        world = assemble(chosen(on_crash), 1)
        network = VirtualNetwork(chosen(on_crash), seed, monkeypatch)
        first_s = fail(network, seed)
        driver = LockStep(world, network)
        try:
            outcome, reason = driver.run(), driver.reason
        except StragglerError as error:
            outcome, reason = "failed", str(error)
        outcomes.add(outcome)
        if outcome == "failed":
            assert reason, seed
            assert first_s < float("inf"), (seed, "a failure that heals ended the run")
        elif not world.status.crashed:
            assert world.trace.hex() == whole, (seed, "an outage that healed changed the run")
        if on_crash == "fail" and network.lost_at:
            first_loss_s = min(network.lost_at.values())
            assert network.now <= first_loss_s + CRASH_GRACE_S + STRAGGLER_S, seed
            if "crashed at tick" in reason:
                assert network.now - min(first_s, first_loss_s) <= NAMED_WITHIN_S + LEASE_S, seed
        assert driver.lost == 0, (seed, "nothing was lost on the way")
        network.advance(network.now + 200.0)
        assert set(network.refusals.by_reason) <= {"returned", "not-joined"}, seed
        assert not set(network.lost_at) & set(network.admission.joined), (seed, "a lost node was taken back")
    assert outcomes == {"failed", "time-limit"}, "the seeds reach both"


def test_a_single_cut_cable_is_named_within_the_lease_for_any_number_of_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    for cut in range(1, ROBOTS + 1):
        world = assemble(chosen("fail"), 1)
        network = VirtualNetwork(chosen("fail"), cut, monkeypatch)
        network.cut(range(ROBOTS - cut, ROBOTS), 0.1, 1_000.0)
        driver = LockStep(world, network)
        assert driver.run() == "failed"
        assert driver.reason.startswith(f"node {ROBOTS - cut} crashed at tick ")
        assert network.now <= 0.1 + NAMED_WITHIN_S


def test_in_real_time_no_lost_robot_moves_again_after_any_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    moved = 0.0
    for seed in explored(60):
        tables = scenario(robots={"count": ROBOTS, "on_crash": "continue"}, time={"duration_s": 30.0, "dt_s": 0.5})
        world = assemble(tables, 1)
        network = VirtualNetwork(tables, seed, monkeypatch)
        fail(network, seed)
        still: dict[int, np.ndarray] = {}

        def watch(world: World, seed: int = seed, still: dict[int, np.ndarray] = still) -> None:
            for node in world.status.crashed:
                if world.tick > world.status.crash_ticks[node] + 1:
                    position = still.setdefault(node, world.scene.position[node].copy())
                    # Others may push it; by itself it moves no more.
                    assert np.hypot(*(world.scene.position[node] - position)) < 0.5, (seed, node)

        outcome = RealTime(world, network, 1.0, [watch]).run()
        assert outcome in ("time-limit", "failed"), seed
        moved = max(moved, float(np.hypot(*(world.scene.position - assemble(tables, 1).scene.position).T).max()))
    assert moved > 0.1, "robots that live do move"
