"""Clocks of robots: drawn by the seed, seen in observations, and understood in wakes."""

import numpy as np
import pytest
from support import scenario

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.tables import ClockTable
from zwerm.wire.messages import Command, Wake, decode_observation, encode
from zwerm.world.tick.clocks import Clocks

TABLE = ClockTable(offset_s_max=2.0, drift_ppm_max=1e4)


def test_a_clock_is_drawn_by_the_seed_and_an_additional_robot_changes_no_other() -> None:
    clocks, again, other = Clocks(TABLE, 5, 5, Draws(1)), Clocks(TABLE, 6, 7, Draws(1)), Clocks(TABLE, 5, 5, Draws(2))
    assert clocks.offset_s.tolist() == again.offset_s[:5].tolist() != other.offset_s.tolist()
    assert clocks.drift.tolist() == again.drift[:5].tolist() != other.drift.tolist()
    assert (again.offset_s[6], again.drift[6]) == (0.0, 0.0)  # a coordinator's


def test_offsets_and_drifts_fill_their_ranges_evenly() -> None:
    clocks = Clocks(TABLE, 20_000, 20_000, Draws(3))
    for values, greatest in ((clocks.offset_s, 2.0), (clocks.drift, 0.01)):
        assert np.abs(values).max() <= greatest
        counts = np.histogram(values, bins=10, range=(-greatest, greatest))[0]
        assert np.abs(counts - 2_000).max() < 5.0 * np.sqrt(2_000)
    assert abs(np.corrcoef(clocks.offset_s, clocks.drift)[0, 1]) < 0.03


def test_a_wake_is_by_the_clock_of_the_robot() -> None:
    clocks = Clocks(TABLE, 3, 3, Draws(1))
    wake = clocks.true_wake(1, Wake(at_s=clocks.local_s(7.3, [1])[0], on_packet=True))
    assert wake.at_s == pytest.approx(7.3)
    assert wake.on_packet
    assert clocks.true_wake(1, Wake()).at_s is None


def test_robots_observe_their_own_time_and_sleep_by_it() -> None:
    world = assemble(
        scenario(robots={"count": 3, "sensors": [], "controller": "gossip-max", "clock": TABLE.model_dump()}), 4
    )
    assert world.clocks is not None
    seen: dict[int, list[int]] = {0: [], 1: [], 2: []}
    for _ in range(12):
        nodes, payloads = world.observe()
        for node, payload in zip(nodes, payloads, strict=True):
            observation = decode_observation(payload)
            true_s = world.tick * 0.1
            assert observation.time_s == pytest.approx(world.clocks.local_s(true_s, [node])[0])
            seen[node].append(observation.tick)
            # Each robot asks to be woken at the time that its own clock reads 0.75 s later.
            world.accept(node, encode(Command(world.tick, wake=Wake(at_s=observation.time_s + 0.75))))
        world.advance()
    assert seen == {node: [0, 8] for node in seen}


def test_exact_clocks_change_nothing_and_others_the_trace(nothing_left: None) -> None:
    exact = run(scenario(robots={"clock": {}}), 1, "inline").trace
    assert exact == run(scenario(), 1, "inline").trace
    wrong = scenario(robots={"clock": TABLE.model_dump()})
    assert run(wrong, 1, "inline").trace == run(wrong, 1).trace != exact


def test_a_wrong_clock_is_one_line() -> None:
    with pytest.raises(ScenarioError, match=r"robots\.clock\.drift_ppm_max: expected < 1e\+06, got 1000000\.0"):
        scenario(robots={"clock": {"drift_ppm_max": 1e6}})
