"""A coordinator whose uplink loses, repeats and delays: no command is carried out twice, and no robot is counted twice."""

from collections.abc import Callable

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.messages.commands import (
    Ack,
    Answer,
    Arrived,
    Deploy,
    Emerged,
    Release,
    Released,
    Report,
    Request,
    Response,
    RobotCommand,
    RollCall,
    ScanRequest,
    Sighting,
    read_request,
    write,
)
from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, decode_snapshot
from zwerm.agents.sensor_coverage.protocols.transport.deduplication import COPIES_MAX, RequestDeduplicator
from zwerm.coordinator.sensor_coverage.command_mailbox import RECOVERY_COPIES, ROLL_CALL_COPIES, CommandMailbox
from zwerm.coordinator.sensor_coverage.coordinator import SensorCoverageCoordinator
from zwerm.coordinator.sensor_coverage.retry_policy import BURST_TRIES, RetryPolicy
from zwerm.deploy.node_specs import node_specs, restart_spec
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble_run
from zwerm.run.measurement import measure
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Packet
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.world import World

# The times of these tests are those of a deployment by the paper's rules.
PAPER = 'coordinator.parameters.walls="paper"'
HALL = ("arena.size_m=[2.2,1.7]", "base.pose=[0.2,0.8,0.0]", "robots.count=18", PAPER)
AHEAD = Deploy(1, 0.0, 0.95, 0.8)
DONE = Arrived(1, True, False, False, 0.95, ())
BURSTS = 'uplink.models=[{kind="gilbert_elliott", loss_fraction=0.3, burst_packets=16.0}]'
MANGLED = (
    'uplink.models=[{kind="delay", delay_s=0.2, jitter_s=0.3}, {kind="duplication", fraction=0.3}, '
    '{kind="corruption", bit_error_rate=0.002}]'
)


# --- a robot ----------------------------------------------------------------------------------------------------------


class OneRobot:
    """A robot's end of the command protocol."""

    def __init__(self, incarnation: int) -> None:
        self.began: list[RobotCommand] = []
        self.commands = RequestDeduplicator(incarnation, self.began.append)

    def takes(self, request: Request) -> RobotCommand | None:
        """Give the robot a request; return the command that it begins."""
        self.began.clear()
        self.commands.receive(9, request, 0)
        return self.began[0] if self.began else None

    def says(self, *new: Answer) -> list[Answer]:
        """Return the answers that the robot sends in a tick in which it has these new ones."""
        for each in new:
            self.commands.answer(each)
        return [each.message.answer for each in self.commands.outgoing()]


def test_a_repeated_command_is_not_carried_out_again_but_answered_again() -> None:
    robot = OneRobot(7)
    assert robot.takes(Request(1, 4, 1, 0, AHEAD)) == AHEAD
    assert robot.says() == []
    assert robot.takes(Request(1, 4, 2, 0, AHEAD)) is None
    assert robot.says() == [Ack()], "it is being carried out"
    assert robot.says(DONE) == [DONE]
    for attempt in (3, 4):
        assert robot.takes(Request(1, 4, attempt, 0, AHEAD)) is None
        assert robot.says() == [DONE]
    assert robot.says() == []


def test_a_command_is_identified_by_its_number_and_not_by_its_content() -> None:
    robot = OneRobot(7)
    assert robot.takes(Request(1, 4, 1, 0, AHEAD)) == AHEAD
    assert robot.takes(Request(1, 5, 1, 0, AHEAD)) == AHEAD
    assert robot.takes(Request(1, 4, 2, 0, AHEAD)) is None, "it is late"
    assert robot.says() == [], "a late command needs no answer"
    assert robot.takes(Request(2, 1, 1, 0, AHEAD)) == AHEAD, "another coordinator counts anew"


def test_a_restarted_robot_ignores_commands_to_its_earlier_incarnation_and_reports_that_it_is_new() -> None:
    robot = OneRobot(8)
    assert robot.says(Emerged(())) == [Emerged(())]
    assert robot.takes(Request(1, 4, 9, 7, AHEAD)) is None
    assert robot.says() == [Emerged(())]


@pytest.mark.parametrize(("attempt", "copies"), [(1, 1), (2, 2), (50, COPIES_MAX)])
def test_an_answer_has_more_copies_the_more_copies_of_its_command_were_lost(attempt: int, copies: int) -> None:
    robot = OneRobot(7)
    robot.takes(Request(1, 4, attempt, 0, AHEAD))
    assert robot.says(DONE) == [DONE] * copies


# --- the coordinator --------------------------------------------------------------------------------------------------


class Desk:
    """A command mailbox, and the packets that it receives and sends."""

    def __init__(self) -> None:
        self.mailbox = CommandMailbox(0.1, incarnation=3)
        self.tick = 0

    def turn(self, *replies: tuple[int, Response]) -> list[tuple[int | None, int, int]]:
        """Let a tick pass; return (receiver, number, attempt) of what is sent."""
        self.tick += 1
        self.mailbox.receive(0.1 * self.tick, [Packet("uplink", write(each), sender) for sender, each in replies])
        found = []
        for each in self.mailbox.outgoing():
            dispatch = read_request(each.payload)
            assert dispatch is not None
            found.append((each.to, dispatch.number, dispatch.attempt))
        return found

    def say(self, node: int, order: RobotCommand) -> None:
        self.mailbox.send(node, order)
        assert self.turn() == [(node, self.mailbox._number[node], 1)]


def answered(number: int, answer: Answer, attempt: int = 1, heard: int = 1, incarnation: int = 5) -> Response:
    return Response(incarnation, 3, number, attempt, heard, answer)


REPORT = Report(1, (), ())


def test_the_coordinator_reads_an_answer_once_and_an_old_answer_never() -> None:
    desk = Desk()
    desk.say(9, ScanRequest(1, ()))
    old = answered(1, REPORT)
    desk.turn((9, old), (9, old))
    assert desk.mailbox.take_unread() == [(9, REPORT)]
    desk.say(9, ScanRequest(2, ()))
    desk.turn((9, old))
    assert desk.mailbox.take_unread() == []
    assert desk.mailbox.waits_for(9)


def test_the_coordinator_ignores_answers_to_its_earlier_incarnation() -> None:
    desk = Desk()
    desk.say(9, ScanRequest(1, ()))
    desk.turn((9, Response(5, 2, 1, 1, 1, REPORT)))
    assert desk.mailbox.take_unread() == []


def test_the_coordinator_reads_one_first_report_of_each_incarnation_of_a_robot() -> None:
    desk = Desk()
    came = [Response(incarnation, 0, 0, 0, 0, Emerged(())) for incarnation in (5, 5, 6, 6)]
    for each in came:
        desk.turn((9, each))
    assert desk.mailbox.take_unread() == [(9, Emerged(()))] * 2


def test_without_losses_a_command_is_repeated_only_when_overdue_and_after_the_first_loss_every_round_trip() -> None:
    desk = Desk()
    desk.say(9, ScanRequest(1, ()))
    assert [desk.turn() for _ in range(18)] == [[]] * 18
    assert desk.turn() == [(9, 1, 2)]
    desk.turn((9, answered(1, REPORT, attempt=2, heard=1)))
    desk.say(9, ScanRequest(2, ()))
    assert [desk.turn() for _ in range(4)] == [[(9, 2, 2)], [], [(9, 2, 3)], []]


def after_roll_call() -> Desk:
    """Return the mailbox of a restarted coordinator, one tick after its roll call, with one station."""
    desk = Desk()
    desk.mailbox.roll_call(RollCall(1), ROLL_CALL_COPIES)
    desk.mailbox.expect(0)
    assert desk.turn() == [(None, 0, attempt) for attempt in range(1, ROLL_CALL_COPIES + 1)]
    return desk


SEES_4 = Report(1, (Sighting(4, 0.0),), ())


def test_after_a_roll_call_visible_robots_are_asked_at_once_and_in_copies_if_messages_were_lost() -> None:
    desk = after_roll_call()
    asked = desk.turn((9, answered(0, SEES_4, attempt=ROLL_CALL_COPIES, heard=5)))
    assert asked == [(node, 0, ROLL_CALL_COPIES + copy) for node in (0, 4) for copy in (1, 2, 3)]
    assert desk.turn((0, answered(0, REPORT, heard=1)), (4, answered(0, REPORT, heard=1))) == []
    desk.mailbox.send(9, AHEAD, drive=True)
    assert desk.turn() == [(9, 1, attempt) for attempt in range(1, 2 * RECOVERY_COPIES + 1)]
    assert desk.turn((9, answered(1, Ack(), attempt=6, heard=2))) == []
    desk.say(4, AHEAD)  # once: the recovery burst has ended


def test_without_losses_commands_after_a_roll_call_have_no_copies() -> None:
    desk = after_roll_call()
    every = answered(0, SEES_4, attempt=ROLL_CALL_COPIES, heard=ROLL_CALL_COPIES)
    assert desk.turn(*((node, every) for node in (9, 0, 4))) == []
    desk.say(9, AHEAD)
    assert [desk.turn() for _ in range(18)] == [[]] * 18


def test_a_roll_call_is_repeated_if_a_robot_missed_it_before_any_robot_could_report() -> None:
    again = [(None, 0, ROLL_CALL_COPIES + copy) for copy in range(1, ROLL_CALL_COPIES + 1)]
    some = answered(0, Ack(), attempt=ROLL_CALL_COPIES, heard=5)
    for heard in ([], [(9, some)], [(0, some)]):
        desk = after_roll_call()
        assert desk.turn(*heard) == again
        assert desk.turn() == [], "once"
    later = desk.turn((0, answered(0, SEES_4, attempt=2 * ROLL_CALL_COPIES, heard=9)))
    assert later == [(4, 0, 2 * ROLL_CALL_COPIES + copy) for copy in (1, 2, 3)]


def test_an_acknowledged_roll_call_is_not_answered_yet() -> None:
    desk = after_roll_call()
    heard = [(node, answered(0, Ack(), attempt=ROLL_CALL_COPIES, heard=ROLL_CALL_COPIES)) for node in (0, 9)]
    assert desk.turn(*heard) == []
    assert desk.mailbox.take_unread() == []
    assert desk.mailbox.waits_for(9)
    desk.turn((9, answered(0, REPORT, attempt=ROLL_CALL_COPIES, heard=ROLL_CALL_COPIES)))
    assert desk.mailbox.take_unread() == [(9, REPORT)]


def test_a_robot_that_acknowledges_a_drive_is_asked_less_often() -> None:
    desk = Desk()
    desk.mailbox.retry_policy.update(2, 1)
    desk.mailbox.send(9, AHEAD, drive=True)
    sent = [len(desk.turn(*([(9, answered(1, Ack()))] if tick % 4 == 0 else []))) for tick in range(40)]
    assert sum(sent) == 1, "as long as it says so"


def test_all_copies_of_a_release_have_one_number_and_its_answer_is_read_once() -> None:
    desk = Desk()
    desk.mailbox.retry_policy.update(2, 1)
    desk.say(0, Release(1))
    numbers = {number for _ in range(100) for _, number, _ in desk.turn()}
    assert numbers == {1}
    desk.turn((0, answered(1, Released(4))), (0, answered(1, Released(4))))
    assert desk.mailbox.take_unread() == [(0, Released(4))]


@pytest.mark.parametrize(("lost", "least", "most"), [(0, 0, 0), (50, BURST_TRIES, 260), (90, 1200, 1600)])
def test_a_silent_robot_counts_as_dead_only_when_losses_cannot_explain_its_silence(
    lost: int, least: int, most: int
) -> None:
    retry_policy = RetryPolicy()
    for _ in range(2000):
        retry_policy.update(100, 100 - lost)
    assert least <= retry_policy.tries_max <= most


# --- the whole swarm --------------------------------------------------------------------------------------------------


def drive(scenario: Scenario) -> tuple[str, World, SensorCoverageCoordinator, dict[str, float]]:
    """Run inline, and return how it ended, the world, and the last incarnation of the coordinator."""
    world, observers = assemble_run(scenario, 1)
    observers.subscribe(world.telemetry)
    nodes = {node: Node(*each) for node, each in node_specs(scenario, 1).items()}

    def again(node: int, incarnation: int) -> Callable[[bytes], bytes]:
        nodes[node] = Node(*restart_spec(scenario, 1, node, incarnation))
        return nodes[node].answer

    link = MemoryLink({node: each.answer for node, each in nodes.items()}, again)
    outcome = LockStep(world, link, programs=link).run()
    coordinator = nodes[scenario.robots.count]._controller
    assert isinstance(coordinator, SensorCoverageCoordinator)
    return outcome, world, coordinator, measure(world, observers)


@pytest.mark.parametrize("air", ["uplink.loss=0.1", "uplink.loss=0.5", "uplink.loss=0.8", BURSTS, MANGLED])
def test_no_robot_is_lost_or_counted_twice_on_a_lossy_uplink(air: str) -> None:
    scenario = load("sensor-coverage", (*HALL, air))
    outcome, world, coordinator, found = drive(scenario)
    placed = [robot for robot in coordinator.slots.occupant.values() if robot]
    waiting = list(coordinator.sources.waiting.values())
    out = [robot for robot in world.scene.present_ids().tolist() if robot]
    assert outcome == "completed"
    assert found["coverage_fraction"] >= 0.98
    assert sorted([*placed, *waiting, *coordinator.pushing.lost]) == out, "everybody has one place"
    assert found["robots_released"] == len(out)
    assert sorted(coordinator.sources.out) == out


def test_losses_on_the_uplink_are_the_same_inline_and_in_processes() -> None:
    settings = ["arena.size_m=[2.0,1.4]", "base.pose=[0.2,0.7,0.0]", "robots.count=10", "uplink.loss=0.5"]
    inline, processes = (run("sensor-coverage", runner=each, overrides=settings) for each in ("inline", "processes"))
    other = run("sensor-coverage", seed=2, runner="inline", overrides=settings)
    assert inline.outcome == processes.outcome == "completed"
    assert inline.trace == processes.trace != other.trace


# --- the coordinator dies ---------------------------------------------------------------------------------------------


def crash(at_s: float, more: str = "") -> str:
    return f'faults=[{{kind="crash", at_s={at_s}, nodes=["coordinator"]{more}}}]'


@pytest.mark.parametrize("at_s", [0.5, 23.7, 41.2])
def test_the_base_ends_the_run_when_the_coordinator_is_gone_for_good(at_s: float) -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, crash(at_s)])
    assert result.outcome == "failed"
    assert result.reason == "node 0 gave up: coordinator-lost: no message from the coordinator for 120 s"
    assert at_s + 90.0 < result.sim_s < at_s + 123.0


@pytest.mark.parametrize("at_s", [0.5, 8.0])
def test_the_coordinator_waits_for_a_base_that_is_out_of_reach_for_20_s_before_any_loss(at_s: float) -> None:
    fault = f"faults=[{{kind='partition', groups=[[0]], at_s={at_s}, for_s=20.0}}]"
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, fault])
    assert result.outcome == "completed", result.reason
    assert result.metrics["coverage_fraction"] > 0.99


def test_the_robots_wait_for_a_coordinator_that_is_away_for_300_s() -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, crash(20.0, ", for_s=300.0")])
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.99


def resumed(result: RunResult, from_s: float) -> None:
    """Check that the restarted coordinator knows all robots within two seconds, and completes the run."""
    anew = next(each for each in result.snapshots if each.time_s >= from_s)
    complex_ = decode_snapshot(anew.snapshot)
    assert isinstance(complex_, ComplexSnapshot)
    assert anew.time_s <= from_s + 2.0
    assert complex_.cycle == 1, "it remembers nothing"
    assert complex_.paths, "and somebody is about to go"
    seen = len({node for each in complex_.edges for node in each})
    assert anew.present.sum() - 1 <= seen <= anew.present.sum() > 3, "all but one who waits at the base"
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.99
    assert result.metrics["robots_released"] == result.metrics["robots_deployed"] - 1
    lives = [
        [decode_snapshot(each.snapshot) for each in result.snapshots if (each.time_s < from_s) == old]
        for old in (True, False)
    ]
    assert result.metrics["deployment_cycles"] == sum(
        life[-1].cycle for life in lives if isinstance(life[-1], ComplexSnapshot)
    )


NOISE = "robots.sensors.0.sd_rad=0.0436332"


@pytest.mark.parametrize(
    ("at_s", "more"),
    [
        (27.3, ()),
        (33.3, ()),
        (47.5, (NOISE,)),
        (27.3, ("uplink.loss=0.5",)),
        (33.3, ("uplink.loss=0.5",)),
        (58.4, ("uplink.loss=0.5", NOISE)),
    ],
)
def test_a_coordinator_that_begins_anew_goes_on_within_two_seconds(at_s: float, more: tuple[str, ...]) -> None:
    resumed(run("sensor-coverage", runner="inline", overrides=[*HALL, *more, crash(at_s, ", for_s=3.0")]), at_s + 3.0)


def test_a_coordinator_that_restarts_in_its_own_process_asks_the_robots_by_radio() -> None:
    inline, processes = (
        run("sensor-coverage", runner=each, overrides=[*HALL, crash(35.0, ", for_s=3.0")])
        for each in ("inline", "processes")
    )
    resumed(processes, 38.0)
    assert processes.trace == inline.trace
