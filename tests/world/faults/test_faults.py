"""Faults begin and end by their schedule, have exactly their effects, and a mistake in one is a line that names it."""

import io
from typing import Any

import numpy as np
import pytest
from halls import HALL
from rich.console import Console
from support import scenario

from zwerm.agents.runtime.node import Node
from zwerm.catalogue import FAULTS
from zwerm.cli.console import print_result
from zwerm.deploy.node_specs import node_specs, restart_spec
from zwerm.errors import LinkError, ScenarioError
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Observation, decode_observation
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.faults.generator import random_faults
from zwerm.world.faults.programs.crash import Crash, CrashTable
from zwerm.world.faults.sensing.sensor_noise import SensorNoise, SensorNoiseTable
from zwerm.world.tick.node_status import ProcessAction
from zwerm.world.world import SendMany

POSES = [[0.3, 0.3, 0.0], [1.7, 0.3, 0.0], [0.3, 1.7, 0.0], [1.7, 1.7, 0.0]]


def faulty(*faults: dict[str, Any], **tables: Any) -> Scenario:
    robots = {
        "count": 4,
        "controller": "radioed:Counts",
        "sensors": [],
        "body": {"kind": "holonomic", "radius_m": 0.05},
        "placement": {"kind": "poses", "poses": POSES},
    } | tables.pop("robots", {})
    radio = {"check": True} | tables.pop("radio", {})
    return scenario(robots=robots, radio=radio, faults=list(faults), **tables)


class Life:
    """A run in memory, recorded tick by tick: `observed[tick][node]`, `orders[tick]`."""

    def __init__(self, chosen: Scenario, seed: int = 1) -> None:
        self.world = assemble(chosen, seed)
        self.observed: list[dict[int, Observation]] = []
        self.orders: list[list[ProcessAction]] = []
        nodes = {node: Node(*spec).answer for node, spec in node_specs(chosen, seed).items()}
        link = MemoryLink(
            nodes,
            lambda node, life: Node(*restart_spec(chosen, seed, node, life)).answer,
            self.world.schedule.late_joiners,
        )
        self._spy()
        self.outcome = LockStep(self.world, link, programs=link).run()

    def _spy(self) -> None:
        world, begin, observe = self.world, self.world.begin, self.world.observe

        def spied_begin() -> list[ProcessAction]:
            self.orders.append(begin())
            return self.orders[-1]

        def spied_observe(send_many: SendMany | None = None) -> tuple[list[int], list[bytes]]:
            nodes, payloads = observe(send_many)
            self.observed.append(dict(zip(nodes, map(decode_observation, payloads), strict=True)))
            return nodes, payloads

        world.begin, world.observe = spied_begin, spied_observe  # type: ignore[method-assign]

    def awake(self, node: int) -> list[int]:
        """Return the ticks at which a node was observed."""
        return [tick for tick, observed in enumerate(self.observed) if node in observed]

    def received(self, receiver: int, sender: int) -> list[int]:
        """Return the ticks at which the packets were sent that one node received from another."""
        return [
            tick - 1
            for tick, observed in enumerate(self.observed)
            if receiver in observed
            for packet in observed[receiver].inbox
            if packet.sender == sender
        ]

    def steps(self, receiver: int, sender: int) -> list[int]:
        """Return the counts that one node received from another: the sender's number of observations."""
        return [
            int(packet.payload.split()[1])
            for observed in self.observed
            if receiver in observed
            for packet in observed[receiver].inbox
            if packet.sender == sender
        ]


ALL = list(range(20))


def test_a_fault_that_never_began_is_counted_and_named_in_the_result() -> None:
    never: list[dict[str, Any]] = [
        {"kind": "crash", "nodes": [0], "at_s": 9.0},
        {"kind": "blackout", "when": {"metric": "cell_coverage_fraction", "at_least": 1.0}},
    ]
    came: list[dict[str, Any]] = [
        {"kind": "pause", "nodes": [1], "at_s": 0.0, "for_s": 1.0},
        {"kind": "restart", "nodes": [2], "at_s": 0.1},
        {"kind": "heal", "at_s": 0.1},
    ]
    agreeing = {"controller": "gossip-max", "parameters": {"done_at": 3}}
    chosen = faulty(*never, *came, time={"duration_s": 10.0}, metrics={"cells": [3, 3]}, robots=agreeing)
    result = run(chosen, runner="inline")
    assert (result.outcome, result.sim_s < 9.0) == ("completed", True)
    assert result.missed_faults == ["crash at 9 s", "blackout on a condition"]
    assert result.metrics["faults_missed"] == 2.0
    console = Console(width=80, record=True, file=io.StringIO())
    print_result(console, result)
    assert "faults that never came" in console.export_text()
    healthy = run(faulty(time={"duration_s": 0.5}), runner="inline")
    assert "faults_missed" not in healthy.metrics
    assert healthy.missed_faults == []


# --- the radio ------------------------------------------------------------------------------------------------------


def test_a_partition_blocks_exactly_the_crossing_links_and_heals() -> None:
    life = Life(faulty({"kind": "partition", "groups": [[0, 1], [2]], "at_s": 0.5, "for_s": 0.5}))
    during = range(5, 10)
    for receiver in range(4):
        for sender in range(4):
            if sender != receiver:
                together = {sender, receiver} == {0, 1}
                expected = [tick for tick in ALL[:-1] if together or tick not in during]
                assert life.received(receiver, sender) == expected, (receiver, sender)
    assert life.world.medium.summary()["dropped"] == {"partition": 10 * 5}


def test_a_cut_link_is_one_way_unless_both_is_set() -> None:
    life = Life(faulty({"kind": "cut", "senders": [0], "receivers": [1], "at_s": 0.0}))
    assert life.received(1, 0) == []
    assert life.received(0, 1) == ALL[:-1]
    both = Life(faulty({"kind": "cut", "senders": [0], "receivers": [1], "both": True, "at_s": 0.0}))
    assert both.received(1, 0) == both.received(0, 1) == []
    assert both.received(2, 0) == ALL[:-1]


@pytest.mark.parametrize("region", [{"center_m": [1.7, 0.3], "radius_m": 0.5}, {"rectangle_m": [1.0, 0.0, 2.0, 1.0]}])
def test_a_jammer_blocks_receivers_in_its_region_only(region: dict[str, Any]) -> None:
    life = Life(faulty({"kind": "jam", "at_s": 1.0, **region}))
    assert life.received(1, 0) == ALL[:10]
    assert life.received(0, 1) == ALL[:-1]


def test_a_blackout_blocks_its_channel_only() -> None:
    life = Life(
        faulty(
            {"kind": "blackout", "channel": "uplink", "at_s": 0.0, "until_s": 1.0},
            coordinator={"controller": "radioed:Counts"},
        )
    )
    assert life.received(4, 0) == ALL[10:-1]
    assert life.received(0, 4) == ALL[10:-1]
    assert life.received(0, 1) == ALL[:-1]


def test_a_heal_ends_every_active_fault_except_a_crash() -> None:
    life = Life(
        faulty(
            {"kind": "blackout", "at_s": 0.2},
            {"kind": "pause", "nodes": [1], "at_s": 0.2},
            {"kind": "slow", "nodes": [2], "every_ticks": 5, "at_s": 0.2},
            {"kind": "crash", "nodes": [3], "at_s": 0.2},
            {"kind": "heal", "at_s": 1.0},
            {"kind": "cut", "senders": [0], "receivers": [1], "at_s": 1.5},
        )
    )
    assert life.received(0, 2) == [0, 1, *range(11, 19)], "its last slow answer comes at tick 11"
    assert life.awake(1) == [0, 1, *range(10, 20)]
    assert life.awake(3) == [0, 1]
    # At tick 10 it also finds what was sent before its pause and the blackout, at tick 1.
    assert life.received(1, 0) == [0, 9, *range(10, 15)], "what began after the healing is not healed"


def test_overlapping_faults_are_all_active_and_end_one_by_one() -> None:
    life = Life(
        faulty(
            {"kind": "cut", "senders": [0], "receivers": [1], "at_s": 0.2, "until_s": 1.0},
            {"kind": "cut", "senders": [0], "receivers": [1, 2], "at_s": 0.5, "until_s": 1.5},
        )
    )
    assert life.received(1, 0) == [0, 1, *range(15, 19)]
    assert life.received(2, 0) == [*range(5), *range(15, 19)]


# --- conditions -----------------------------------------------------------------------------------------------------


def test_a_fault_begins_when_a_robot_is_deployed() -> None:
    robots = {"entrance": {"every_s": 0.4, "entry_m": [0.5, 0.5, 1.5, 1.5]}, "placement": {}}
    life = Life(faulty({"kind": "blackout", "when": {"robot_deployed": 2}, "for_s": 0.3}, robots=robots))
    entered = life.awake(2)[0]
    assert entered == 8
    assert life.received(1, 0) == [*range(4, 8), *range(11, 19)]


def test_a_fault_begins_when_a_coverage_is_reached() -> None:
    for metric, metrics in (
        ("cell_coverage_fraction", {"cells": [2, 2]}),
        ("area_coverage_fraction", {"coverage_radius_m": 0.7}),
    ):
        robots = {"entrance": {"every_s": 0.1, "entry_m": [0.1, 0.1, 1.9, 1.9]}, "placement": {}, "count": 8}
        when = {"metric": metric, "at_least": 0.7}
        life = Life(faulty({"kind": "blackout", "when": when}, robots=robots, metrics=metrics))
        begun = life.received(1, 0)[-1] + 1
        assert 1 < begun < 12
        assert life.received(3, 2)[-1:] in ([begun - 1], [])


# --- nodes ----------------------------------------------------------------------------------------------------------


def test_a_crashed_robot_is_not_observed_and_returns_without_memory_as_a_new_incarnation() -> None:
    life = Life(faulty({"kind": "crash", "nodes": [1], "at_s": 0.5, "for_s": 0.5}))
    assert life.awake(1) == [*range(5), *range(10, 20)]
    assert life.received(0, 1) == [*range(5), *range(10, 19)]
    assert life.steps(0, 1) == [*range(1, 6), *range(1, 10)], "it counts from one again"
    words = [p.payload.split()[2] for seen in life.observed if 0 in seen for p in seen[0].inbox if p.sender == 1]
    assert len(set(words)) == len(words), "its new life has a random stream of its own"
    position = life.world.scene.position[1]
    assert position[0] == pytest.approx(1.7 + 0.001 * (5 + 10), abs=1e-6), "its motors stood still meanwhile"
    assert life.orders[5] == [ProcessAction("kill", 1)]
    assert life.orders[10] == [ProcessAction("start", 1)]
    assert life.world.status.history == {"crashed": [1], "restarted": [1]}


def test_packets_to_a_crashed_robot_are_dropped_with_their_cause() -> None:
    chosen = faulty({"kind": "crash", "nodes": [1], "at_s": 0.5}, radio={"models": [{"kind": "delay", "delay_s": 0.3}]})
    dropped = Life(chosen).world.medium.summary()["dropped"]
    # In the air at tick 5 were the packets of ticks 2 to 4, of three senders each; later ones found it down.
    assert dropped == {"receiver-crashed": 3 * 3, "receiver-down": 3 * 15}


def test_undelivered_packets_of_a_restarted_robot_are_dropped() -> None:
    delayed = {"models": [{"kind": "delay", "delay_s": 0.5}]}
    life = Life(faulty({"kind": "restart", "nodes": [1], "at_s": 1.0}, radio=delayed))
    # Sent at ticks 5 to 9, due at 10 and later.
    assert life.world.medium.summary()["dropped"]["stale-incarnation"] == 3 * 5
    assert life.steps(0, 1) == [*range(1, 6), *range(1, 6)]
    assert life.awake(1) == ALL
    assert life.orders[10] == [ProcessAction("kill", 1), ProcessAction("start", 1)]


def test_a_paused_robot_keeps_its_packets_and_memory_and_its_motors_stop_after_the_deadman_time() -> None:
    life = Life(faulty({"kind": "pause", "nodes": [1], "at_s": 0.5, "for_s": 1.0}, time={"deadman_s": 0.3}))
    assert life.awake(1) == [*range(5), *range(15, 20)]
    assert life.received(0, 1) == [*range(5), *range(15, 19)]
    assert life.steps(0, 1) == list(range(1, 10)), "it goes on where it was"
    assert len(life.observed[15][1].inbox) == 3 * 11, "its mail has waited"
    assert life.world.status.history == {"paused": [1]}
    assert life.world.scene.position[1, 0] == pytest.approx(1.7 + 0.001 * (5 + 3 + 5), abs=1e-6)


def test_a_slow_robot_is_observed_once_in_every_ticks_and_its_packets_are_that_late() -> None:
    life = Life(faulty({"kind": "slow", "nodes": [1], "every_ticks": 4, "at_s": 0.4, "for_s": 1.2}))
    assert life.awake(1) == [0, 1, 2, 3, 4, 8, 12, 16, 17, 18, 19]
    # Observed at 4, 8 and 12, it answers at 7, 11 and 15.
    assert life.received(0, 1) == [0, 1, 2, 3, 7, 11, 15, 16, 17, 18]
    assert life.world.status.history == {"slow": [1]}


def test_a_late_joiner_is_not_observed_before_its_time_and_its_body_is_in_the_arena() -> None:
    life = Life(faulty({"kind": "join", "nodes": [1], "at_s": 1.0}))
    assert life.awake(1) == list(range(10, 20))
    assert life.world.medium.summary()["dropped"] == {"receiver-down": 3 * 10}
    assert life.world.scene.position[1, 0] == pytest.approx(1.7 + 0.001 * 10, abs=1e-6)
    assert life.world.status.history == {"late": [1]}
    assert life.orders[10] == [ProcessAction("start", 1)]


def test_the_coordinator_can_crash_and_return() -> None:
    crash = {"kind": "crash", "nodes": ["coordinator"], "at_s": 0.5, "for_s": 0.5}
    life = Life(faulty(crash, coordinator={"controller": "radioed:Counts"}))
    assert life.awake(4) == [*range(5), *range(10, 20)]
    assert life.steps(0, 4) == [*range(1, 6), *range(1, 10)]


def test_a_robot_that_crashed_by_itself_can_be_started_again() -> None:
    robots = {"controller": "radioed:Raises", "on_crash": "continue"}
    life = Life(faulty({"kind": "crash", "nodes": [1], "at_s": 1.0, "for_s": 0.5}, robots=robots))
    assert life.orders[10] == [], "there is nobody to kill"
    assert life.orders[15] == [ProcessAction("start", 1)]
    assert life.awake(1) == [0, 1, 2, 15, 16, 17]


def test_a_run_ends_without_robots_that_never_return_and_waits_for_robots_that_will() -> None:
    robots = {"controller": "troubled:Finishes", "count": 4, "body": {"kind": "differential"}}
    gone = Life(faulty({"kind": "crash", "nodes": [3], "at_s": 0.0}, robots=robots))
    assert (gone.outcome, gone.world.tick) == ("completed", 3)
    back = Life(faulty({"kind": "crash", "nodes": [0], "at_s": 0.0, "for_s": 1.0}, robots=robots))
    assert (back.outcome, back.world.tick) == ("completed", 11)
    everyone = Life(faulty({"kind": "crash", "nodes": [0, 1, 2, 3], "at_s": 0.5}, robots=robots))
    assert everyone.outcome == "completed"
    assert everyone.world.tick == 4


def test_a_crash_of_a_program_that_runs_elsewhere_is_an_error() -> None:
    world = assemble(faulty({"kind": "crash", "nodes": [1], "at_s": 0.0}), 1)
    link = MemoryLink({})
    with pytest.raises(LinkError, match=r"^node 1: a fault would kill its program, which runs elsewhere$"):
        LockStep(world, link).run()


def test_a_fault_changes_no_random_numbers_of_other_links_and_robots() -> None:
    lossy = {"models": [{"kind": "loss", "fraction": 0.5}, {"kind": "delay", "jitter_s": 0.3}]}
    without = Life(faulty(radio=lossy))
    cut = {"kind": "cut", "senders": [0], "receivers": [3], "at_s": 0.3, "until_s": 0.9}
    noise = {"kind": "sensor_noise", "sensor": "bearings", "robots": [0], "sd": 0.1, "at_s": 0.0}
    seeing = {"sensors": [{"kind": "bearings", "sd_rad": 0.1}]}
    with_cut = Life(faulty(cut, noise, radio=lossy, robots=seeing))
    for receiver in range(4):
        for sender in range(4):
            if (sender, receiver) not in ((0, 3), (receiver, receiver)):
                assert without.received(receiver, sender) == with_cut.received(receiver, sender)
    assert without.received(3, 0) != with_cut.received(3, 0)


# --- random robots and times ----------------------------------------------------------------------------------------


def struck(seed: int, *more: dict[str, Any]) -> list[tuple[int, list[int]]]:
    """Return for each fault the tick at which it began and the nodes that it struck."""
    world = Life(faulty({"kind": "crash", "fraction": 0.5, "between_s": [0.5, 1.5]}, *more), seed).world
    return [(each.begins or 0, getattr(each.fault, "nodes", [])) for each in world.schedule.faults]


def test_a_crash_can_strike_a_random_fraction_of_the_running_robots_at_a_random_time() -> None:
    found = [struck(seed)[0] for seed in range(12)]
    assert len({tick for tick, _ in found}) > 4, "ticks differ from seed to seed"
    assert all(5 <= tick <= 15 and len(nodes) == 2 for tick, nodes in found)
    assert {node for _, nodes in found for node in nodes} == {0, 1, 2, 3}
    assert struck(1) == struck(1)


def test_a_random_crash_strikes_running_robots_only_and_no_other_fault_changes_its_choice() -> None:
    pause = {"kind": "pause", "nodes": [0], "at_s": 0.0}
    assert struck(1, pause)[0] == struck(1)[0]
    for seed in range(12):
        (_, nodes), (_, dead) = struck(seed, {"kind": "crash", "nodes": [2, 3], "at_s": 0.2})
        assert dead == [2, 3]
        assert len(nodes) == 1, "half of the two that are left"
        assert nodes[0] in (0, 1)


@pytest.mark.parametrize(("fraction", "most"), [(1.0, 40), (0.001, 1)])
def test_a_random_crash_strikes_one_robot_at_least_and_no_base_station(fraction: float, most: int) -> None:
    fault = f"faults=[{{kind='crash', fraction={fraction}, between_s=[40.0, 60.0]}}]"
    nodes = run("sensor-coverage", 1, "inline", [*HALL, fault, "time.duration_s=70"]).as_json()["nodes"]["crashed"]
    assert 1 <= len(nodes) <= most
    assert (len(nodes) > 1) == (most > 1)
    assert 0 not in nodes


@pytest.mark.parametrize("wider", [False, True])
def test_a_new_optional_key_of_a_kind_of_fault_changes_no_random_number(
    monkeypatch: pytest.MonkeyPatch, wider: bool
) -> None:
    noise = {"kind": "sensor_noise", "sensor": "bearings", "sd": 0.1, "at_s": 0.0}
    seeing = {"sensors": [{"kind": "bearings"}]}

    def drawn_now(**more: Any) -> tuple[list[tuple[int, list[int]]], str]:
        return struck(1), Life(faulty(noise | more, robots=seeing)).world.trace.hex()

    before = drawn_now()

    class WiderCrash(CrashTable):
        depth_m: float | None = None

    class WiderNoise(SensorNoiseTable):
        depth_m: float = 3.0 if wider else 2.0

    monkeypatch.setattr(Crash, "Parameters", WiderCrash)
    monkeypatch.setattr(SensorNoise, "Parameters", WiderNoise)
    assert drawn_now() == before
    # The table as written in the scenario is the key of the draws: the default value, if written, is another fault.
    assert drawn_now(depth_m=WiderNoise.model_fields["depth_m"].default)[1] != before[1]


def test_the_kind_of_a_fault_keys_its_random_numbers_and_the_order_of_its_keys_does_not() -> None:
    noise = {"kind": "sensor_noise", "sensor": "bearings", "sd": 1.0, "at_s": 0.0}
    seeing = {"sensors": [{"kind": "bearings"}]}
    turned = dict(reversed(noise.items())) | {"sd": 1, "at_s": 0}
    traces = [Life(faulty(each, robots=seeing)).world.trace.hex() for each in (noise, turned)]
    assert traces[0] == traces[1]
    out = [{"kind": kind, "robots": [0], "at_s": 0.0} for kind in ("dead_beacon", "camera_blackout")]
    purposes = [each.purpose for each in assemble(faulty(*out, robots=seeing), 1).schedule.faults]
    assert len(set(purposes)) == 2
    assert all(purpose.startswith("faults/1/") for purpose in purposes), "each is the first of its kind"


# --- random schedules -----------------------------------------------------------------------------------------------

RATES = {
    f"{kind}_per_h": 4_000.0
    for kind in ("crash", "pause", "slow", "partition", "jam", "blackout", "cut", "camera_blackout", "dead_beacon")
} | {"stuck_touch_per_h": 4_000.0, "mean_s": 0.5}
SENSES = {"sensors": [{"kind": "bearings"}, {"kind": "touch"}, {"kind": "line_of_sight"}]}


def drawn(run_seed: int = 1, **rates: Any) -> list[dict[str, Any]]:
    chosen = faulty(random_faults=RATES | rates, robots=SENSES)
    return [table.model_dump() for table in assemble(chosen, run_seed).schedule.tables]


def test_a_random_schedule_has_its_rates_is_sorted_and_can_be_run_as_written() -> None:
    found = drawn()
    assert [fault["at_s"] for fault in found] == sorted(fault["at_s"] for fault in found)
    # 10 kinds x 4000 / h x 2 s: 22 expected a seed, Poisson.
    chosen = faulty(random_faults=RATES, robots=SENSES)
    arena = assemble(chosen, 1).scene.arena
    schedules = [random_faults(chosen, seed, arena) for seed in range(300)]
    assert len({fault.kind for schedule in schedules for fault in schedule}) == 10
    counts = [len(schedule) for schedule in schedules]
    assert abs(np.mean(counts) - 22.2) < 2.576 * np.sqrt(22.2 / 300)
    again = Life(faulty(*found, robots=SENSES))
    random = Life(faulty(random_faults=RATES, robots=SENSES))
    assert again.world.trace.hex() == random.world.trace.hex()


def test_a_random_schedule_depends_on_its_seed_and_no_kind_on_another() -> None:
    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)
    assert drawn(1, seed=7) == drawn(2, seed=7)
    fewer = [fault for fault in drawn(1) if fault["kind"] != "jam"]
    assert drawn(1, jam_per_h=0.0) == fewer


@pytest.mark.parametrize("touch", [{"switches": 4}, {}, {"switches": 12}])
def test_random_stuck_switches_are_drawn_among_those_that_the_sensor_has(touch: dict[str, int]) -> None:
    robots = {"sensors": [{"kind": "touch", **touch}]}
    chosen = faulty(random_faults={"stuck_touch_per_h": 4_000.0}, robots=robots)
    arena = assemble(faulty(robots=robots), 1).scene.arena
    tables = [table for seed in range(100) for table in random_faults(chosen, seed, arena)]
    # About 220 faults: the chance that one switch of 12 is never drawn is below 1e-7.
    assert {table.parameters["switch"] for table in tables} == set(range(touch.get("switches", 8)))
    for seed in range(10):
        assemble(chosen, seed)


def test_a_rate_of_random_faults_that_cannot_occur_is_a_mistake() -> None:
    chosen = scenario(random_faults={"jam_per_h": 1.0, "stuck_touch_per_h": 2.0})
    with pytest.raises(ScenarioError) as caught:
        assemble(chosen, 1)
    assert caught.value.mistakes == [
        "small.toml: random_faults.jam_per_h: the scenario has no radio, got 1",
        "small.toml: random_faults.stuck_touch_per_h: the robots have no touch sensor, got 2",
    ]


# --- mistakes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ({"kind": "explode", "at_s": 0}, f"faults.0.kind: expected a built-in fault ({', '.join(FAULTS)}) or module:Class, "
         "got 'explode'"),
        ({"kind": "crash", "nodes": [9], "at_s": 0}, "faults.0.nodes.0: no such robot: ids are 0 to 3, got 9"),
        ({"kind": "crash", "nodes": [-1], "at_s": 0}, "faults.0.nodes.0: no such robot: ids are 0 to 3, got -1"),
        ({"kind": "crash", "nodes": ["coordinator"], "at_s": 0}, "faults.0.nodes.0: the scenario has no coordinator"),
        ({"kind": "crash", "nodes": [], "at_s": 0}, "faults.0.nodes: expected 1 items at least, got []"),
        ({"kind": "crash", "nodes": [1], "at_s": 99}, "faults.0.at_s: the run ends after 2 s, got 99"),
        ({"kind": "crash", "nodes": [1], "at_s": 2}, "faults.0.at_s: the run ends after 2 s, got 2"),
        ({"kind": "crash", "nodes": [1], "at_s": 1, "until_s": 5}, "faults.0.until_s: the run ends after 2 s, got 5"),
        ({"kind": "crash", "nodes": [1], "at_s": 1, "until_s": 0.5},
         "faults.0.until_s: expected later than it begins, got 0.5"),
        ({"kind": "crash", "nodes": [1], "at_s": 1, "until_s": 1.5, "for_s": 1},
         "faults.0: expected for_s or until_s, not both"),
        ({"kind": "crash", "nodes": [1]}, "faults.0: expected one of at_s, between_s and when"),
        ({"kind": "crash", "nodes": [1], "at_s": 1, "between_s": [0, 1]},
         "faults.0: expected one of at_s, between_s and when"),
        ({"kind": "crash", "nodes": [1], "between_s": [1.5, 0.5]},
         "faults.0.between_s: expected [first, last] before the end at 2 s, got [1.5, 0.5]"),
        ({"kind": "crash", "nodes": [1], "between_s": [0.5, 1.5], "until_s": 1},
         "faults.0.until_s: expected later than it begins, got 1"),
        ({"kind": "crash", "at_s": 1}, "faults.0: expected either nodes or fraction"),
        ({"kind": "heal", "at_s": 1, "for_s": 1}, "faults.0: happens at once: no for_s and no until_s"),
        ({"kind": "slow", "nodes": [1], "at_s": 1, "every_ticks": 1}, "faults.0.every_ticks: expected >= 2, got 1"),
        ({"kind": "pause", "nodes": [1], "when": {}}, "faults.0.when: expected either metric and at_least, or robot_deployed"),
        ({"kind": "pause", "nodes": [1], "when": {"robot_deployed": 7}},
         "faults.0.when.robot_deployed: no such robot: ids are 0 to 3, got 7"),
        ({"kind": "pause", "nodes": [1], "when": {"metric": "cell_coverage_fraction", "at_least": 0.5}},
         "faults.0.when.metric: needs metrics.cells, got 'cell_coverage_fraction'"),
        ({"kind": "partition", "groups": [[0, 1], [1, 2]], "at_s": 0}, "faults.0.groups: 1 is named twice"),
        ({"kind": "partition", "groups": [[0, 8]], "at_s": 0}, "faults.0.groups.0.1: no such robot: ids are 0 to 3, got 8"),
        ({"kind": "jam", "at_s": 0}, "faults.0: expected either center_m and radius_m, or rectangle_m"),
        ({"kind": "blackout", "channel": "uplink", "at_s": 0},
         "faults.0.channel: the scenario has no coordinator to lead to, got 'uplink'"),
        ({"kind": "sensor_noise", "sensor": "bearings", "at_s": 0}, "faults.0.sensor: the robots have touch, got 'bearings'"),
        ({"kind": "sensor_noise", "sensor": "touch", "sd": 1.0, "at_s": 0},
         "faults.0.sensor: touch has no numbers that sd and bias could change"),
        ({"kind": "stuck_touch", "robots": [0], "switch": 8, "closed": True, "at_s": 0},
         "faults.0.switch: there are 8, numbered from 0, got 8"),
        ({"kind": "dead_beacon", "robots": [4], "at_s": 0}, "faults.0.robots.0: no such robot: ids are 0 to 3, got 4"),
    ],
)  # fmt: skip
def test_a_fault_aimed_at_a_robot_or_time_that_does_not_exist_is_an_error_that_names_it(
    fault: dict[str, Any], line: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        assemble(faulty(fault, robots={"sensors": [{"kind": "touch"}]}), 1)
    assert caught.value.mistakes == [f"small.toml: {line}"]


def test_every_mistake_in_a_schedule_is_reported_at_once() -> None:
    with pytest.raises(ScenarioError) as caught:
        assemble(faulty({"kind": "crash", "nodes": [7, 8], "at_s": 9.0}, {"kind": "cut", "at_s": 0}), 1)
    assert caught.value.mistakes == [
        "small.toml: faults.0.at_s: the run ends after 2 s, got 9",
        "small.toml: faults.0.nodes.0: no such robot: ids are 0 to 3, got 7",
        "small.toml: faults.0.nodes.1: no such robot: ids are 0 to 3, got 8",
        "small.toml: faults.1.senders: required, and missing",
        "small.toml: faults.1.receivers: required, and missing",
    ]


def test_a_radio_fault_without_a_radio_is_a_mistake() -> None:
    with pytest.raises(ScenarioError) as caught:
        assemble(scenario(faults=[{"kind": "blackout", "at_s": 0}]), 1)
    assert caught.value.mistakes == ["small.toml: faults.0: the scenario has no radio to disturb"]


def test_the_result_names_the_robots_that_crashed_and_returned() -> None:
    crashes = [
        {"kind": "crash", "nodes": [2], "at_s": 0.5},
        {"kind": "restart", "nodes": [1], "at_s": 0.5},
    ]
    result = run(faulty(*crashes), 1, "inline").as_json()
    assert result["outcome"] == "time-limit", "a scheduled crash fails no run"
    assert result["nodes"]["crashed"] == [1, 2]
    assert result["nodes"]["restarted"] == [1]
