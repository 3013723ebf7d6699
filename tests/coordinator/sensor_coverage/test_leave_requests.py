"""A coordinator that finds the path, and robots that find the redundant ones among themselves."""

import math

import pytest

from zwerm.agents.runtime.contract import Body, Setup
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import (
    Ack,
    Answer,
    Arrived,
    Landmark,
    LeftComplex,
    Move,
    NegotiateLeave,
    Report,
    Request,
    RobotCommand,
    ScanRequest,
    read_response,
    write,
)
from zwerm.agents.sensor_coverage.messages.locks import (
    ListRequest,
    LockDenial,
    LockGrant,
    LockRelease,
    LockRequest,
    NeighbourList,
)
from zwerm.agents.sensor_coverage.messages.peers import CHANNEL, PeerMessage, read
from zwerm.agents.sensor_coverage.messages.peers import write as write_word
from zwerm.agents.sensor_coverage.messages.snapshots import (
    ComplexSnapshot,
    MembershipSnapshot,
    Snapshot,
    decode_snapshot,
)
from zwerm.agents.sensor_coverage.negotiating_robot import NegotiatingRobot
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox
from zwerm.coordinator.sensor_coverage.leave_requests import LeaveRequests
from zwerm.errors import ScenarioError
from zwerm.maths.simplicial import FlagComplex
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.load import tables_of, validate
from zwerm.wire.messages import Bearing, BodyVelocity, Displacement, Observation, Packet

# The times of these tests are those of a deployment by the paper's rules.
PAPER = 'coordinator.parameters.walls="paper"'
HALL = ("arena.size_m=[2.4,1.8]", "base.pose=[0.2,0.9,0.0]", "robots.count=30", "services.redundancy=link", PAPER)
CLOSE = tuple(f"{each}.parameters.margin_m=0.62" for each in ("robots", "base", "coordinator"))
OFTEN = "coordinator.parameters.redundancy_every=3"
LOSS = ("radio.loss=0.3", "uplink.loss=0.3")

# --- a robot --------------------------------------------------------------------------------------------------------


class Pair:
    """Robot 1, which sees one neighbour, 7, whose messages the test writes."""

    def __init__(self, incarnation: int = 1) -> None:
        body = Body("holonomic", 0.07, 0.5, 6.0)
        setup = Setup(1, "robot", 0.1, NegotiatingRobot.sensors, b"0" * 16, body, incarnation=incarnation)
        self.robot = NegotiatingRobot(setup)
        self.tick = self.number = 0
        self.answers: list[Answer] = []
        self.words: list[PeerMessage] = []
        self.changes: list[Snapshot | None] = []
        self.drives = False

    def turn(self, *said: PeerMessage, order: RobotCommand | None = None, again: bool = False) -> None:
        """Step a tick with messages of the neighbour and commands of the coordinator."""
        inbox = [Packet(CHANNEL, write_word(each), 7) for each in said]
        self.number += order is not None and not again
        if order is not None:
            inbox.append(Packet("uplink", write(Request(1, self.number, 1 + again, 0, order)), 9))
        self.tick += 1
        command = self.robot.step(
            Observation(
                self.tick,
                0.1 * self.tick,
                tuple(inbox),
                bearings=(Bearing(7, 0.0),),
                touch=(),
                odometry=Displacement(0.0, 0.0, 0.0),
            )
        )
        self.drives = command.drive not in (None, BodyVelocity())
        self.changes += [decode_snapshot(command.snapshot)] if command.snapshot else []
        for each in command.outbox:
            if each.channel == CHANNEL:
                word = read(each.payload)
                assert word is not None
                self.words.append(word)
            else:
                reply = read_response(each.payload)
                assert reply is not None
                self.answers.append(reply.answer)

    def rest(self, ticks: int = 25) -> "Pair":
        for _ in range(ticks):
            self.turn()
        self.answers.clear()
        return self

    def version(self) -> int:
        """Ask the robot for its list, and return its version."""
        self.turn(ListRequest((1,)))
        return next(each.version for each in reversed(self.words) if isinstance(each, NeighbourList))

    def leaves(self) -> None:
        """Let the coordinator request a negotiation, and grant all requests of the robot."""
        self.turn(order=NegotiateLeave(2))
        for _ in range(30):
            asked, self.words = self.words, []
            answers: list[PeerMessage] = []
            for each in asked:
                if isinstance(each, ListRequest):
                    answers.append(NeighbourList(1, (1,)))
                elif isinstance(each, LockRequest):
                    answers.append(LockGrant(each.number))
            self.turn(*answers)


AWAY = Move(2, math.pi, 0.4, (Landmark(7, 0.0, True),))


def test_a_command_to_move_waits_for_the_end_of_a_lock_and_is_not_refused() -> None:
    pair = Pair().rest()
    pair.turn(LockRequest(5, ((1, pair.version()),)))
    assert LockGrant(5) in pair.words
    pair.turn(order=AWAY)
    for _ in range(20):
        pair.turn()
        assert not pair.drives
    pair.turn(order=AWAY, again=True)
    assert pair.answers == [Ack()]
    pair.turn(LockRelease(5))
    assert pair.drives
    pair.words.clear()
    pair.turn(LockRequest(6, ((1, pair.version()),)))
    assert pair.words[-1] == LockDenial(6), "who drives stands still for nobody"
    pair.rest(100)
    assert not pair.drives


def test_a_robot_under_no_lock_moves_at_once() -> None:
    pair = Pair().rest()
    pair.turn(order=AWAY)
    assert pair.drives


def test_a_robot_leaves_when_its_neighbour_agrees_and_reports_that_until_it_moves() -> None:
    pair = Pair().rest()
    pair.leaves()
    assert pair.changes == [MembershipSnapshot(False)]
    assert [type(each) for each in pair.answers] == [LeftComplex]
    pair.turn(order=ScanRequest(3, ()))
    assert isinstance(pair.answers[-1], LeftComplex)
    pair.turn(order=AWAY)
    assert pair.changes[1:] == [MembershipSnapshot(True)]
    for _ in range(200):
        pair.turn()
    assert isinstance(pair.answers[-1], Arrived)
    pair.turn(order=ScanRequest(4, ()))
    for _ in range(25):
        pair.turn()
    assert type(pair.answers[-1]) is Report


def test_a_robot_stays_without_a_request_or_without_its_neighbours_agreement() -> None:
    pair = Pair().rest(200)
    assert not any(isinstance(each, LockRequest) for each in pair.words)
    pair.turn(order=NegotiateLeave(2))
    for _ in range(100):
        pair.turn(NeighbourList(1, (1,)))
    assert any(isinstance(each, LockRequest) for each in pair.words)
    assert [type(each) for each in pair.answers] == [Report]
    assert pair.changes == []
    number = max(each.number for each in pair.words if isinstance(each, LockRequest))
    pair.turn(LockGrant(number))
    assert pair.changes == [], "it has said that it stays"


def test_a_robot_that_lost_its_memory_rejoins_the_complex_and_stands_still_for_one_lease() -> None:
    pair = Pair(incarnation=2).rest()
    assert pair.changes == [MembershipSnapshot(True)]
    pair.turn(order=AWAY)
    while not pair.drives:
        pair.turn()
    assert 39.0 < 0.1 * pair.tick < 41.0


# --- the coordinator ------------------------------------------------------------------------------------------------


def test_a_robot_that_left_is_not_redundant_where_coverage_needs_it() -> None:
    slots = Slots()
    turns = [n * math.pi / 3.0 for n in range(6)]
    spots = [(0.0, 0.0), *((0.55 * math.cos(each), 0.55 * math.sin(each)) for each in turns)]
    for robot in range(7):
        slots.add(robot)
    leave_requests = LeaveRequests(0.15, slots, CommandMailbox(0.1))
    leave_requests.update({0: LeftComplex(1, None, ()), 1: Report(1, None, ())})

    def scan(there: list[int]) -> ScanResult:
        views = {
            i: {
                j: math.atan2(spots[j][1] - spots[i][1], spots[j][0] - spots[i][0])
                for j in there
                if j != i and math.dist(spots[i], spots[j]) <= 1.0
            }
            for i in there
        }
        return ScanResult(views, FlagComplex(views), ())

    assert leave_requests.redundant_slots(scan([0, 1, 2, 3, 4, 5, 6])) == (0,)
    assert leave_requests.redundant_slots(scan([0, 1, 2, 3])) == (), "a side would be open that it covers"
    assert leave_requests.redundant_slots(scan([0, 1, 4])) == (), "the others would not see each other"


# --- the whole swarm ------------------------------------------------------------------------------------------------


def complexes(result: RunResult) -> list[tuple[float, ComplexSnapshot]]:
    """Return the complexes that the coordinator reported, and when [s]."""
    found = [(each.time_s, decode_snapshot(each.snapshot)) for each in result.snapshots]
    return [(time_s, each) for time_s, each in found if isinstance(each, ComplexSnapshot)]


def outs(result: RunResult, until_s: float = math.inf) -> tuple[dict[int, None], int]:
    """Return the robots that had left and not returned by then, and the number that had returned."""
    out: dict[int, None] = {}
    back = 0
    for each in result.snapshots:
        change = decode_snapshot(each.snapshot)
        if each.time_s >= until_s or not isinstance(change, MembershipSnapshot):
            continue
        if change.member:
            back += 1
            out.pop(each.node, None)
        else:
            out[each.node] = None
    return out, back


@pytest.mark.parametrize("loss", [(), LOSS])
def test_robots_that_left_by_agreement_are_pushed_again_and_all_is_covered(loss: tuple[str, ...]) -> None:
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, *CLOSE, OFTEN, *loss])
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.98
    assert result.metrics["holes"] == 0
    assert result.metrics["unsafe_removals"] == 0
    out, back = outs(result)
    assert back >= 1
    assert result.metrics["removals"] == len(out) + back
    assert result.metrics["redundant_robots"] == len(out)


def test_redundant_robots_replace_those_that_an_empty_depot_lacks() -> None:
    few = [*HALL, *CLOSE, "coordinator.parameters.redundancy_every=0", "robots.count=16"]
    alone, spared = (
        run("sensor-coverage", runner="inline", overrides=[*few, *more]) for more in (["services.redundancy=none"], [])
    )
    assert "depot-dry" in alone.reason
    assert spared.outcome == "completed"
    assert spared.metrics["robots_deployed"] == 16
    assert spared.metrics["unsafe_removals"] == 0


def test_a_restarted_coordinator_learns_from_the_robots_which_have_left() -> None:
    crash = 'faults=[{kind="crash", at_s=129.0, nodes=["coordinator"], for_s=3.0}]'
    result = run("sensor-coverage", runner="inline", overrides=[*HALL, *CLOSE, OFTEN, crash])
    out, _ = outs(result, 129.0)
    anew = [each for time_s, each in complexes(result) if time_s >= 132.0]
    assert out
    assert not any(node in edge for node in out for edge in anew[0].edges)
    assert any(path[0] in out for path in anew[0].paths)
    assert result.outcome == "completed"
    assert result.metrics["unsafe_removals"] == 0


def test_robots_leave_safely_while_the_swarms_of_two_stations_have_not_met() -> None:
    hall = ["arena.size_m=[3.4,2.4]", "robots.count=60", "base.poses=[[0.2,1.3,0.0],[3.2,1.3,3.0]]", PAPER]
    close = [f"{each}.parameters.margin_m=0.5" for each in ("robots", "base", "coordinator")]
    often = ["coordinator.parameters.redundancy_every=4", "services.redundancy=link", "time.duration_s=70.0"]
    result = run("sensor-coverage-multi-source", runner="inline", overrides=[*hall, *close, *often, *LOSS])
    assert result.outcome == "time-limit"
    assert result.metrics["removals"] >= 1
    assert result.metrics["unsafe_removals"] == 0
    assert max(each.cycle for _, each in complexes(result)) > 5


def test_negotiating_robots_leave_the_same_trace_inline_and_in_processes() -> None:
    small = ["arena.size_m=[1.8,1.4]", "base.pose=[0.2,0.7,0.0]", "coordinator.parameters.redundancy_every=1"]
    settings = [*HALL, *CLOSE, *small, "time.duration_s=40.0"]
    inline, processes = (run("sensor-coverage", runner=each, overrides=settings) for each in ("inline", "processes"))
    other = run("sensor-coverage", seed=2, runner="inline", overrides=settings)
    assert inline.metrics["removals"] >= 1
    assert processes.trace == inline.trace != other.trace


def test_negotiating_robots_without_a_peer_radio_are_refused() -> None:
    tables, path = tables_of("sensor-coverage", ("services.redundancy=link",))
    del tables["radio"]
    with pytest.raises(ScenarioError) as caught:
        validate(tables, "here", path.parent)
    assert caught.value.mistakes == [
        "here: expected services: path=coordinator, redundancy=link needs the table [radio]"
    ]
