"""A coordinator that only advises robots that they are redundant: its part, the robots' part, and whole deployments."""

import math
import random
from collections.abc import Iterable

import numpy as np
import pytest

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.messages.advice import (
    CHANNEL,
    AdviceMessage,
    CollectReports,
    RedundantAdvice,
    ReportNoted,
    StandingReport,
    read,
    write,
)
from zwerm.agents.sensor_coverage.messages.locks import LockDenial, LockGrant
from zwerm.agents.sensor_coverage.messages.peers import PeerMessage
from zwerm.agents.sensor_coverage.protocols.advice_client import (
    ADVICE_TICKS,
    REPEAT_TICKS,
    SETTLED_TICKS,
    AdviceClient,
)
from zwerm.agents.sensor_coverage.protocols.component import Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.coordinator.sensor_coverage.redundancy_advisor import ASK_TICKS, QUIET_TICKS, RedundancyAdvisor
from zwerm.coordinator.sensor_coverage.redundancy_advisor import REPEAT_TICKS as REPEAT_AT_COORDINATOR
from zwerm.maths.simplicial import FlagComplex, betti
from zwerm.run.runner import run
from zwerm.wire.messages import Observation, Packet

DT_S = 0.1
BASE = 1
CENTRE = 99
Messages = list[tuple[int | None, AdviceMessage]]


def wheel(steps: tuple[int, ...] = (1, 2, 4, 5)) -> dict[int, StandingReport]:
    """A hub, and six around it that see those so many steps on, or all but the one opposite: all of these are at the fence."""
    around = {n: tuple(sorted(1 + (n - 1 + step) % 6 for step in steps)) for n in range(1, 7)}
    fenced = {n: tuple(sorted(1 + (n - 1 + d) % 6 for d in (1, 5))) for n in range(1, 7)}
    boundary_edges = {n: StandingReport(5, 10 + n, (0, *around[n]), fenced[n], True, False) for n in around}
    return {0: StandingReport(5, 10, tuple(around), (), True, True), **boundary_edges}


class Centre:
    """A coordinator and its messages."""

    def __init__(self) -> None:
        self.advisor = RedundancyAdvisor(Setup(CENTRE, "coordinator", DT_S, (), b"0" * 32, bases=(BASE,)))
        self.tick = -1

    def receive(self, received: Iterable[tuple[int, AdviceMessage]] = (), ticks: int = 1) -> Messages:
        """Return its messages after it received these, over a number of ticks."""
        inbox = tuple(Packet(CHANNEL, write(message), sender) for sender, message in received)
        sent: Messages = []
        for number in range(ticks):
            self.tick += 1
            observation = Observation(self.tick, self.tick * DT_S, inbox=() if number else inbox)
            for each in self.advisor.step(observation).outbox:
                message = read(each.payload)
                assert message is not None
                sent.append((each.to, message))
        return sent


def advised(sent: Messages) -> dict[int | None, RedundantAdvice]:
    return {to: message for to, message in sent if isinstance(message, RedundantAdvice)}


# --- received ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("message", [wheel()[1], ReportNoted(7), CollectReports(), RedundantAdvice(((1, 10), (2, 11)))])
def test_every_advice_message_survives_the_wire_and_a_corrupt_one_is_ignored(message: AdviceMessage) -> None:
    payload = write(message)
    assert read(payload) == message
    for slot in range(len(payload)):
        assert read(payload[:slot] + bytes([payload[slot] ^ 4]) + payload[slot + 1 :]) is None
    assert read(payload[:-1]) is None


# --- the coordinator ------------------------------------------------------------------------------------------------


def test_the_advisor_advises_the_hub_of_a_wheel_with_list_versions_and_no_other_robot() -> None:
    centre = Centre()
    sent = centre.receive(wheel().items())
    assert [to for to, message in sent if isinstance(message, ReportNoted)] == list(range(7))
    assert not advised(sent)
    assert advised(centre.receive(ticks=QUIET_TICKS)) == {0: RedundantAdvice(tuple((n, 10 + n) for n in range(1, 7)))}
    assert advised(centre.receive(ticks=REPEAT_AT_COORDINATOR)).keys() == {0}, "it may have got lost"


@pytest.mark.parametrize(
    ("node", "change"),
    [
        (0, {"willing": False}),
        (3, {"stands": False}),  # the hub still sees it
        (3, {"listed": (1, 2, 4, 5)}),  # one sees the other, and not the other way around
    ],
)
def test_the_advisor_advises_no_robot_that_is_unwilling_or_whose_neighbours_differ_from_its_view(
    node: int, change: dict[str, object]
) -> None:
    centre, received = Centre(), wheel()
    fields = {name: getattr(received[node], name) for name in received[node].__struct_fields__}
    received[node] = StandingReport(**fields | change)
    assert not advised(centre.receive(received.items(), ticks=1 + QUIET_TICKS))


def test_the_advisor_advises_no_robot_whose_departure_opens_a_hole() -> None:
    assert not advised(Centre().receive(wheel(steps=(1, 5)).items(), ticks=1 + QUIET_TICKS))


def test_the_advisor_advises_one_of_two_redundant_robots_that_see_each_other() -> None:
    twins = {n: each for n, each in wheel().items() if n}
    twins = {
        n: StandingReport(5, each.version, (0, *each.listed[1:], 7), each.fenced, True, False)
        for n, each in twins.items()
    }
    twins[0] = StandingReport(5, 10, (1, 2, 3, 4, 5, 6, 7), (), True, True)
    twins[7] = StandingReport(5, 17, (0, 1, 2, 3, 4, 5, 6), (), True, True)
    assert len(advised(Centre().receive(twins.items(), ticks=1 + QUIET_TICKS))) == 1


def test_the_advisor_ignores_a_late_older_report() -> None:
    centre, received = Centre(), wheel()
    centre.receive(received.items())
    new = StandingReport(6, 20, received[0].listed, (), True, False)
    assert centre.receive([(0, new)]) == [(0, ReportNoted(6))]
    assert centre.receive([(0, received[0]), (0, received[0])]) == [], "what is old needs not be noted again"
    assert centre.receive([(0, new)]) == [(0, ReportNoted(6))], "that may have got lost"
    assert not advised(centre.receive(ticks=QUIET_TICKS))


def test_a_restarted_advisor_asks_all_robots_and_then_visible_robots_without_a_report() -> None:
    centre, received = Centre(), wheel()
    assert centre.receive() == [(None, CollectReports())]
    assert centre.receive(ticks=ASK_TICKS) == [(BASE, CollectReports())]
    centre.receive([(BASE, received[BASE])])
    asked = centre.receive(ticks=ASK_TICKS)
    assert {to for to, message in asked if isinstance(message, CollectReports)} == set(received[BASE].listed)
    assert advised(centre.receive(received.items(), ticks=1 + QUIET_TICKS)).keys() == {0}


# --- a robot --------------------------------------------------------------------------------------------------------


def reported(robot: AdviceClient, tick: int, standing: StandingReport | None) -> list[AdviceMessage | None]:
    robot.update(tick, standing)
    return [read(write(each.message)) for each in robot.outgoing()]


def test_a_robot_reports_once_its_report_has_settled_and_repeats_it_until_it_is_noted() -> None:
    robot, standing = AdviceClient(DT_S), StandingReport(0, 3, (1, 2), (), True, True)
    sent = {tick: received for tick in range(100) if (received := reported(robot, tick, standing))}
    assert list(sent)[:3] == [SETTLED_TICKS, SETTLED_TICKS + REPEAT_TICKS, SETTLED_TICKS + 3 * REPEAT_TICKS]
    ((first,), *others) = sent.values()
    assert isinstance(first, StandingReport)
    assert all(each == [first] for each in others)
    robot.receive(CENTRE, ReportNoted(first.number - 1), 100)
    assert robot.next_wake() is not None
    robot.receive(CENTRE, ReportNoted(first.number), 100)
    assert robot.next_wake() is None
    assert not reported(robot, 400, standing)
    robot.receive(CENTRE, CollectReports(), 401)
    assert reported(robot, 401, standing) == [first], "a coordinator that begins anew asks"
    moved = StandingReport(0, 4, (1,), (), True, True)
    assert [reported(robot, tick, moved) for tick in range(402, 402 + SETTLED_TICKS)] == [[]] * SETTLED_TICKS
    ((new,),) = (reported(robot, 402 + SETTLED_TICKS, moved),)
    assert isinstance(new, StandingReport)
    assert new.number > first.number
    assert new.listed == (1,)


def test_advice_expires_and_holds_only_for_the_neighbours_that_it_names() -> None:
    robot = AdviceClient(DT_S)
    assert robot.advice(0, (1, 2)) is None
    robot.receive(CENTRE, RedundantAdvice(((1, 10), (2, 11))), 0)
    assert robot.advice(ADVICE_TICKS - 1, (1, 2)) == ((1, 10), (2, 11))
    assert robot.advice(1, (1, 2, 3)) is robot.advice(1, (1,)) is robot.advice(ADVICE_TICKS, (1, 2)) is None


def test_neighbours_grant_a_lock_by_advice_only_if_it_names_their_present_lists() -> None:
    robots = {node: LeaveLock(node, 10.0, 0.0, 0.0) for node in (0, 1)}
    for node, robot in robots.items():
        robot.update([1 - node], 1.0)
    version = robots[1].neighbour_list().version
    assert robots[0].request(1.0) == [], "it has received no list"
    assert robots[0].request(1.0, ((2, version),)) == [], "it sees somebody else"
    for named, answer in ((version - 1, LockDenial), (version, LockGrant)):
        (asked,) = robots[0].request(1.0, ((1, named),))
        (first, *_) = robots[1].receive(0, asked.message, 1.0)
        assert isinstance(first, Outgoing)
        assert isinstance(first.message, answer)
        robots[0].receive(1, first.message, 1.0)
    assert robots[0].may_leave(1.0)


# --- both, and an uplink on which nothing can be relied ---------------------------------------------------------------


class Swarm:
    """Robots about a grid, and a ring of others around them; who has left the complex is carried away after a while.

    Packets of the uplink are lost, late by up to `late` ticks, and repeated. With `locks` robots leave by the protocol,
    else as soon as they get advice.
    """

    def __init__(self, seed: int, late: int, locks: bool) -> None:
        self.luck = random.Random(seed)
        ring = [(0.9 * math.cos(n * math.tau / 10), 0.9 * math.sin(n * math.tau / 10)) for n in range(10)]
        grid = [0.35 * n - 0.525 for n in range(4)]
        inner = [(x + self.luck.uniform(-0.12, 0.12), y + self.luck.uniform(-0.12, 0.12)) for x in grid for y in grid]
        self.slots = dict(enumerate([*ring, *inner]))
        self.boundary_edges = {n: ((n - 1) % 10, (n + 1) % 10) if n < 10 else () for n in self.slots}
        self.centre = Centre()
        self.leaving = {
            n: LeaveNegotiation(n, DT_S, np.random.Generator(np.random.Philox(seed + n)), True) for n in self.slots
        }
        self.advice = {n: AdviceClient(DT_S) for n in self.slots}
        self.gone_at: dict[int, int] = {}
        self.uplink: dict[int, list[tuple[int | None, int | None, bytes]]] = {}
        self.air: list[tuple[int, int, PeerMessage]] = []
        self.late, self.locks = late, locks
        self.left = self.changed = 0

    def sees(self, node: int, tick: int) -> tuple[int, ...]:
        here = self.slots[node]
        bodies = [n for n in self.slots if n != node and self.gone_at.get(n, tick) + 40 > tick]
        return tuple(n for n in bodies if math.dist(here, self.slots[n]) < 0.75)

    def send(self, tick: int, sender: int | None, to: int | None, payload: bytes) -> None:
        for _ in range(self.luck.choice((0, 1, 1, 2))):
            at = tick + 1 + self.luck.randrange(1 + self.late)
            self.uplink.setdefault(at, []).append((sender, to, payload))

    def turn(self, tick: int) -> None:
        arrived = self.uplink.pop(tick, [])
        received = [(sender, read(payload)) for sender, _, payload in arrived if sender is not None]
        for to, message in self.centre.receive(
            [(sender, message) for sender, message in received if message is not None]
        ):
            for each in self.slots if to is None else [to]:
                self.send(tick, None, each, write(message))
        in_air, self.air = self.air, []
        for node, leaving in self.leaving.items():
            stands, advice = node not in self.gone_at, self.advice[node]
            sight = self.sees(node, tick)
            leaving.observe(tick, sight)
            leaving.update(stands)
            for sender, to, payload in arrived:
                if sender is None and to == node:
                    advice.receive(CENTRE, read(payload), tick)  # type: ignore[arg-type]
            for sender, receiver, spoken in in_air:
                if receiver == node and self.luck.random() >= 0.2:
                    leaving.receive(sender, spoken, tick)  # type: ignore[arg-type]
            versions = advice.advice(tick, sight)
            leaving.wanted, leaving.versions = stands and versions is not None, versions
            leaving.poll(tick)
            if leaving.left or (not self.locks and stands and versions):
                self.leave(node, tick)
                leaving.update(stands=False)
            there = leaving.neighbour_list
            assert there is not None
            standing = StandingReport(
                0, there.version, sight, self.boundary_edges[node], node not in self.gone_at, node >= 10
            )
            advice.update(tick, standing)
            for _, report in advice.outgoing():
                self.send(tick, node, None, write(report))
            for to, message in leaving.outgoing():
                self.air += [(node, each, message) for each in (sight if to is None else [to])]

    def leave(self, node: int, tick: int) -> None:
        there = {
            n: [m for m in self.sees(n, tick) if m not in self.gone_at] for n in self.slots if n not in self.gone_at
        }
        whole = FlagComplex(there)
        self.changed += betti(whole) != betti(whole.without([node]))
        self.left += 1
        self.gone_at[node] = tick


def leave_as_advised(late: int, locks: bool) -> tuple[int, int]:
    left = changed = 0
    for seed in range(4):
        swarm = Swarm(seed, late, locks)
        for tick in range(500):
            swarm.turn(tick)
        left, changed = left + swarm.left, changed + swarm.changed
    return left, changed


@pytest.mark.parametrize("late", [0, 80])
def test_departures_by_advice_never_open_a_hole_on_a_lossy_uplink(late: int) -> None:
    left, changed = leave_as_advised(late, locks=True)
    assert left > 8
    assert changed == 0


def test_without_locks_late_advice_opens_holes() -> None:
    assert leave_as_advised(late=80, locks=False)[1] > 0


# --- whole deployments ------------------------------------------------------------------------------------------------

# Robots stand so near to each other that now and then one is redundant. No robot walks along walls, which takes long.
HALL = (
    *("arena.size_m=[2.6,2.0]", "base.pose=[0.2,1.0,0.0]", "robots.count=30"),
    *("robots.parameters.margin_m=0.45", "base.parameters.margin_m=0.45"),
    *('robots.parameters.walls="paper"', 'base.parameters.walls="paper"'),
    *("services.path=gradient", "services.redundancy=coordinator"),
)


def crash(for_s: float = math.inf) -> str:
    """Return the fault of a coordinator that dies, and comes back after so long or never."""
    back = f", for_s={for_s}" if for_s < math.inf else ""
    return f'faults=[{{kind="crash", at_s=50.0{back}, nodes=["coordinator"]}}]'


def test_a_run_with_an_advisor_leaves_the_same_trace_inline_and_in_processes() -> None:
    inline, processes = (
        run("sensor-coverage", seed=2, runner=each, overrides=HALL) for each in ("inline", "processes")
    )
    assert inline.trace == processes.trace
    assert inline.outcome == "completed"
    assert inline.metrics["coverage_fraction"] >= 0.98
    assert inline.metrics["removals"] >= 1.0
    assert inline.metrics["unsafe_removals"] == 0.0


def test_a_redundant_robot_leaves_by_advice_without_a_hole_at_a_loss_of_30_percent() -> None:
    lossy = [*HALL, "radio.loss=0.3", "uplink.loss=0.3"]
    result = run("sensor-coverage", seed=1, runner="inline", overrides=lossy)
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.98
    assert result.metrics["removals"] >= 1.0
    assert result.metrics["unsafe_removals"] == result.metrics["concluded_early"] == 0.0


def test_a_deployment_goes_on_without_its_advisor_and_no_robot_leaves_any_more() -> None:
    result = run("sensor-coverage", seed=2, runner="inline", overrides=[*HALL, crash()])
    assert result.crashed == [30]
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.98
    assert result.metrics["removals"] == 0.0


def test_a_restarted_advisor_without_memory_advises_again() -> None:
    result = run("sensor-coverage", seed=2, runner="inline", overrides=[*HALL, crash(for_s=3.0)])
    assert result.restarted == [30]
    assert result.outcome == "completed"
    assert result.metrics["removals"] >= 1.0
    assert result.metrics["unsafe_removals"] == 0.0
