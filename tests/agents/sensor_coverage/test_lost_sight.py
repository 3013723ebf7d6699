"""Robots that lose sight of others look for them: the robot ahead or behind in a push, any robot, or the base's part of the
swarm."""

import msgspec
import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import FAR, NO_PATH_VECTOR, PathVector, SeenRobot, StateBeacon
from zwerm.agents.sensor_coverage.messages.incarnations import adopted_slot
from zwerm.agents.sensor_coverage.motion.push_drives import DriveResult
from zwerm.agents.sensor_coverage.neighbourhood.base_reach import COUNT_TICKS, CUT_TICKS, LAG, TURN_TICKS, BaseReach
from zwerm.agents.sensor_coverage.neighbourhood.situation import ALONE_TICKS
from zwerm.agents.sensor_coverage.neighbourhood.surveillance import Surveillance
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.deploy.node_specs import node_specs
from zwerm.scenario.load import load

DT_S = 0.1


def robot_3() -> LocalRobot:
    robot = Node(*node_specs(load("sensor-coverage", ("robots.count=14", "services.path=gradient")), 1)[3])._controller
    assert isinstance(robot, LocalRobot)
    return robot


def pushing(visible: tuple[int, ...]) -> tuple[LocalRobot, TokenPush]:
    """Return robot 3 at slot 8, which sees others, and its part in push 7 between the robots 4, behind, and 5, ahead."""
    robot = robot_3()
    robot.situation.motion.frame.seen = dict.fromkeys(visible, 1.0)
    robot.local_map.occupy(8)
    robot.pushing._join(7, 7, ((7, 4), (8, 3), (9, 5)), 4)
    assert robot.push is not None
    return robot, robot.push


def test_a_robot_that_sees_no_other_robot_comes_back() -> None:
    """It waits for robots on their way to it, drives back on its way, and takes a new slot, where it sees a robot."""
    robot = robot_3()
    situation = robot.situation
    for x_m in (0.0, 0.2, 0.4):
        situation.motion.frame.x_m = x_m
        situation._trail.record(situation.motion.position)
    robot.local_map.occupy(8)
    robot.local_map.heading = 0.0
    robot.local_map.samples = 1
    situation._activity, situation.motion.rest = None, situation.motion.position
    surveillance = Surveillance(situation, robot.beaconing)
    begun = None
    for tick in range(1, 2 * ALONE_TICKS):
        situation.tick = tick
        surveillance.poll(tick)
        if situation.active:
            begun = tick
            break
    assert begun == ALONE_TICKS + 1
    for _ in range(100):
        velocity = situation.advance()
        situation.motion.frame.x_m += DT_S * velocity.forward_m_s
        situation.motion.frame.seen = {5: 1.0} if situation.motion.frame.x_m < 0.15 else {}
    assert 0.0 < situation.motion.frame.x_m < 0.15
    assert robot.local_map.slot == adopted_slot(3, 1, 1) != adopted_slot(3, 1)


@pytest.mark.parametrize(
    ("visible", "walks", "phase"), [((4,), False, "regaining"), ((4, 5), False, "await"), ((4,), True, "await")]
)
def test_a_follower_looks_for_the_robot_ahead_unless_that_follows_a_wall(
    visible: tuple[int, ...], walks: bool, phase: str
) -> None:
    _, push = pushing(visible)
    push._walks = walks
    push._home()
    assert push.phase == phase


@pytest.mark.parametrize(("visible", "phase"), [((5,), "straightening"), ((4, 5), "await")])
def test_a_follower_at_a_measured_distance_moves_back_into_sight_of_the_robot_behind(
    visible: tuple[int, ...], phase: str
) -> None:
    robot, push = pushing(visible)
    push._behind_settled = True
    push._result = DriveResult(True, used_odometry=True)
    robot.local_map.distances_m[8] = 0.9
    push._straighten()
    assert push.phase == phase


def seeing(*nodes: int) -> StateBeacon:
    """Return the state of a robot that sees others."""
    seen = tuple(SeenRobot(node, 0, node, 0.0) for node in nodes)
    return StateBeacon(1, 7, 0, False, False, 1, seen, (), (), NO_PATH_VECTOR)


@pytest.mark.parametrize(
    ("visible", "others", "phase"),
    [((5,), (), "returning"), ((4, 5), (), "await"), ((5, 6), (4,), "await"), ((5, 6), (5,), "returning")],
    ids=["out of sight", "in sight", "another between", "another on this side"],
)
def test_a_robot_does_not_settle_apart_from_the_robot_behind(
    visible: tuple[int, ...], others: tuple[int, ...], phase: str
) -> None:
    """Visual homing may end behind a corner. Where no robot is between the two, the swarm may hang together by them."""
    robot, push = pushing(visible)
    robot.local_map.states[6] = seeing(*others)
    push._behind_settled = True
    push._return()
    assert push.phase == phase


@pytest.mark.parametrize("found", [True, False])
def test_a_robot_comes_back_to_the_robot_behind_or_stays(found: bool) -> None:
    robot = robot_3()
    situation, frame = robot.situation, robot.situation.motion.frame
    for x_m in (-0.6, -0.3, 0.0):
        frame.x_m = x_m
        situation._trail.record(situation.motion.position)
    situation._start = situation.motion.position
    for x_m in (0.2, 0.4, 0.6):
        frame.x_m = x_m
        situation._trail.record(situation.motion.position)
    situation.come_back_to(4)
    nearest_m = frame.x_m
    for _ in range(200):
        velocity = situation.advance()
        frame.x_m += DT_S * velocity.forward_m_s
        frame.seen = {4: 0.0} if found and frame.x_m < 0.45 else {}
        nearest_m = min(nearest_m, frame.x_m)
    assert not situation.active
    if found:
        assert 0.3 < frame.x_m < 0.45
    else:
        assert frame.x_m == pytest.approx(0.6, abs=0.02)
        assert nearest_m == pytest.approx(0.0, abs=0.06), "not further than to where the push began"


class Chain:
    """The base, and robots behind one another, which exchange hops and counts every COUNT_TICKS."""

    def __init__(self, robots: int) -> None:
        self.nodes = [BaseReach(FAR) for _ in range(robots + 1)]
        self.tick = 0
        self.cut: int | None = None  # the first robot that the one before it does not see

    def beside(self, node: int) -> dict[int, int]:
        return {
            other: self.nodes[other].hops
            for other in (node - 1, node + 1)
            if 0 <= other < len(self.nodes) and self.cut != max(node, other)
        }

    def go_on(self, ticks: int) -> None:
        for _ in range(0, ticks, COUNT_TICKS):
            self.tick += COUNT_TICKS
            self.nodes[0].be_base(self.tick, 0)
            for node in range(1, len(self.nodes)):
                there = [self.nodes[other] for other in self.beside(node)]
                self.nodes[node].update(self.tick, [(each.hops, each.count) for each in there])

    def turns(self) -> list[int]:
        robots = range(1, len(self.nodes))
        return [node for node in robots if self.nodes[node].is_turn(self.tick, node, self.beside(node))]


def test_the_robot_with_the_fewest_hops_of_a_part_without_the_base_drives_back_first() -> None:
    chain = Chain(6)
    chain.go_on(1_000)
    assert [each.hops for each in chain.nodes] == list(range(7))
    chain.cut = 4
    for _ in range(CUT_TICKS // COUNT_TICKS):
        chain.go_on(COUNT_TICKS)
        assert not chain.turns()
    for _ in range(2 + (TURN_TICKS + LAG * COUNT_TICKS) // COUNT_TICKS):
        chain.go_on(COUNT_TICKS)
        assert set(chain.turns()) <= {4}
    assert chain.turns() == [4]
    chain.go_on(5_000)
    assert [each.hops for each in chain.nodes] == list(range(7)), "hops do not count up where the base is out of reach"
    chain.cut = None
    chain.go_on(COUNT_TICKS)
    assert not chain.turns()


def test_hops_follow_the_way_to_the_base_that_is_left() -> None:
    robot = BaseReach(FAR)
    robot.update(1, [(2, 10), (6, 10)])
    assert robot.hops == 3
    robot.update(2, [(6, 10 + LAG)])
    assert robot.hops == 3, "the count came a little earlier on the longer way"
    robot.update(3, [(6, 11 + LAG)])
    assert robot.hops == 7
    robot.update(4, [(2, 11)])
    assert robot.hops == 3
    robot.leave()
    assert robot.hops == FAR


def cut_off() -> LocalRobot:
    """Return robot 3 at slot 8, with 2 hops to the base, beside robot 5 at slot 9, with 3 hops; both see each other."""
    robot = robot_3()
    situation, local_map = robot.situation, robot.local_map
    local_map.occupy(8)
    local_map.heading, situation._activity, situation.calm = 0.0, None, True
    situation.motion.frame.seen = {5: 1.0}
    local_map.update_bearings({5: 1.0})
    back = SeenRobot(3, local_map.epoch, 8, 0.0)
    local_map.receive(5, msgspec.structs.replace(seeing(), slot=9, seen=(back,)), 1)
    local_map.update_bearings({5: 1.0})
    local_map.path_vectors.receive(5, PathVector(1, 9, None, (), 3, 10))
    local_map.reach.hops = 2
    return robot


def waits(robot: LocalRobot) -> bool:
    """Return whether a robot waits for as long as it may before it drives back."""
    for tick in range(0, CUT_TICKS + TURN_TICKS + 200, 50):
        robot.situation.tick = tick
        if robot.situation.is_cut_off():
            return False
    return True


def test_a_robot_drives_back_if_the_base_is_out_of_reach_of_its_part_of_the_swarm() -> None:
    assert not waits(cut_off())


def test_a_robot_that_sees_the_base_or_a_robot_nearer_to_it_stays() -> None:
    """So no robot drives away where the radio of the base fails."""
    robot = cut_off()
    robot.local_map.states[0] = msgspec.structs.replace(seeing(), slot=0)
    robot.situation.motion.frame.seen[0] = 2.0
    assert waits(robot)
    robot.local_map.remove_dead(0)
    robot.situation.failure_detector.dead[0] = None
    assert waits(robot)
    robot = cut_off()
    robot.local_map.path_vectors.receive(5, PathVector(2, 9, None, (), 1, 10))
    assert waits(robot)


def test_a_robot_that_drives_back_passes_the_robots_of_its_part() -> None:
    robot = cut_off()
    situation, frame = robot.situation, robot.situation.motion.frame
    robot.local_map.states[5] = seeing(3, 6)
    for x_m in (0.0, 0.2, 0.4, 0.6):
        frame.x_m = x_m
        situation._trail.record(situation.motion.position)
    situation.come_back()
    for _ in range(200):
        velocity = situation.advance()
        frame.x_m += DT_S * velocity.forward_m_s
        frame.seen = {5: 1.0} if frame.x_m > 0.4 else {6: 1.0} if frame.x_m > 0.2 else {7: 1.0}
    assert not situation.active
    assert frame.x_m < 0.2, "robot 7 is not of its part"
    assert robot.local_map.slot == adopted_slot(3, 1, 1)
