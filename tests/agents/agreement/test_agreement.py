"""Averages and leaders under loss, partition and clocks that differ."""

import numpy as np
import pytest

from zwerm.agents.agreement import Averaging, LeaderLease
from zwerm.agents.conformance.check import check
from zwerm.run.result import RunResult
from zwerm.run.runner import run

SEEDS = range(1, 7)
ABSOLUTE = "robots.parameters.absolute=true"


def lease(seed: int, *settings: str) -> RunResult:
    return run("agreement-lease", seed, "inline", settings)


def test_both_controllers_keep_their_contract() -> None:
    check(Averaging)
    check(LeaderLease, {"swarm": 9})


def test_parts_of_a_partitioned_swarm_agree_apart_and_together_after_it() -> None:
    result = run("agreement-averaging", 1, "inline")
    time_s, value = result.telemetry.time_s, result.telemetry.value
    left = result.telemetry.node < 4

    def values(at_s: float, part: np.ndarray) -> np.ndarray:
        return value[part & (np.abs(time_s - at_s) < 0.01)]

    assert np.ptp(values(0.0, left | ~left)) == 8.0
    apart = abs(values(10.9, left).mean() - values(10.9, ~left).mean())
    assert apart > 2.0
    assert max(np.ptp(values(10.9, left)), np.ptp(values(10.9, ~left))) < 0.1 * apart
    assert result.metrics["value_spread"] < 0.1 * apart


def test_leases_by_own_clocks_never_have_two_leaders_and_most_of_the_time_one() -> None:
    for seed in SEEDS:
        metrics = lease(seed).metrics
        assert metrics["leaders_max"] == 1.0
        assert metrics["two_leaders_s"] == 0.0
        assert metrics["leaderless_s"] < 15.0


def test_leases_by_the_clock_of_another_have_two_leaders_where_clocks_have_offsets() -> None:
    assert sum(lease(seed, ABSOLUTE).metrics["two_leaders_s"] for seed in SEEDS) > 0.0
    exact = [lease(seed, ABSOLUTE, "robots.clock.offset_s_max=0").metrics["two_leaders_s"] for seed in SEEDS]
    assert exact == [0.0] * len(SEEDS)


def test_a_minority_has_no_leader() -> None:
    settings = ["faults=[{kind='partition',groups=[[0,1,2,3],[4,5]],at_s=0.0}]", "robots.parameters.swarm=9"]
    assert lease(1, *settings).metrics["leaders_max"] == 0.0


@pytest.mark.parametrize("scenario", ["agreement-averaging", "agreement-lease"])
def test_runs_are_the_same_inline_and_in_processes(scenario: str, nothing_left: None) -> None:
    short = ["time.duration_s=2.0", "faults=[]"]
    assert run(scenario, 1, "inline", short).trace == run(scenario, 1, "processes", short).trace
