"""Complete runs of sensor coverage without a coordinator in a small hall: the end, the deciding node, and no lost robot."""

import math
from statistics import fmean

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.local_node import MAKERS
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, NOWHERE, StateBeacon
from zwerm.agents.sensor_coverage.messages.peers import read, write
from zwerm.agents.sensor_coverage.messages.pushes import PushDone, PushToken, Segment, SegmentAck
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.component_loop import ComponentLoop
from zwerm.agents.sensor_coverage.protocols.transport.mailbox import TRIES_MAX, ReliableMailbox
from zwerm.deploy.node_specs import node_specs
from zwerm.errors import ScenarioError
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble_run
from zwerm.run.measurement import measure
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.world import World

HALL = ("arena.size_m=[2.2,1.7]", "base.pose=[0.2,0.8,0.0]", "robots.count=18")
ALONE = (*HALL, "services.path=gradient")
# Rules of the paper where a test is not about walls, because walks along walls take most of the time of a run. The counts of
# pushes and robots are the paper's too: a robot that has followed a wall is pushed again.
PAPER = ('robots.parameters.walls="paper"', 'base.parameters.walls="paper"')
NOISE = "robots.sensors.0.sd_rad=0.0436332"


def drive(scenario: Scenario) -> tuple[str, World, list[LocalRobot], dict[str, float]]:
    """Run inline, and return how it ended, the world, and the robots that are out.

    At no tick may two robots that are not part of a push have the same place, or a robot that is out be gone.
    """
    world, observers = assemble_run(scenario, 1)
    observers.subscribe(world.telemetry)
    nodes = {node: Node(*each) for node, each in node_specs(scenario, 1).items()}
    seen: dict[int, None] = {}

    def out() -> list[LocalRobot]:
        there = [nodes[robot]._controller for robot in world.scene.present_ids().tolist() if robot]
        return [each for each in there if isinstance(each, LocalRobot)]

    def watch(world: World) -> None:
        robots = out()
        seen.update(dict.fromkeys(each.node for each in robots))
        assert len(seen) == len(robots), "nobody that was let out is lost"
        held = [each.local_map.slot for each in robots if each.push is None and each.local_map.slot != NOWHERE]
        assert len(held) == len(set(held)), f"tick {world.tick}: each has a place of its own, but {sorted(held)}"

    driver = LockStep(world, MemoryLink({node: each.answer for node, each in nodes.items()}), [watch])
    return driver.run(), world, out(), measure(world, observers)


# --- segments and acknowledgements --------------------------------------------------------------------------------------


def test_a_corrupt_message_is_ignored() -> None:
    payload = write(Segment(1, PushDone(7)))
    assert read(payload) == Segment(1, PushDone(7))
    for position in range(len(payload)):
        damaged = bytearray(payload)
        damaged[position] ^= 4
        assert read(bytes(damaged)) is None
    assert read(payload[:-1]) is None


@pytest.mark.parametrize("lost", [0.0, 0.5, 0.9])
def test_segments_arrive_once_and_in_order_at_any_loss(lost: float) -> None:
    import random

    luck = random.Random(3)
    here, there = ReliableMailbox(), ReliableMailbox()
    for number in range(20):
        here.write(2, PushToken(number, 0, (), 0))
    told: list[int] = []
    for tick in range(12_000):
        here.poll(tick)
        for _, segment in here.outgoing():
            assert isinstance(segment, Segment)
            if luck.random() >= lost:
                body = there.accept(1, segment)
                told += [] if body is None else [body.push]
                if luck.random() >= lost:
                    here.receive(2, SegmentAck(segment.number), tick)
    assert told == sorted(set(told))
    assert {body.push for _, body in here.sent} <= set(told)
    assert len(here.sent) + len(here.lost) == 20
    assert lost > 0.5 or told == list(range(20))


def test_a_segment_without_acknowledgement_is_given_up() -> None:
    mailbox = ReliableMailbox()
    mailbox.write(2, PushDone(1))
    tries = 0
    for tick in range(10 * TRIES_MAX):
        mailbox.poll(tick)
        tries += len(mailbox.outgoing())
    assert tries == TRIES_MAX
    assert mailbox.lost == [(2, PushDone(1))]


# --- the whole swarm ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "seeds"), [((), (1,)), ((NOISE,), (1, 2, 3))])
def test_decentralised_robots_cover_a_small_hall_about_as_well_as_under_a_coordinator(
    noise: tuple[str, ...], seeds: tuple[int, ...]
) -> None:
    cycles = 0.0
    for seed in seeds:
        central = run("sensor-coverage", seed=seed, runner="inline", overrides=[*HALL, *noise])
        alone = run("sensor-coverage", seed=seed, runner="inline", overrides=[*ALONE, *PAPER, *noise])
        assert alone.outcome == central.outcome == "completed"
        assert alone.metrics["coverage_fraction"] >= 0.99
        assert alone.metrics["robots_deployed"] <= central.metrics["robots_deployed"] + 2
        assert "uplink" not in alone.radio["channels"], "there is no coordinator"
        cycles += alone.metrics["deployment_cycles"] - 1.3 * central.metrics["deployment_cycles"]
    assert cycles <= 0.0


def test_followed_walls_take_few_robots_more_without_a_coordinator() -> None:
    """Robots that have left the complex after their walks come back into it: nobody there knows their places."""
    more = []
    for seed in range(1, 5):
        central = run("sensor-coverage", seed=seed, runner="inline", overrides=HALL)
        alone = run("sensor-coverage", seed=seed, runner="inline", overrides=ALONE)
        assert alone.outcome == central.outcome == "completed"
        assert alone.metrics["reachable_coverage_fraction"] >= 0.99
        more.append(alone.metrics["robots_deployed"] - central.metrics["robots_deployed"])
    assert fmean(more) <= 2.0


@pytest.mark.parametrize(
    "air",
    [
        (),
        ("radio.loss=0.5",),
        ('radio.models=[{kind="gilbert_elliott", loss_fraction=0.3, burst_packets=16.0}]',),
        ('radio.models=[{kind="delay", delay_s=0.3, jitter_s=0.3}, {kind="duplication", fraction=0.3}]',),
    ],
)
def test_no_robot_is_lost_or_counted_twice_on_a_lossy_radio(air: tuple[str, ...]) -> None:
    scenario = load("sensor-coverage", (*ALONE, *PAPER, *air))
    outcome, _world, robots, found = drive(scenario)
    slots = [robot.local_map.slot for robot in robots if not robot.situation.waiting]
    assert outcome == "completed"
    assert found["coverage_fraction"] >= 0.98
    assert found["concluded_early"] == 0.0
    assert len(slots) == len(set(slots)) >= len(robots) - 1, "each holds a place of its own, but for one at the base"
    assert found["robots_released"] == len(robots) == found["pushes"] + len(robots) - len(slots)


def test_a_crash_of_the_coordinator_changes_nothing_in_a_run_without_one() -> None:
    kill = 'faults=[{kind="crash", at_s=10.0, nodes=["coordinator"]}]'
    settings = [*ALONE, "time.duration_s=30.0"]
    alone, killed = (run("sensor-coverage", runner="inline", overrides=[*settings, *each]) for each in ((), (kill,)))
    other = run("sensor-coverage", seed=2, runner="inline", overrides=[*settings, NOISE])
    assert alone.trace == killed.trace != other.trace
    assert alone.metrics["robots_deployed"] > 2


def test_decentralised_robots_leave_the_same_trace_inline_and_in_processes() -> None:
    settings = ["arena.size_m=[2.0,1.4]", "base.pose=[0.2,0.7,0.0]", "robots.count=10", "services.path=gradient"]
    runs = (run("sensor-coverage", runner=each, overrides=[*settings, *PAPER]) for each in ("inline", "processes"))
    inline, processes = runs
    assert inline.outcome == processes.outcome == "completed"
    assert inline.trace == processes.trace


def test_a_robot_that_hears_nothing_new_does_what_it_would_have_done_in_full(monkeypatch: pytest.MonkeyPatch) -> None:
    lossy = load("sensor-coverage", (*ALONE, "radio.loss=0.3"))
    shortened = 0
    is_idle = ComponentLoop.is_idle

    def counted(loop: ComponentLoop, tick: int) -> bool:
        nonlocal shortened
        idle = is_idle(loop, tick)
        shortened += idle
        return idle

    monkeypatch.setattr(ComponentLoop, "is_idle", counted)
    trace = run(lossy, 1, "inline").trace
    assert shortened > 100
    monkeypatch.setattr(ComponentLoop, "is_idle", lambda *_: False)
    assert run(lossy, 1, "inline").trace == trace
    assert run(lossy, 2, "inline").trace != trace


def test_the_decentralised_base_reports_an_empty_depot() -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*ALONE, "robots.count=4"])
    assert result.outcome == "failed"
    assert "depot-dry: the depot is empty" in result.reason


# --- places ---------------------------------------------------------------------------------------------------------


def at(slot: int) -> StateBeacon:
    return StateBeacon(1, slot, 3, False, False, 1, (), (), (), NO_PATH_VECTOR)


@pytest.mark.parametrize(
    ("sender", "slot", "name"),
    [(8, 4, 17), (8, 3, 4), (9, 4, 4)],
    ids=["the follower took its place", "the follower stayed", "somebody else was there before"],
)
def test_a_leader_that_stays_occupies_the_new_slot_if_its_follower_came_after_all(
    sender: int, slot: int, name: int
) -> None:
    leader = LocalMap(7, PlannerParameters(), MAKERS)
    leader.occupy(4)
    leader.abandon_push(17, 8)
    leader.resolve_duplicate()
    assert leader.slot == 4
    leader.receive(sender, at(slot), 10)
    leader.resolve_duplicate()
    assert leader.slot == name


@pytest.mark.parametrize(("samples", "epoch"), [(0, -1), (1, 2)], ids=["has just driven", "stood"])
def test_a_bearing_of_a_robot_that_may_have_been_on_its_way_belongs_to_no_drive(samples: int, epoch: int) -> None:
    """A robot comes into sight during a drive. Its neighbour has not received that it moves, and averages its bearing."""
    watcher = LocalMap(7, PlannerParameters(), MAKERS)
    watcher.update_bearings({9: 0.5})
    arrived = StateBeacon(1, 3, 2, False, False, samples, (), (), (), NO_PATH_VECTOR)
    assert watcher.receive(9, arrived, 10) is (samples == 0)
    assert watcher.seen[9].epoch == epoch


@pytest.mark.parametrize(
    ("slot", "drives", "waits"),
    [
        pytest.param(4, False, True, id="a slot in sight passes to another robot"),
        pytest.param(4, True, False, id="the robot was heard before the watcher moved"),
        pytest.param(1, False, False, id="the watcher has taken the slot itself"),
    ],
)
def test_a_robot_waits_for_a_slot_that_passes_on_in_its_sight(slot: int, drives: bool, waits: bool) -> None:
    """Of a slot that it does not see it would never receive a message, and wait for nothing."""
    watcher = LocalMap(7, PlannerParameters(), MAKERS)
    watcher.occupy(1)
    watcher.receive(8, StateBeacon(1, slot, 3, False, False, 1, (), (), (), NO_PATH_VECTOR), 0)
    if drives:
        watcher.begin_drive()
        watcher.end_drive()
    watcher.update_bearings({8: 0.5})
    watcher.receive(8, StateBeacon(2, 5, 4, False, False, 1, (), (), (), NO_PATH_VECTOR), 1)
    assert (watcher.handovers_until is not None) is waits


def test_the_next_robot_at_a_slot_inherits_the_distances_that_a_walk_measured() -> None:
    first, second = (LocalMap(node, PlannerParameters(), MAKERS) for node in (7, 8))
    first.occupy(4)
    first.receive(9, at(3), 10)
    first.note_distances({9: 0.24, 10: 0.5})
    second.inherit(first.memory())
    assert second.distances_m == {3: 0.24}
    second.vacate()
    assert second.distances_m == {}


def test_a_wall_that_only_the_former_occupant_of_a_slot_touched_proves_nothing() -> None:
    """The new occupant stands a few centimetres beside it, and that may be in front of a door."""
    first, second = (LocalMap(node, PlannerParameters(walls="followed"), MAKERS) for node in (7, 8))
    first.heading = second.heading = 0.0
    first.occupy(5)
    first.update_walls((0.0,))
    first.update_proof()
    assert [round(math.degrees(each.width_rad)) for each in first.proof.open_arcs()] == [270]
    second.inherit(first.memory())
    second.update_proof()
    assert [round(math.degrees(each.width_rad)) for each in second.proof.open_arcs()] == [360]


# --- who provides what ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        (("services.path=mesh",), "services.path: expected 'coordinator' or 'gradient', got 'mesh'"),
        (("services.pathh=gradient",), "services.pathh"),
        (("services.path=gradient",), "services: path=gradient, redundancy=none needs 1 to 1 base stations, got 3"),
    ],
)
def test_an_invalid_choice_of_services_is_one_line(settings: tuple[str, ...], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load("sensor-coverage-multi-source" if settings == ("services.path=gradient",) else "sensor-coverage", settings)
    assert len(caught.value.mistakes) == 1
    assert line in caught.value.mistakes[0]


@pytest.mark.parametrize("path", ["coordinator", "gradient"])
@pytest.mark.parametrize("redundancy", ["coordinator", "link", "none"])
def test_every_combination_of_services_covers_a_small_hall(path: str, redundancy: str) -> None:
    small = ("arena.size_m=[1.8,1.2]", "base.pose=[0.2,0.6,0.0]", "robots.count=10")
    settings = [*small, *PAPER, f"services.path={path}", f"services.redundancy={redundancy}"]
    result = run("sensor-coverage", runner="inline", overrides=settings)
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.99


def test_a_state_beacon_has_no_field_in_metres() -> None:
    assert not any(name.endswith("_m") for name in StateBeacon.__struct_fields__)
