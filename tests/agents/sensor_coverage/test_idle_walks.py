"""A robot whose walk along a wall closed nothing does not keep a slot where the walk ended, and is pushed from there."""

import math

import pytest

from zwerm.agents.runtime.node import Node
from zwerm.agents.sensor_coverage.frontier.plan import WALLS, Plan
from zwerm.agents.sensor_coverage.local_robot import LocalRobot
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, PathVector, Route, SeenRobot, StateBeacon
from zwerm.agents.sensor_coverage.messages.commands import LOST, STRETCH, Sighting, Waypoint
from zwerm.agents.sensor_coverage.messages.pushes import PushDone, ReferenceBearing, SlotMemory, TakeSlot
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import IDLE_LEGS_MAX, WalkResult
from zwerm.agents.sensor_coverage.protocols.token_push import TokenPush
from zwerm.agents.sensor_coverage.protocols.walls.wall_push import NEWS_TICKS
from zwerm.deploy.node_specs import node_specs
from zwerm.scenario.load import load

CLAIM = Route(20_000.0, (9,), 1)


def walking(beside: bool) -> tuple[LocalRobot, TokenPush]:
    """Return robot 3 at slot 8, which has walked from slot 9, where robot 5 stands; both see each other."""
    robot = Node(*node_specs(load("sensor-coverage", ("robots.count=14", "services.path=gradient")), 1)[3])._controller
    assert isinstance(robot, LocalRobot)
    local_map = robot.local_map
    local_map.occupy(8)
    local_map.heading = 0.0
    robot.situation.motion.frame.seen = {5: 1.0}
    seen = (SeenRobot(3, local_map.epoch, 8, 0.0),)
    local_map.receive(5, StateBeacon(1, 9, 0, False, False, 1, seen, (), (), NO_PATH_VECTOR), 1)
    local_map.update_bearings({5: 1.0})
    push = robot.pushing._join(7, 8, ((9, 5), (9, 3)), 5)
    push._plan = Plan((9, 1, 0, WALLS), 9, 1.0, 0.95, 0.0, (9,), walk=True, beside=beside)
    return robot, push


@pytest.mark.parametrize(
    ("beside", "end", "closed", "open_arc", "leaves"),
    [
        (True, LOST, False, True, True),
        (True, LOST, True, True, False),
        (True, LOST, False, False, False),
        (False, LOST, False, True, False),
        (False, STRETCH, False, True, True),
    ],
    ids=["closed nothing", "closed a part", "closes by standing there", "no other robot further on", "in sight"],
)
def test_a_robot_leaves_after_a_walk_that_closed_nothing(
    beside: bool, end: str, closed: bool, open_arc: bool, leaves: bool
) -> None:
    robot, push = walking(beside)
    robot.local_map.path_vectors.receive(5, PathVector(1, 9, CLAIM if open_arc else None))
    push._has_helped, push._idle_legs = closed, IDLE_LEGS_MAX
    push._walked(WalkResult(end, 0.4))
    push._leave_if_spare()
    assert robot.local_map.redundant is leaves


def test_a_robot_whose_walk_closed_nothing_so_far_leaves_only_when_the_robot_behind_has_judged_its_place() -> None:
    """The robot behind takes the points of the walk into its proof when it stands, and its news arrives some ticks later."""
    robot, push = walking(beside=True)
    push._walked(WalkResult(LOST, 0.4))
    push.close(PushDone(7))
    judged = [False, False, True]
    for robot.situation.tick, expected in zip((0, NEWS_TICKS, NEWS_TICKS + 1), judged, strict=True):
        assert push._is_judged() is expected
    _, spare_push = walking(beside=False)
    spare_push._walked(WalkResult(STRETCH, 0.4))
    spare_push.close(PushDone(7))
    assert spare_push._is_judged()


def test_a_walk_measures_the_distances_to_its_slot_and_to_robots_in_sight_by_all_of_its_legs() -> None:
    """The second leg leads towards robot 6, and does not show its distance."""
    robot, push = walking(beside=False)
    robot.local_map.receive(6, StateBeacon(1, 10, 0, False, False, 1, (), (), (), NO_PATH_VECTOR), 1)
    at_m = 1.2, 0.8
    legs = [[(0.0, 0.1 * step) for step in range(9)], [(0.1 * step, 0.8) for step in range(4)]]
    for idle_legs, leg in enumerate(legs):
        way = tuple(
            Waypoint(x, y, (Sighting(6, math.atan2(at_m[1] - y, at_m[0] - x)),), (-math.pi / 2.0,), ()) for x, y in leg
        )
        robot.situation.motion.frame.x_m, robot.situation.motion.frame.y_m = leg[-1]
        push._idle_legs = idle_legs
        push._walked(WalkResult(STRETCH, 0.4, way))
    assert robot.local_map.distances_m == pytest.approx({9: math.hypot(0.3, 0.8), 10: 0.9})


@pytest.mark.parametrize(
    ("references", "distance_m", "bearing_rad", "hop_m"),
    [
        ((), 0.6, 1.0, 0.6),
        ((ReferenceBearing(8, 3, 0.5, 4),), 0.6, 0.5 - math.pi, 0.6),
        ((), None, 0.0, 0.0),
    ],
    ids=["by its own bearing", "as former robots did", "by landmarks alone"],
)
def test_a_robot_that_nobody_remembers_drives_towards_the_robot_ahead(
    references: tuple[ReferenceBearing, ...], distance_m: float | None, bearing_rad: float, hop_m: float
) -> None:
    """It was out of the complex, so the memory of the slot ahead may not know its own."""
    robot, _ = walking(beside=False)
    robot.local_map.heading = 0.0
    robot.local_map.distances_m = {} if distance_m is None else {9: distance_m}
    push = robot.pushing._join(8, 10, ((8, 3),), None)
    push.receive(TakeSlot(8, ((8, 3), (9, 5)), SlotMemory(9, references, (), (), (), (), ())))
    goal = hop_m * math.cos(bearing_rad), hop_m * math.sin(bearing_rad)
    assert push.phase == "following"
    assert robot.situation._goal == pytest.approx(goal)
