"""Claims expire by the receiver's clock, and no robot concludes while a robot in reach may still add to the map."""

import copy
import random
from dataclasses import dataclass, field

import pytest

from zwerm.agents.landmark_exploration.explorer import LOOK_TICKS, Explorer
from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.frontier_status import (
    ABANDONED,
    CLEAR,
    REOPENED,
    TIMED_OUT,
    UNEXPLORED,
    key_of,
)
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing.landmark_messages import Entries, Register, RegisterBeacon
from zwerm.agents.landmark_exploration.sharing.log_entries import status_entries
from zwerm.agents.landmark_exploration.sharing.registers import SETTLE_TICKS, Registers
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch, origin_of
from zwerm.agents.runtime.contract import Body, Setup
from zwerm.wire.messages import BodyVelocity, Command, LandmarkBearing, Observation, Packet

LEASE, DEAD = 150, 1_500


@pytest.mark.parametrize("pace", [0.5, 1.0, 2.0])
def test_a_claim_lasts_while_its_robot_is_received_for_every_rate_of_its_clock(pace: float) -> None:
    registers = Registers(LEASE, DEAD, 2)
    # The claimant says it again every 8 of its own ticks: every 8 / pace of the listener's.
    for stamp in range(100):
        tick = round(stamp * 8 / pace)
        registers.merge(Register(1, 1, stamp, claim=42), tick)
        assert list(registers.claims(0, tick + round(8 / pace) - 1)) == [41]


def test_the_claim_of_a_robot_that_crashed_runs_out_after_a_lease() -> None:
    registers = Registers(LEASE, DEAD, 2)
    registers.merge(Register(1, 1, 7, claim=42), 100)
    registers.merge(Register(1, 1, 7, claim=42), 240)  # forwarded by a third robot: nothing new
    assert list(registers.claims(0, 249)) == [41]
    assert list(registers.claims(0, 250)) == []


def test_a_robot_that_begins_anew_has_no_claim() -> None:
    registers = Registers(LEASE, DEAD, 2)
    registers.merge(Register(1, 1, 700, claim=42), 0)
    assert registers.merge(Register(1, 2, 1), 1)
    assert not registers.merge(Register(1, 1, 701, claim=42), 2)  # a late message of its former life
    assert list(registers.claims(0, 3)) == []


def test_the_conclusion_waits_for_a_robot_that_was_never_received() -> None:
    registers = Registers(LEASE, DEAD, robots_expected=3)
    for tick in (0, 1, 2, DEAD - 1):
        for node in (0, 1):
            registers.merge(Register(node, 1, tick, frozen=8), tick)
        assert not registers.concluded(7, tick)
    for tick in (DEAD, DEAD + 1):
        for node in (0, 1):
            registers.merge(Register(node, 1, tick, frozen=8), tick)
    assert registers.concluded(7, DEAD) is False  # first agreed now
    assert not registers.concluded(7, DEAD + SETTLE_TICKS - 1)
    assert registers.concluded(7, DEAD + SETTLE_TICKS)


def test_a_robot_that_fell_silent_is_waited_for_and_then_presumed_dead() -> None:
    registers = Registers(LEASE, DEAD, robots_expected=2)
    registers.merge(Register(1, 1, 1), 10)
    for stamp, tick in enumerate((11, 12, DEAD + 9)):
        registers.merge(Register(0, 1, stamp, frozen=8), tick)
        assert not registers.concluded(7, tick)
    concluded = []
    for stamp, tick in enumerate((DEAD + 10, DEAD + 10 + SETTLE_TICKS), start=3):
        registers.merge(Register(0, 1, stamp, frozen=8), tick)
        concluded.append(registers.concluded(7, tick))
    assert concluded == [False, True]


def test_a_robot_that_lost_its_memory_is_received_before_all_agree_for_long_enough() -> None:
    registers = Registers(LEASE, DEAD, robots_expected=2)
    for node in (0, 1):
        registers.merge(Register(node, 1, 1, frozen=8), 0)
    assert not registers.concluded(7, 1)
    registers.merge(Register(1, 2, 1), 1 + SETTLE_TICKS // 2)
    assert not registers.concluded(7, 1 + SETTLE_TICKS)
    registers.merge(Register(1, 2, 2, frozen=8), 2 + SETTLE_TICKS)
    assert not registers.concluded(7, 2 + SETTLE_TICKS)
    assert registers.concluded(7, 2 + 2 * SETTLE_TICKS)


GOSSIP = {"map": "gossip", "assignment": "claims"}


def explorer(parameters: dict[str, object], services: dict[str, str] = GOSSIP) -> Explorer:
    """Return robot 0, which shares its map by gossip and claims frontiers unless `services` says otherwise."""
    body, channels = Body("holonomic", 0.04, 0.5, 1.0), ("robots", "uplink")
    return Explorer(Setup(0, "robot", 0.1, Explorer.sensors, bytes(16), body, channels, parameters, (), services))


def frozen(command: Command) -> bool | None:
    """Return whether robot 0 says in this command that it is frozen; None if it sends no register."""
    for message in (messages.read(each.payload) for each in command.outbox):
        if isinstance(message, RegisterBeacon):
            return message.registers[0].frozen != 0
    return None


def test_a_robot_alone_explores_a_frontier_that_no_boundary_continues_once_more_before_it_freezes() -> None:
    """Without a coordinator the robot itself traces the 1-skeleton, and reopens what is inconsistent (section IV-A)."""
    robot = explorer({})
    robot.map.observe(BearingSnapshot((1, 2, 3), (0, 85, 170)))
    left = key_of(2, 1)
    robot.map.raise_all([key for key in robot.map.frontiers.open if key != left], CLEAR)
    robot.map.raise_all([left], TIMED_OUT)
    freeze_ticks = robot.parameters.freeze_ticks
    for tick in range(freeze_ticks):
        robot.step(Observation(tick, 0.1 * tick))
    assert robot.map.frontiers.statuses[left] == REOPENED
    assert list(robot.map.frontiers.open) == [left]
    robot.map.raise_all([left], ABANDONED)
    ends = [robot.step(Observation(tick, 0.1 * tick)).done for tick in range(freeze_ticks, 2 * freeze_ticks + 100)]
    assert robot.map.frontiers.statuses[left] == ABANDONED
    assert ends[0] is False
    assert ends[-1] is True


@pytest.mark.parametrize(
    ("look_idle", "is_open", "looks"), [(False, True, False), (True, True, True), (True, False, True)]
)
def test_a_robot_without_a_frontier_looks_unless_asked_not_to(look_idle: bool, is_open: bool, looks: bool) -> None:
    robot = explorer({"look_idle": look_idle})
    robot.map.observe(BearingSnapshot((1, 2, 3), (0, 85, 170)))
    for node, key in enumerate(list(robot.map.frontiers.open), start=1):
        robot.registers.merge(Register(node, 1, 1, claim=key + 1), 0)
        if not is_open:
            robot.map.raise_all([key], CLEAR)
    for tick in range(LOOK_TICKS):
        robot.step(Observation(tick, 0.1 * tick))
    seen = tuple(LandmarkBearing(landmark, 2.0 * landmark) for landmark in (2, 3, 4))
    robot.step(Observation(LOOK_TICKS, 0.1 * LOOK_TICKS, landmarks=seen))
    assert robot.map.complex.contains((2, 3, 4)) is looks


@pytest.mark.parametrize("look_idle", [True, False])
def test_a_robot_that_waits_for_the_coordinator_walks_and_looks_unless_asked_not_to(look_idle: bool) -> None:
    robot = explorer({"look_idle": look_idle}, {"map": "coordinator", "assignment": "coordinator"})
    for tick in range(LOOK_TICKS):
        robot.step(Observation(tick, 0.1 * tick))
    seen = tuple(LandmarkBearing(landmark, 2.0 * landmark) for landmark in (2, 3, 4))
    command = robot.step(Observation(LOOK_TICKS, 0.1 * LOOK_TICKS, landmarks=seen))
    assert robot.map.complex.contains((2, 3, 4)) is look_idle
    assert (command.drive != BodyVelocity()) is look_idle


@pytest.mark.parametrize("opens", [False, True])
def test_entries_that_open_no_frontier_do_not_delay_that_a_robot_freezes(opens: bool) -> None:
    """Robots that look about write entries all the time."""
    robot = explorer({})
    robot.map.observe(BearingSnapshot((1, 2, 3), (0, 85, 170)))
    closed = list(robot.map.frontiers.open)
    robot.map.raise_all(closed, CLEAR)
    said = []
    for tick in range(robot.parameters.freeze_ticks + SETTLE_TICKS):
        entries = status_entries([key_of(7, 8)] if opens else closed, UNEXPLORED if opens else CLEAR)
        payload = messages.write(Entries(origin_of(1, 1), tick, tuple(entries)))
        said.append(frozen(robot.step(Observation(tick, 0.1 * tick, (Packet("robots", payload, 1),)))))
    assert (True in said) is not opens


# --- model checking ----------------------------------------------------------------------------------------------------


@dataclass
class Model:
    """A robot: it may write as long as it is not frozen, freeze, and thaws on an entry that it did not have."""

    me: int
    count: int
    replica: Replica = field(default_factory=Replica)
    frozen: bool = False
    stamp: int = 0
    written: int = 0
    incarnation: int = 1

    def __post_init__(self) -> None:
        self.registers = Registers(LEASE, DEAD, self.count, settle_ticks=0)

    def write(self) -> None:
        self.written += 1
        self.replica.append(origin_of(self.me, self.incarnation), [bytes([self.written])])

    def speak(self) -> tuple[list[Stretch], list[Register]]:
        self.stamp += 1
        frozen = self.replica.digest + 1 if self.frozen else 0
        self.registers.merge(Register(self.me, self.incarnation, self.stamp, frozen=frozen), 0)
        logs = [Stretch(origin, 0, tuple(log)) for origin, log in self.replica.logs.items()]
        return logs, list(self.registers.newest.values())

    def hear(self, packet: tuple[list[Stretch], list[Register]]) -> None:
        logs, registers = packet
        # Registers first, and the logs maybe never: the worst order.
        for register in registers:
            if register.node != self.me:
                self.registers.merge(register, 0)
        for stretch in logs:
            if self.replica.extend(stretch):
                self.frozen = False

    def concludes(self) -> bool:
        return self.frozen and self.registers.concluded(self.replica.digest, 0)


State = tuple[list[Model], list[tuple[int, tuple[list[Stretch], list[Register]]]]]


def moves(state: State) -> list[tuple[str, int]]:
    robots, air = state
    found = [("write", i) for i, each in enumerate(robots) if not each.frozen and each.written < 1]
    found += [("freeze", i) for i, each in enumerate(robots) if not each.frozen]
    found += [("speak", i) for i, each in enumerate(robots) if each.stamp < 3]
    found += [("deliver", n) for n in range(len(air))]
    return found


def signature(state: State) -> str:
    robots, air = state
    return repr([(r.replica.vector, r.frozen, r.stamp, r.written, r.registers.__dict__) for r in robots]) + repr(air)


def explore(count: int, depth: int) -> tuple[int, int]:
    """Try every interleaving; return the number of states, and of those in which a robot concluded."""
    begin: State = ([Model(me, count) for me in range(count)], [])
    seen = {signature(begin)}
    level, concluded = [begin], 0
    for _ in range(depth):
        following: list[State] = []
        for state in level:
            for move, which in moves(state):
                robots, air = copy.deepcopy(state)
                if move == "write":
                    robots[which].write()
                elif move == "freeze":
                    robots[which].frozen = True
                elif move == "speak":
                    packet = robots[which].speak()
                    air += [(other, packet) for other in range(count) if other != which]
                else:
                    to, packet = air.pop(which)
                    robots[to].hear(packet)
                ends = [robot.concludes() for robot in robots]
                if any(ends):
                    concluded += 1
                    # Nobody can add anything any more, nor has anything in the air that another lacks.
                    assert all(robot.frozen for robot in robots)
                    assert len({robot.replica.digest for robot in robots}) == 1
                name = signature((robots, air))
                if name not in seen:
                    seen.add(name)
                    following.append((robots, air))
        level = following
    return len(seen), concluded


def test_two_robots_never_conclude_early_in_any_interleaving() -> None:
    states, concluded = explore(2, 6)
    assert states > 100
    assert concluded > 0


class Hasty(Model):
    """A robot that does not compare digests: all that it asks is that each robot has said that it is frozen."""

    def concludes(self) -> bool:
        known = self.registers.newest
        return self.frozen and len(known) == self.count and all(each.frozen for each in known.values())


def walk(seed: int, model: type[Model], count: int = 3) -> int:
    """Carry out a random interleaving, with messages lost, late and copied; return how often a robot could conclude."""
    fate = random.Random(seed)
    robots, air, concluded = [model(me, count) for me in range(count)], [], 0
    for _ in range(60):
        robot = fate.choice(robots)
        move = fate.choice(["write", "freeze", "speak", "speak", "deliver", "deliver", "copy", "lose"])
        if move == "write" and not robot.frozen and robot.written < 2:
            robot.write()
        elif move == "freeze":
            robot.frozen = True
        elif move == "speak":
            packet = copy.deepcopy(robot.speak())
            air += [(other, packet) for other in robots if other is not robot]
        elif air:
            number = fate.randrange(len(air))
            to, packet = air[number] if move == "copy" else air.pop(number)
            if move != "lose":
                to.hear(packet)
        if any(each.concludes() for each in robots):
            concluded += 1
            assert all(each.frozen for each in robots), "a robot may still write"
            assert len({each.replica.digest for each in robots}) == 1, "a robot lacks what another has"
    return concluded


def walks_that_conclude(model: type[Model]) -> int:
    return sum(walk(seed, model) > 0 for seed in range(150))


def test_three_robots_never_conclude_early_in_random_interleavings() -> None:
    assert walks_that_conclude(Model) > 5


def test_the_check_finds_robots_that_do_not_compare_digests() -> None:
    with pytest.raises(AssertionError, match=r"a robot (may still write|lacks what another has)"):
        walks_that_conclude(Hasty)


def test_the_model_finds_a_conclusion_that_takes_one_word_for_all() -> None:
    """The check can fail: without the digest in the register two robots with different logs would conclude."""
    one, other = Model(0, 2), Model(1, 2)
    other.write()
    one.frozen = other.frozen = True
    for _ in range(3):
        said = [one.speak(), other.speak()]
        other.hear(([], said[0][1]))
        one.hear(([], said[1][1]))
    assert not one.concludes()
    one.hear(other.speak())
    assert not one.frozen
