"""A coordinator of sensor coverage whose uplink loses, repeats and delays: nothing is done twice, and nobody counted twice."""

from collections.abc import Callable
from typing import Any

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.messages.commands import (
    Ack,
    Answer,
    Arrived,
    Deploy,
    Emerged,
    Order,
    Release,
    Released,
    Report,
    Request,
    Response,
    RollCall,
    ScanRequest,
    Sighting,
    read_dispatch,
    read_reply,
    write,
)
from zwerm.agents.sensor_coverage.protocols.deduplication import COPIES_MAX, RequestDeduplicator
from zwerm.coordinator.sensor_coverage.command_mailbox import HASTE_COPIES, MUSTER_COPIES, CommandMailbox
from zwerm.coordinator.sensor_coverage.coordinator import SensorCoverageCoordinator
from zwerm.coordinator.sensor_coverage.retry_policy import BURST_TRIES, RetryPolicy
from zwerm.deploy.node_specs import node_specs, restart_spec
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Packet
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.metrics.measures import measure
from zwerm.world.world import World

HALL = ("arena.size_m=[2.2,1.7]", "base.pose=[0.2,0.8,0.0]", "robots.count=18")
AHEAD = Deploy(1, 0.0, 0.95, 0.8)
DONE = Arrived(1, True, False, False, 0.95, ())
BURSTS = 'uplink.models=[{kind="bursts", loss_fraction=0.3, burst_packets=16.0}]'
MANGLED = (
    'uplink.models=[{kind="delay", delay_s=0.2, jitter_s=0.3}, {kind="duplication", fraction=0.3}, '
    '{kind="corruption", bit_error_rate=0.002}]'
)


# --- a robot ----------------------------------------------------------------------------------------------------------


def said(payloads: list[bytes]) -> list[Answer]:
    replies = [read_reply(each) for each in payloads]
    return [each.answer for each in replies if each is not None]


def test_an_order_that_comes_again_is_not_carried_out_again_but_answered_again() -> None:
    duty = RequestDeduplicator(7)
    assert duty.take(write(Request(1, 4, 1, 0, AHEAD))) == AHEAD
    assert said(duty.say([])) == []
    assert duty.take(write(Request(1, 4, 2, 0, AHEAD))) is None
    assert said(duty.say([])) == [Ack()], "it is on its way"
    assert said(duty.say([DONE])) == [DONE]
    for attempt in (3, 4):
        assert duty.take(write(Request(1, 4, attempt, 0, AHEAD))) is None
        assert said(duty.say([])) == [DONE]
    assert said(duty.say([])) == []


def test_an_order_is_known_by_its_number_and_not_by_what_it_says() -> None:
    duty = RequestDeduplicator(7)
    assert duty.take(write(Request(1, 4, 1, 0, AHEAD))) == AHEAD
    assert duty.take(write(Request(1, 5, 1, 0, AHEAD))) == AHEAD
    assert duty.take(write(Request(1, 4, 2, 0, AHEAD))) is None, "it was late"
    assert said(duty.say([])) == [], "and wants no answer any more"
    assert duty.take(write(Request(2, 1, 1, 0, AHEAD))) == AHEAD, "another coordinator counts anew"


def test_who_begins_anew_does_not_do_what_its_former_life_was_told_but_says_that_it_is_new() -> None:
    duty = RequestDeduplicator(8)
    assert said(duty.say([Emerged(())])) == [Emerged(())]
    assert duty.take(write(Request(1, 4, 9, 7, AHEAD))) is None
    assert said(duty.say([])) == [Emerged(())]


@pytest.mark.parametrize(("attempt", "copies"), [(1, 1), (2, 2), (50, COPIES_MAX)])
def test_the_more_often_an_order_was_missed_the_more_copies_its_answer_has(attempt: int, copies: int) -> None:
    duty = RequestDeduplicator(7)
    duty.take(write(Request(1, 4, attempt, 0, AHEAD)))
    assert said(duty.say([DONE])) == [DONE] * copies


# --- the coordinator --------------------------------------------------------------------------------------------------


class Desk:
    """A post, and what comes and goes."""

    def __init__(self) -> None:
        self.post = CommandMailbox(0.1, life=3)
        self.tick = 0

    def turn(self, *replies: tuple[int, Response]) -> list[tuple[int | None, int, int]]:
        """Let a tick pass; return (receiver, number, attempt) of what is sent."""
        self.tick += 1
        self.post.take(0.1 * self.tick, [Packet("uplink", write(each), sender) for sender, each in replies])
        found = []
        for each in self.post.sent():
            dispatch = read_dispatch(each.payload)
            assert dispatch is not None
            found.append((each.to, dispatch.number, dispatch.attempt))
        return found

    def say(self, node: int, order: Order) -> None:
        self.post.say(node, order)
        assert self.turn() == [(node, self.post._number[node], 1)]


def answered(number: int, answer: Answer, attempt: int = 1, heard: int = 1, life: int = 5) -> Response:
    return Response(life, 3, number, attempt, heard, answer)


REPORT = Report(1, (), ())


def test_an_answer_is_read_once_and_an_old_one_never() -> None:
    desk = Desk()
    desk.say(9, ScanRequest(1, ()))
    old = answered(1, REPORT)
    desk.turn((9, old), (9, old))
    assert desk.post.rest() == [(9, REPORT)]
    desk.say(9, ScanRequest(2, ()))
    desk.turn((9, old))
    assert desk.post.rest() == []
    assert desk.post.waits_for(9)


def test_an_answer_to_a_coordinator_that_is_no_more_is_not_read() -> None:
    desk = Desk()
    desk.say(9, ScanRequest(1, ()))
    desk.turn((9, Response(5, 2, 1, 1, 1, REPORT)))
    assert desk.post.rest() == []


def test_a_robot_comes_out_once_in_each_life() -> None:
    desk = Desk()
    came = [Response(life, 0, 0, 0, 0, Emerged(())) for life in (5, 5, 6, 6)]
    for each in came:
        desk.turn((9, each))
    assert desk.post.rest() == [(9, Emerged(()))] * 2


def test_without_a_loss_an_order_is_said_once_until_it_is_overdue_and_after_the_first_loss_again_and_again() -> None:
    desk = Desk()
    desk.say(9, ScanRequest(1, ()))
    assert [desk.turn() for _ in range(18)] == [[]] * 18
    assert desk.turn() == [(9, 1, 2)]
    desk.turn((9, answered(1, REPORT, attempt=2, heard=1)))
    desk.say(9, ScanRequest(2, ()))
    assert [desk.turn() for _ in range(4)] == [[(9, 2, 2)], [], [(9, 2, 3)], []]


def mustered() -> Desk:
    """Return the desk of a coordinator that has begun anew, a tick after its muster, with one station."""
    desk = Desk()
    desk.post.muster(RollCall(1), MUSTER_COPIES)
    desk.post.expect(0)
    assert desk.turn() == [(None, 0, attempt) for attempt in range(1, MUSTER_COPIES + 1)]
    return desk


SEES_4 = Report(1, (Sighting(4, 0.0),), ())


def test_after_a_muster_whoever_is_seen_is_asked_at_once_and_in_copies_where_something_was_lost() -> None:
    desk = mustered()
    asked = desk.turn((9, answered(0, SEES_4, attempt=MUSTER_COPIES, heard=5)))
    assert asked == [(node, 0, MUSTER_COPIES + copy) for node in (0, 4) for copy in (1, 2, 3)]
    assert desk.turn((0, answered(0, REPORT, heard=1)), (4, answered(0, REPORT, heard=1))) == []
    desk.post.say(9, AHEAD, drive=True)
    assert desk.turn() == [(9, 1, attempt) for attempt in range(1, 2 * HASTE_COPIES + 1)]
    assert desk.turn((9, answered(1, Ack(), attempt=6, heard=2))) == []
    desk.say(4, AHEAD)  # once: there is no haste any more


def test_where_nothing_is_lost_no_order_after_a_muster_has_copies() -> None:
    desk = mustered()
    every = answered(0, SEES_4, attempt=MUSTER_COPIES, heard=MUSTER_COPIES)
    assert desk.turn(*((node, every) for node in (9, 0, 4))) == []
    desk.say(9, AHEAD)
    assert [desk.turn() for _ in range(18)] == [[]] * 18


def test_a_muster_is_called_again_where_somebody_missed_it_and_nobody_had_time_to_look() -> None:
    again = [(None, 0, MUSTER_COPIES + copy) for copy in range(1, MUSTER_COPIES + 1)]
    some = answered(0, Ack(), attempt=MUSTER_COPIES, heard=5)
    for heard in ([], [(9, some)], [(0, some)]):
        desk = mustered()
        assert desk.turn(*heard) == again
        assert desk.turn() == [], "once"
    later = desk.turn((0, answered(0, SEES_4, attempt=2 * MUSTER_COPIES, heard=9)))
    assert later == [(4, 0, 2 * MUSTER_COPIES + copy) for copy in (1, 2, 3)]


def test_to_have_heard_a_muster_is_no_answer_to_it() -> None:
    desk = mustered()
    heard = [(node, answered(0, Ack(), attempt=MUSTER_COPIES, heard=MUSTER_COPIES)) for node in (0, 9)]
    assert desk.turn(*heard) == []
    assert desk.post.rest() == []
    assert desk.post.waits_for(9)
    desk.turn((9, answered(0, REPORT, attempt=MUSTER_COPIES, heard=MUSTER_COPIES)))
    assert desk.post.rest() == [(9, REPORT)]


def test_who_is_on_the_way_is_asked_less_often() -> None:
    desk = Desk()
    desk.post.patience.note(2, 1)
    desk.post.say(9, AHEAD, drive=True)
    sent = [len(desk.turn(*([(9, answered(1, Ack()))] if tick % 4 == 0 else []))) for tick in range(40)]
    assert sum(sent) == 1, "as long as it says so"


def test_a_release_is_one_order_however_often_it_is_said() -> None:
    desk = Desk()
    desk.post.patience.note(2, 1)
    desk.say(0, Release(1))
    numbers = {number for _ in range(100) for _, number, _ in desk.turn()}
    assert numbers == {1}
    desk.turn((0, answered(1, Released(4))), (0, answered(1, Released(4))))
    assert desk.post.rest() == [(0, Released(4))]


@pytest.mark.parametrize(("lost", "least", "most"), [(0, 0, 0), (50, BURST_TRIES, 260), (90, 1200, 1600)])
def test_the_dead_are_waited_for_as_long_as_losses_may_explain_their_silence(lost: int, least: int, most: int) -> None:
    patience = RetryPolicy()
    for _ in range(2000):
        patience.note(100, 100 - lost)
    assert least <= patience.tries_max <= most


# --- the whole swarm --------------------------------------------------------------------------------------------------


def drive(scenario: Scenario) -> tuple[str, World, SensorCoverageCoordinator]:
    """Run inline, and return how it ended, the world, and the coordinator in its last life."""
    world = assemble(scenario, 1)
    nodes = {node: Node(*each) for node, each in node_specs(scenario, 1).items()}

    def again(node: int, incarnation: int) -> Callable[[bytes], bytes]:
        nodes[node] = Node(*restart_spec(scenario, 1, node, incarnation))
        return nodes[node].answer

    link = MemoryLink({node: each.answer for node, each in nodes.items()}, again)
    outcome = LockStep(world, link, programs=link).run()
    coordinator = nodes[world.count]._controller
    assert isinstance(coordinator, SensorCoverageCoordinator)
    return outcome, world, coordinator


@pytest.mark.parametrize("air", ["uplink.loss=0.1", "uplink.loss=0.5", "uplink.loss=0.8", BURSTS, MANGLED])
def test_nobody_is_lost_or_counted_twice_whatever_the_uplink_does(air: str) -> None:
    scenario = load("sensor-coverage", (*HALL, air))
    outcome, world, coordinator = drive(scenario)
    found: dict[str, Any] = measure(world, scenario.metrics)
    placed = [robot for robot in coordinator.places.occupant.values() if robot]
    waiting = list(coordinator.sources.waiting.values())
    out = [robot for robot in world.scene.present_ids().tolist() if robot]
    assert outcome == "completed"
    assert found["coverage_fraction"] >= 0.98
    assert sorted([*placed, *waiting, *coordinator.pushing.lost]) == out, "everybody has one place"
    assert found["robots_released"] == len(out)
    assert sorted(coordinator.sources.out) == out


def test_what_the_uplink_does_is_the_same_in_processes() -> None:
    settings = ["arena.size_m=[2.0,1.4]", "base.pose=[0.2,0.7,0.0]", "robots.count=10", "uplink.loss=0.5"]
    inline, processes = (run("sensor-coverage", runner=each, overrides=settings) for each in ("inline", "processes"))
    other = run("sensor-coverage", seed=2, runner="inline", overrides=settings)
    assert inline.outcome == processes.outcome == "completed"
    assert inline.trace == processes.trace != other.trace


# --- the coordinator dies ---------------------------------------------------------------------------------------------


def crash(at_s: float, more: str = "") -> str:
    return f'faults=[{{kind="crash", at_s={at_s}, nodes=["coordinator"]{more}}}]'


@pytest.mark.parametrize("at_s", [0.5, 23.7, 41.2])
def test_a_coordinator_that_is_gone_for_good_ends_the_run_and_the_base_says_why(at_s: float) -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, crash(at_s)])
    assert result.outcome == "failed"
    assert result.reason == "node 0 gave up: coordinator-lost: not a word from the coordinator for 120 s"
    assert at_s + 90.0 < result.sim_s < at_s + 123.0


@pytest.mark.parametrize("at_s", [0.5, 8.0])
def test_a_base_that_is_out_of_reach_for_twenty_seconds_before_anything_was_lost_is_waited_for(at_s: float) -> None:
    fault = f"faults=[{{kind='partition', groups=[[0]], at_s={at_s}, for_s=20.0}}]"
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, fault])
    assert result.outcome == "completed", result.reason
    assert result.metrics["coverage_fraction"] > 0.99


def test_a_coordinator_that_is_away_for_long_is_waited_for() -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, crash(20.0, ", for_s=300.0")])
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.99


def resumed(result: RunResult, from_s: float) -> None:
    """Check that the coordinator, begun anew, has everybody again within two seconds, and goes on to the end."""
    anew = next(each for each in result.told if each.time_s >= from_s and "complex" in each.told)
    complex_ = anew.told["complex"]
    assert anew.time_s <= from_s + 2.0
    assert complex_["cycle"] == 1, "it remembers nothing"
    assert complex_["paths"], "and somebody is about to go"
    seen = len({node for each in complex_["edges"] for node in each})
    assert anew.present.sum() - 1 <= seen <= anew.present.sum() > 3, "all but one who waits at the base"
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.99
    assert result.metrics["robots_released"] == result.metrics["robots_deployed"] - 1
    lives = [
        [each for each in result.told if "complex" in each.told and (each.time_s < from_s) == old]
        for old in (True, False)
    ]
    assert result.metrics["deployment_cycles"] == sum(life[-1].told["complex"]["cycle"] for life in lives)


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


def test_a_coordinator_that_begins_anew_in_a_process_of_its_own_asks_the_robots_by_radio() -> None:
    inline, processes = (
        run("sensor-coverage", runner=each, overrides=[*HALL, crash(35.0, ", for_s=3.0")])
        for each in ("inline", "processes")
    )
    resumed(processes, 38.0)
    assert processes.trace == inline.trace
