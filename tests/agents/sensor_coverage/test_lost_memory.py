"""Robots that die, restart, or have another clock: every robot is accounted for, and `completed` is true."""

import math
from collections.abc import Callable

import msgspec
import numpy as np
import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.frontier.plan import Plan
from zwerm.agents.sensor_coverage.local_node import CODECS
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, NOWHERE, StateBeacon, StateRequest
from zwerm.agents.sensor_coverage.messages.commands import LOST, SHUT, STRETCH, Sighting, Waypoint
from zwerm.agents.sensor_coverage.messages.incarnations import ADOPTED, adopted_slot, first_count
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL, read_envelope, write
from zwerm.agents.sensor_coverage.messages.pushes import PushAborted
from zwerm.agents.sensor_coverage.messages.robot_sets import from_bytes, members, robot_set, to_bytes
from zwerm.agents.sensor_coverage.motion.odometry_frame import Touched
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import IDLE_LEGS_MAX, WalkResult
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing
from zwerm.agents.sensor_coverage.protocols.component_loop import ComponentLoop
from zwerm.agents.sensor_coverage.protocols.ending.release_roster import ReleaseRoster
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.deploy.node_specs import node_specs
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble_run
from zwerm.run.measurement import measure
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.wire.messages import Command, Observation, Packet
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.world import World

# Walks along walls take most of the time of a run. Where a test is about other parts, the paper's rules hold.
PAPER = ('robots.parameters.walls="paper"', 'base.parameters.walls="paper"')
TINY = ("arena.size_m=[1.8,1.2]", "base.pose=[0.2,0.6,0.0]", "robots.count=14", "services.path=gradient")
HALL = ("arena.size_m=[2.2,1.7]", "base.pose=[0.2,0.8,0.0]", "robots.count=18", "services.path=gradient", *PAPER)
SMALL = ("arena.size_m=[2.6,2.0]", "base.pose=[0.2,1.0,0.0]", "robots.count=30", "services.path=gradient")
DT_S = 0.1
LONG = "time.duration_s=3000.0"


def with_faults(hall: tuple[str, ...], faults: str, seed: int = 1, *more: str) -> RunResult:
    return run("sensor-coverage", seed=seed, runner="inline", overrides=[*hall, LONG, f"faults=[{faults}]", *more])


def is_covered(result: RunResult) -> bool:
    found = result.metrics
    return (
        result.outcome == "completed"
        and found["reachable_coverage_fraction"] >= 0.98
        and found["concluded_early"] == 0.0
    )


# --- envelopes ------------------------------------------------------------------------------------------------------


class Recorder(Component):
    """Keeps what it receives, and the robots that have restarted."""

    channel = CHANNEL
    accepts = (StateRequest,)

    def __init__(self) -> None:
        self.events: list[object] = []
        self.out: list[Outgoing] = []

    def receive(self, sender: int, message: object, tick: int) -> None:
        self.events.append((sender, message))

    def restarted(self, node: int, tick: int) -> None:
        self.events.append(node)

    def outgoing(self) -> list[Outgoing]:
        sent, self.out = self.out, []
        return sent


def test_a_message_of_a_former_incarnation_is_dropped_and_the_first_of_a_new_one_is_announced() -> None:
    recorder = Recorder()
    loop = ComponentLoop((recorder,), CODECS, incarnation=3)
    asks = [StateRequest((each,)) for each in range(6)]
    for message, sender, receiver in ((0, 1, 0), (1, 2, 3), (2, 1, 0), (3, 2, 2), (4, 2, 3), (5, 3, 0)):
        loop.deliver([Packet(CHANNEL, write(asks[message], sender, receiver), 7)], 1)
    assert recorder.events == [(7, asks[0]), 7, (7, asks[1]), (7, asks[4]), 7, (7, asks[5])]


def test_a_message_names_the_incarnations_of_its_sender_and_of_its_only_receiver() -> None:
    recorder = Recorder()
    loop = ComponentLoop((recorder,), CODECS, incarnation=3)
    loop.deliver([Packet(CHANNEL, write(StateRequest(()), 5), 7)], 1)
    recorder.out = [Outgoing(to, StateRequest(())) for to in (None, 7, 8)]
    sent = [read_envelope(each.payload) for each in loop.outbox()]
    assert [(each.sender, each.receiver) for each in sent if each is not None] == [(3, 0), (3, 5), (3, 0)]


def test_counts_of_later_incarnations_are_greater_and_names_of_slots_are_unique() -> None:
    assert [first_count(each) for each in (1, 2)] == [0, 1 << 24]
    ways = [(incarnation, returns) for incarnation in (1, 2, 3, 250) for returns in (0, 1, 15)]
    names = [adopted_slot(node, *each) for node in (1, 2, 99_999) for each in ways]
    assert len(set(names)) == len(names)
    assert min(names) >= ADOPTED > first_count(2**31)
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(max(names))) == max(names)


def test_a_set_of_robots_survives_the_wire() -> None:
    for robots in ((), (0,), (3, 9, 64), (7, 999)):
        assert members(from_bytes(to_bytes(robot_set(robots)))) == robots
    assert to_bytes(robot_set((7, 999, 7))) == to_bytes(robot_set((7,)) | robot_set((999,)))


# --- who stands at the base -----------------------------------------------------------------------------------------


def state(slot: int = NOWHERE, moving: bool = False, waiting: bool = False) -> StateBeacon:
    return StateBeacon(1, slot, 3, moving, waiting, 1, (), (), (), NO_PATH_VECTOR)


def test_the_guests_of_the_base_are_robots_that_never_left() -> None:
    roster = ReleaseRoster(first_incarnation=True)
    roster.see([1, 2, 3])
    roster.receive(1, state(slot=4))
    roster.receive(2, state(moving=True))
    roster.receive(3, state(waiting=True))
    roster.see([1, 2, 3])
    for node in (1, 2):
        roster.receive(node, state())  # after a restart
    assert roster.guests == (3,)
    assert list(roster.known) == [1, 2, 3]


def test_a_base_that_has_restarted_knows_only_guests_that_report_their_wait() -> None:
    roster = ReleaseRoster(first_incarnation=False)
    roster.see([1, 2, 3])
    roster.receive(1, state(slot=4))
    roster.receive(2, state())
    roster.receive(3, state(waiting=True))
    assert roster.guests == (3,)


# --- restarts -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("robot", "at_s"), [(3, 20.0), (3, 45.0), (5, 80.0), (1, 10.0), (2, 60.0)])
def test_a_robot_that_crashes_and_restarts_is_taken_in_again(robot: int, at_s: float) -> None:
    result = with_faults(SMALL, f'{{kind="crash", nodes=[{robot}], at_s={at_s}, for_s=5.0}}', 1, *PAPER)
    assert is_covered(result)
    assert result.metrics["robots_deployed"] <= 12, "it is of use where it stands"


def test_robots_that_rest_too_near_each_other_do_not_push_each_other_away_for_ever() -> None:
    """In this run two robots come to rest 12 mm nearer to each other than their bodies allow."""
    assert is_covered(with_faults(SMALL, '{kind="crash", nodes=[7], at_s=86.7, for_s=49.4}', 3))


def phases(hall: tuple[str, ...]) -> dict[str, tuple[int, int]]:
    """Return, for every state that a robot has in a hall, the first (tick, robot) for which it has it."""
    scenario = load("sensor-coverage", hall)
    world, _ = assemble_run(scenario, 1)
    nodes = {node: Node(*each) for node, each in node_specs(scenario, 1).items()}
    found: dict[str, tuple[int, int]] = {}

    def watch(world: World) -> None:
        for node in world.scene.present_ids().tolist():
            robot = nodes[node]._controller
            if isinstance(robot, LocalRobot):
                found.setdefault(state_of(robot), (world.tick, node))

    LockStep(world, MemoryLink({node: each.answer for node, each in nodes.items()}), [watch]).run()
    return found


def state_of(robot: LocalRobot) -> str:
    situation = robot.situation
    if robot.push is not None:
        return robot.push.phase
    if situation.waiting:
        return "waiting"
    if situation.local_map.heading is None:
        return "without heading"
    if not situation.mailbox.empty:
        return "unacknowledged"
    if not situation.calm:
        return "not calm"
    return "claims" if situation.claims else "stands"


def test_a_robot_that_restarts_in_any_state_is_taken_in_again() -> None:
    tiny = (*TINY, *PAPER)
    states = {name: (HALL, *place) for name, place in phases(HALL).items()}
    states |= {
        name: (tiny, *place) for name, place in phases(tiny).items()
    }  # the shorter run where it has the state too
    assert {"waiting", "link", "offering", "deploying", "out", "armed", "following", "telling", "claims"} <= set(states)
    wrong = {}
    for name, (hall, tick, robot) in states.items():
        result = with_faults(hall, f'{{kind="restart", nodes=[{robot}], at_s={tick * DT_S:.1f}}}')
        if not is_covered(result):
            wrong[name] = tick, robot, result.outcome, result.reason, result.metrics["reachable_coverage_fraction"]
    assert not wrong


@pytest.mark.parametrize("at_s", [15.0, 40.0])
def test_the_base_that_restarts_goes_on(at_s: float) -> None:
    assert is_covered(with_faults(TINY, f'{{kind="restart", nodes=["base"], at_s={at_s}}}', 1, *PAPER))


@pytest.mark.parametrize("at_s", [15.0, 40.0])
def test_the_base_that_restarts_goes_on_where_walls_are_followed(at_s: float) -> None:
    assert is_covered(with_faults(TINY, f'{{kind="restart", nodes=["base"], at_s={at_s}}}'))


# --- deaths ---------------------------------------------------------------------------------------------------------


def test_robots_that_die_are_replaced_and_do_not_keep_the_run_from_ending() -> None:
    result = with_faults(SMALL, '{kind="crash", nodes=[2, 5], at_s=55.0}', 1, *PAPER)
    assert is_covered(result)


@pytest.mark.parametrize("at_s", [34.0, 46.0])
def test_a_body_in_a_passage_is_pushed_to_its_end(at_s: float) -> None:
    """The first robot of a single file dies, and no other robot gets past its body: none follows the wall behind it."""
    passage = ("arena.size_m=[4.4,0.22]", "base.pose=[0.2,0.11,0.0]", "robots.count=10", "services.path=gradient")
    assert is_covered(with_faults(passage, f'{{kind="crash", nodes=[1], at_s={at_s}}}', 1, *PAPER))


def pushing(visible: dict[int, float], dead: tuple[int, ...]) -> tuple[LocalRobot, TokenPush]:
    """Return robot 3 at slot 8, which sees others at these bearings [rad], and its part in push 7 from the base."""
    robot = Node(*node_specs(load("sensor-coverage", TINY), 1)[3])._controller
    assert isinstance(robot, LocalRobot)
    robot.situation.motion.frame.seen = visible
    robot.situation.failure_detector.dead = dict.fromkeys(dead)
    robot.local_map.occupy(8)
    robot.pushing._join(7, 7, ((8, 3),), 0)
    assert robot.push is not None
    return robot, robot.push


@pytest.mark.parametrize(
    ("bearing_deg", "dead", "walls", "hides"),
    [
        (0.0, (5,), (), None),
        (50.0, (5,), (), None),
        (-75.0, (5,), (), 5),
        (120.0, (5,), (), None),
        (0.0, (), (), 5),
        (0.0, (5,), (0.3,), None),
        (0.0, (4, 5, 6), (), None),
        (0.0, (4, 5, 6, 9), (), 5),
    ],
    ids=["ahead", "obliquely ahead", "beside", "behind", "alive", "and a wall", "three in a row", "four in a row"],
)
def test_a_dead_body_ahead_that_does_not_yield_stands_at_a_wall(
    bearing_deg: float, dead: tuple[int, ...], walls: tuple[float, ...], hides: int | None
) -> None:
    bearing = math.radians(bearing_deg)
    robot, _ = pushing({4: 0.1, 5: bearing, 6: -0.1, 9: 0.2}, dead)
    stopped = DriveResult(False, driven_m=0.1, touched=walls, robots=(Touched(bearing, 5),))
    assert robot.situation.body_in_the_way(stopped, 0.0) == hides


@pytest.mark.parametrize("end", [LOST, STRETCH, SHUT])
def test_a_robot_knows_how_far_it_is_from_others_after_a_walk(end: str) -> None:
    """It is less than a hop. The robot may be the next to follow another one, from the place where its walk ended."""
    robot, push = pushing({5: 0.0}, ())
    robot.local_map.receive(5, StateBeacon(1, 4, 2, False, False, 1, (), (), (), NO_PATH_VECTOR), 1)
    way = [(0.0, 0.02 * step) for step in range(11)]
    points = [Waypoint(x, y, (Sighting(5, math.atan2(-y, 0.3 - x)),), (math.pi,), ()) for x, y in way]
    push._idle_legs = IDLE_LEGS_MAX
    push._walked(WalkResult(end, 0.2, tuple(points)))
    assert robot.local_map.distances_m == pytest.approx({4: math.hypot(0.3, 0.2)})


def test_a_push_ends_when_the_robot_that_has_the_token_dies() -> None:
    for dead, waited, ended in (((), 500, False), ((5,), 50, False), ((5,), 101, True), ((), 1001, True)):
        robot, push = pushing({0: 0.0, 5: 1.0}, dead)
        push.next = 5
        robot.situation.tick = waited
        assert push.next_wake() > waited
        push.poll()
        assert (push.phase == "closing") is ended
        assert push.end == (PushAborted(7, False) if ended else None)


def test_what_the_body_of_a_robot_stopped_is_tried_again_when_it_is_dead() -> None:
    robot, _ = pushing({5: 0.0}, ())
    local_map = robot.local_map
    gap, side = Plan((8, 5, 0, 1), 8, 1.0, 0.95, 0.9, (8,)), Plan((5, 8, 1), 8, 2.0, 0.95, 0.8, (8,))
    wall = Plan((8, 9, 1), 8, 3.0, 0.95, 0.8, (8,))
    log = local_map._planner.attempt_log
    for plan in (gap, wall):
        local_map.note_failure(plan, 0.5)
    local_map.remove_dead(4)
    assert list(log.closed) == [wall.key], "the gap has another shape"
    local_map.note_obstruction(side, 0.5, 5)
    local_map.remove_dead(4)
    assert list(log.closed) == [wall.key, side.key]
    local_map.remove_dead(5)
    assert not log.closed
    assert not local_map._bodies.stopped


def test_a_swarm_in_a_corridor_that_a_death_has_parted_is_joined_again() -> None:
    corridor = ("arena.size_m=[4.0,0.5]", "base.pose=[0.2,0.25,0.0]", "robots.count=12", "services.path=gradient")
    assert is_covered(with_faults(corridor, '{kind="crash", nodes=[3], at_s=60.0}', 1, *PAPER))


def test_the_base_waits_for_robots_out_of_its_reach() -> None:
    """The base receives nothing for four minutes; the others have not changed then."""
    result = with_faults(SMALL, '{kind="partition", groups=[[0]], at_s=30.0, for_s=240.0}', 3)
    assert is_covered(result)
    assert result.sim_s > 270.0


def test_a_robot_that_is_off_the_point_of_a_silent_base_takes_a_slot() -> None:
    """It did not know its heading when it stopped there, and does not see the robots that the base sees."""
    medium = ("arena.size_m=[4.4,3.6]", "base.pose=[0.2,1.8,0.0]", "robots.count=60", "services.path=gradient")
    assert is_covered(with_faults(medium, '{kind="partition", groups=[[0]], at_s=22.2, for_s=240.0}', 805))


def test_a_base_that_receives_no_message_any_more_does_not_complete() -> None:
    result = with_faults(HALL, '{kind="partition", groups=[[0]], at_s=30.0}', 1, "time.duration_s=900.0")
    assert result.outcome == "failed" or is_covered(result)


# --- clocks ---------------------------------------------------------------------------------------------------------


def run_with_clocks(offset_ticks: Callable[[int], int]) -> tuple[str, int, dict[str, float]]:
    """Run with clocks that differ by a constant; return the outcome, the last tick, and the metrics."""
    scenario = load("sensor-coverage", (*TINY, *PAPER))
    world, observers = assemble_run(scenario, 1)
    observers.subscribe(world.telemetry)
    nodes = {node: Node(*each) for node, each in node_specs(scenario, 1).items()}
    for number, node in nodes.items():
        node.answer = node._answering(shifted(node._controller.step, offset_ticks(number)))
    outcome = LockStep(world, MemoryLink({node: each.answer for node, each in nodes.items()})).run()
    return outcome, world.tick, measure(world, observers)


def shifted(step: Callable[[Observation], Command], offset: int) -> Callable[[Observation], Command]:
    """Return the step of a node whose clock is ahead by `offset` ticks."""

    def shift(observation: Observation) -> Command:
        tick = observation.tick + offset
        command = step(msgspec.structs.replace(observation, tick=tick, time_s=tick * DT_S))
        if command.wake is not None and command.wake.at_s is not None:
            at_s = (round(command.wake.at_s / DT_S) - offset) * DT_S
            command.wake = msgspec.structs.replace(command.wake, at_s=at_s)
        return command

    return shift


def test_constant_offsets_of_the_robots_clocks_change_nothing() -> None:
    random = np.random.Generator(np.random.Philox(1))
    offsets = random.integers(0, 100_000, size=20).tolist()  # up to 10,000 s
    plain = run_with_clocks(lambda _: 0)
    ahead = run_with_clocks(lambda node: offsets[node])
    assert plain[0] == ahead[0] == "completed"
    assert plain[1] == ahead[1]
    assert plain[2]["reachable_coverage_fraction"] == ahead[2]["reachable_coverage_fraction"] >= 0.99
