"""Figures 5 to 9 of Ramaithitima et al. 2015 as complexes built by hand, by the ids that their captions and text give.

The tests use the services as the coordinator does, from bearings in randomly turned frames. Figures 6(a), 6(c), 7 and
8(b) are in `test_fence` too, rule by rule; the test drive of 6(d) is a robot's and in `test_sensor_coverage`.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes, Dijkstra
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner import Planner
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import (
    Answer,
    Arrived,
    Cleared,
    Correct,
    Deploy,
    Emerged,
    Move,
    Release,
    Request,
    Response,
    RobotCommand,
    Sighting,
    read_request,
    write,
)
from zwerm.coordinator.sensor_coverage.assignment import CheapestFirst
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox
from zwerm.coordinator.sensor_coverage.push_execution import PushExecution
from zwerm.coordinator.sensor_coverage.relative_homology import RelativeHomology
from zwerm.coordinator.sensor_coverage.sources import Sources
from zwerm.maths.simplicial import FlagComplex
from zwerm.wire.messages import Packet

Point = tuple[float, float]
SIXTY = math.pi / 3.0
HOP_M = 0.95


def at(angle_deg: float, length: float = HOP_M, of: Point = (0.0, 0.0)) -> Point:
    return of[0] + length * math.cos(math.radians(angle_deg)), of[1] + length * math.sin(math.radians(angle_deg))


class Swarm:
    """Robots at places with their own ids, each frame turned; `base` is the one that stands on a station, if any is."""

    def __init__(
        self, position: Mapping[int, Point], base: int | None = None, turned_seed: int = 1, range_m: float = 1.0
    ) -> None:
        self.position = dict(position)
        random = np.random.default_rng(turned_seed)
        self.turned = {robot: float(random.uniform(-3.0, 3.0)) for robot in position}
        self.slots = Slots()
        for robot in self.position:
            self.slots.add(robot)
        for robot, here in self.position.items():
            seen = [
                Sighting(other, math.remainder(direction(here, there) - self.turned[robot], math.tau))
                for other, there in self.position.items()
                if other != robot and math.dist(here, there) <= range_m
            ]
            self.slots.take(robot, seen)
        self.slots.learn_headings(self.position)
        views = self.slots.views()
        self.slots.learn_references(views)
        self.slot = self.slots.slot_of()
        bases = () if base is None else (self.slot[base],)
        self.scan = ScanResult(views, FlagComplex(views), bases)
        self.planner = Planner(PlannerParameters(walls="paper"), self.slots)

    def update(self) -> "Swarm":
        self.planner.update(self.scan)
        return self

    def touch(self, robot: int, *towards_deg: float) -> None:
        """Let a robot touch walls in these directions of the truth."""
        self.slots.walls[self.slot[robot]] = [math.radians(each) + self.off(robot) for each in towards_deg]

    def off(self, robot: int) -> float:
        return self.slots.heading[robot] - self.turned[robot]

    def robots(self, edges: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
        occupant = self.slots.occupant
        return sorted((min(occupant[i], occupant[j]), max(occupant[i], occupant[j])) for i, j in edges)

    def goal(self, plan: Plan) -> Point:
        """The true target of a plan."""
        robot = self.slots.occupant[plan.mover]
        return at(math.degrees(plan.direction - self.off(robot)), plan.hop_m, self.position[robot])

    def plans(self, *pair: int) -> list[Plan]:
        first = next(iter(self.planner.plans()))
        return [each for each in first if self.robots([(each.key[0], each.key[1])])[0] == pair]

    def routes(self, complex_: FlagComplex, sources: Mapping[int, float]) -> CheapestRoutes:
        return Dijkstra(3.0).routes(complex_, sources, self.planner.obstacle)


def direction(here: Point, there: Point) -> float:
    return math.atan2(there[1] - here[1], there[0] - here[0])


# --- figure 5 -------------------------------------------------------------------------------------------------------


def figure_5() -> Swarm:
    """Nine robots in a hexagonal packing, and robot 10 among them."""
    ring = {n + 1: at(60.0 * n) for n in range(6)}
    return Swarm({**ring, 7: (0.0, 0.0), 8: at(30.0, 1.645), 9: at(90.0, 1.645), 10: (0.25, 0.1)}).update()


def test_figure_5_robot_10_is_redundant_and_no_other() -> None:
    swarm = figure_5()
    add = RelativeHomology().redundant(swarm.scan, swarm.planner.boundary_edges())
    assert [swarm.slots.occupant[slot] for slot in add] == [10]


def test_figure_5_without_robot_10_no_robot_is_redundant() -> None:
    position = figure_5().position
    swarm = Swarm({robot: there for robot, there in position.items() if robot != 10}).update()
    assert RelativeHomology().redundant(swarm.scan, swarm.planner.boundary_edges()) == ()


# --- figure 6 -------------------------------------------------------------------------------------------------------

_I, _J, _K = 1, 2, 3


def test_figure_6a_an_edge_within_other_triangles_of_k_is_an_exception() -> None:
    k1, k2 = 4, 5
    swarm = Swarm({_I: (0.7, -0.4), _J: (0.7, 0.4), _K: (0.0, 0.0), k1: (0.9, -0.2), k2: (0.9, 0.2)}).update()
    assert (_I, _J) not in swarm.robots(side.edge for side in swarm.planner.fence.sides)
    assert (_I, _J) not in swarm.robots([*swarm.planner.frontier, *swarm.planner.obstacle])
    alone = Swarm({_I: (0.7, -0.4), _J: (0.7, 0.4), _K: (0.0, 0.0)}).update()
    assert (_I, _J) in alone.robots(alone.planner.frontier)


def triangle() -> Swarm:
    """Edge {i, j} along x, covered from below by k."""
    return Swarm({_I: (0.0, 0.0), _J: (HOP_M, 0.0), _K: at(-60.0)})


def test_figure_6b_an_edge_is_an_obstacle_edge_if_both_ends_touch_a_wall_ahead() -> None:
    swarm = triangle()
    swarm.touch(_I, 80.0)
    swarm.touch(_J, 100.0)
    swarm.update()
    assert (_I, _J) in swarm.robots(swarm.planner.obstacle)
    assert (_I, _J) not in swarm.robots(swarm.planner.frontier)
    assert swarm.plans(_I, _J) == []


@pytest.mark.parametrize(("wall_deg", "movers"), [(80.0, [_J]), (-60.0, [_I, _J]), (180.0, [_I, _J])])
def test_figure_6b_if_one_end_touches_a_wall_ahead_the_other_end_is_the_mover(
    wall_deg: float, movers: list[int]
) -> None:
    swarm = triangle()
    swarm.touch(_I, wall_deg)
    swarm.update()
    assert sorted(swarm.slots.occupant[plan.mover] for plan in swarm.plans(_I, _J)) == movers
    assert (_I, _J) in swarm.robots(swarm.planner.frontier)


def test_figure_6c_a_convex_corner_makes_both_of_its_edges_obstacle_edges() -> None:
    """The two robots are 0.9 apart, and a pillar blocks their line of sight."""
    swarm = Swarm({_I: (0.0, 0.0), _J: (0.95, 0.0), _K: at(56.0)})
    views = {slot: dict(view) for slot, view in swarm.scan.views.items()}
    del views[swarm.slot[_J]][swarm.slot[_K]], views[swarm.slot[_K]][swarm.slot[_J]]
    swarm.scan = ScanResult(views, FlagComplex(views), ())
    swarm.update()
    assert swarm.robots(swarm.planner.fence.corners) == [(_I, _J), (_I, _K)]
    goals = [swarm.goal(plan) for plan in (*swarm.plans(_I, _J), *swarm.plans(_I, _K))]
    assert goals, "what is not in the corner is frontier"
    assert all(math.dist(goal, at(28.0, 0.8)) > 0.8 for goal in goals), "nobody goes into the corner"


# --- figures 7 and 8 ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("k2", "sides"), [((0.6, 0.65), [-1]), ((0.5, -0.6), [])])
def test_figure_7_an_edge_is_fence_where_all_its_triangles_are_on_one_side(k2: Point, sides: list[int]) -> None:
    swarm = Swarm({_I: (0.0, 0.0), _J: (0.95, 0.0), 11: (0.4, 0.6), 12: k2}).update()
    add = [side for side in swarm.planner.fence.sides if swarm.robots([side.edge]) == [(_I, _J)]]
    assert [side.sign for side in add] == sides


@pytest.mark.parametrize("turned_seed", [1, 2, 3])
def test_figure_8a_both_ends_send_the_new_robot_to_the_same_point_at_60_degrees_on_the_free_side(
    turned_seed: int,
) -> None:
    """The sign conventions from end to end: left of the direction from i to j is right of the direction from j to i."""
    position = {_I: (0.2, 0.1), _J: at(20.0, of=(0.2, 0.1)), _K: at(-40.0, of=(0.2, 0.1))}
    swarm = Swarm(position, turned_seed=turned_seed).update()
    plans = swarm.plans(_I, _J)
    assert sorted(swarm.slots.occupant[plan.mover] for plan in plans) == [_I, _J]
    for plan in plans:
        assert swarm.goal(plan) == pytest.approx(at(80.0, of=(0.2, 0.1)))
        assert {swarm.slots.occupant[each] for each in plan.anchors} == {_I, _J}


def test_figure_8b_a_gap_of_100_degrees_is_bisected_from_either_end() -> None:
    swarm = Swarm({_I: (0.0, 0.0), _J: at(0.0), _K: at(100.0)}).update()
    for pair in ((_I, _J), (_I, _K)):
        inward = [plan for plan in swarm.plans(*pair) if swarm.goal(plan)[0] > 0 and swarm.goal(plan)[1] > 0]
        assert len(inward) == 2
        for plan in inward:
            assert swarm.goal(plan) == pytest.approx(at(50.0), abs=1e-6)


# --- figure 9 -------------------------------------------------------------------------------------------------------


def figure_9() -> Swarm:
    """Twelve robots in a hexagonal packing: the source is 12, and a wall is below all of the lowest row."""
    rows = {
        12: (0, 0), 11: (1, 0), 8: (2, 0), 9: (3, 0),
        10: (0, 1), 7: (1, 1), 5: (2, 1), 4: (-1, 1),
        6: (0, 2), 3: (1, 2), 1: (-1, 2),
        2: (0, 3),
    }  # fmt: skip
    position = {robot: (HOP_M * (x + 0.5 * (y % 2)), HOP_M * y * math.sin(SIXTY)) for robot, (x, y) in rows.items()}
    return Swarm(position, base=12)


def assigned(swarm: Swarm) -> Plan:
    sources = dict.fromkeys(swarm.scan.bases, 0.0)
    service = CheapestFirst(swarm.slots, 9, swarm.planner.attempt_log)
    (plan,) = service.assign(swarm.planner.plans(), swarm.scan, sources, swarm.routes)
    return plan


def test_figure_9a_the_path_from_the_source_to_a_frontier_robot_is_12_10_6_2() -> None:
    """Walls at both sides leave one direction of expansion: upwards, from robot 2."""
    swarm = figure_9()
    for robot in (12, 11, 8, 9, 10, 7, 5, 4, 6, 3, 1):
        swarm.touch(robot, *range(0, 360, 30))
    swarm.update()
    plan = assigned(swarm)
    assert [swarm.slots.occupant[slot] for slot in plan.path] == [12, 10, 6, 2]
    assert swarm.goal(plan)[1] > swarm.position[2][1] - 1e-9
    edges = {frozenset(each) for each in swarm.robots(swarm.planner.obstacle)}
    assert {frozenset((12, 11)), frozenset((11, 8)), frozenset((8, 9))} <= edges


DONE = Arrived(0, True, False, False, 0.95, ())
BY_ODOMETRY = Arrived(0, True, True, False, 0.95, ())
ASTRAY = Arrived(0, True, False, True, 0.95, ())  # its landmarks were driving


def pushed(swarm: Swarm, plan: Plan, ends: Mapping[int, Sequence[Arrived]]) -> list[tuple[int, RobotCommand]]:
    """Run a push, robot 13 waiting in the depot; return all commands. `ends` has the ends of some robots' first drives."""
    mailbox = CommandMailbox(0.1)
    base = swarm.scan.bases[0]
    station = swarm.slots.occupant[base]
    sources = Sources((), swarm.slots, mailbox)
    sources.stations[base] = station
    pushing = PushExecution(PlannerParameters(), swarm.slots, mailbox, sources, swarm.planner)
    pushing.scan = swarm.scan
    said: list[tuple[int, RobotCommand]] = []
    routine = pushing.push(plan)
    left = {robot: list(each) for robot, each in ends.items()}
    for tick in range(50):
        try:
            next(routine)
        except StopIteration:
            return said
        answers: list[tuple[int, Response]] = []
        for sent in mailbox.outgoing():
            request = read_request(sent.payload)
            assert request is not None
            assert sent.to is not None
            command = request.command
            said.append((sent.to, command))
            if isinstance(command, Release):
                emerged = Emerged(sightings_of(swarm, station, turned=0.4))
                answers.append((13, Response(1, 0, 0, 0, 0, emerged)))
            elif isinstance(command, Deploy):
                answers += [(sent.to, reply(request, each)) for each in (Cleared(0), DONE)]
            elif isinstance(command, Move | Correct):
                end = left[sent.to].pop(0) if left.get(sent.to) else DONE
                answers.append((sent.to, reply(request, end)))
        mailbox.receive(0.1 * tick, [Packet("uplink", write(each), sender) for sender, each in answers])
    raise AssertionError("the push never ends")


def reply(to: Request, answer: Answer) -> Response:
    return Response(1, to.incarnation, to.number, to.attempt, 1, answer)


def sightings_of(swarm: Swarm, robot: int, turned: float) -> tuple[Sighting, ...]:
    here = swarm.position[robot]
    return tuple(
        Sighting(other, math.remainder(direction(here, there) - turned, math.tau))
        for other, there in swarm.position.items()
        if other != robot and math.dist(here, there) <= 1.0
    )


def push_of_figure_9(ends: Mapping[int, Sequence[Arrived]]) -> tuple[Swarm, list[tuple[int, RobotCommand]]]:
    swarm = figure_9()
    slot = swarm.slot
    upwards = math.pi / 2.0 + swarm.off(2)
    plan = Plan((slot[2], slot[1], 1), slot[2], upwards, HOP_M, 0.8, (slot[2],), tuple(slot[n] for n in (12, 10, 6, 2)))
    return swarm, pushed(swarm.update(), plan, ends)


def test_figure_9b_robots_take_the_slots_ahead_and_robot_13_appears_beside_the_source() -> None:
    swarm, _ = push_of_figure_9({})
    now = {swarm.slots.occupant[swarm.slot[n]]: n for n in swarm.position}
    assert {robot: now[robot] for robot in (12, 13, 10, 6)} == {12: 12, 13: 10, 10: 6, 6: 2}
    assert [swarm.slots.occupant[max(swarm.slots.occupant)]] == [2], "robot 2 has a new place"
    assert all(now[robot] == robot for robot in (1, 3, 4, 5, 7, 8, 9, 11))


def test_figure_9b_landmarks_are_the_future_occupants_as_seen_from_the_goal() -> None:
    swarm, said = push_of_figure_9({})
    moves = {robot: command for robot, command in said if isinstance(command, Move)}
    assert sorted(moves) == [6, 10, 13]
    at_place = {13: 10, 10: 6, 6: 2}  # robot: the place where it goes, by the id of who was there
    turned = {**swarm.turned, 13: 0.4}
    for robot, command in moves.items():
        goal = swarm.position[at_place[robot]]
        assert {each.node for each in command.landmarks} & {2} == set(), "nobody refers to who goes into the unknown"
        for each in command.landmarks:
            there = swarm.position[at_place.get(each.node, each.node)]
            assert each.bearing_rad == pytest.approx(math.remainder(direction(goal, there) - turned[robot], math.tau))
            assert each.still == (each.node not in at_place)


def test_figure_9b_the_new_robot_corrects_its_distance_to_the_future_occupant_of_the_anchor() -> None:
    _, said = push_of_figure_9({})
    ((robot, command),) = [(robot, command) for robot, command in said if isinstance(command, Correct)]
    assert robot == 2
    assert isinstance(command, Correct)
    assert [each.node for each in command.anchors] == [6]


def test_a_robot_that_used_odometry_corrects_its_distance_to_the_robot_behind_by_a_given_bearing() -> None:
    """The robot may have driven so far that it sees no robot behind it."""
    swarm, said = push_of_figure_9({6: [BY_ODOMETRY], 10: [BY_ODOMETRY], 13: [BY_ODOMETRY]})
    commands = [(robot, command) for robot, command in said if isinstance(command, Correct)]
    assert [(robot, command.anchors[0].node) for robot, command in commands] == [(13, 12), (10, 13), (6, 10), (2, 6)]
    turned = {**swarm.turned, 13: 0.4}
    behind = {13: (10, 12), 10: (6, 10), 6: (2, 6)}  # robot: its place and the one behind, by who was there
    for robot, command in commands[:-1]:
        slot, rear = (swarm.position[each] for each in behind[robot])
        there = math.remainder(direction(slot, rear) - turned[robot], math.tau)
        assert command.anchors[0].bearing_rad == pytest.approx(there)


def test_robots_home_again_before_other_robots_correct_their_distances_to_them() -> None:
    _, said = push_of_figure_9({13: [ASTRAY], 10: [BY_ODOMETRY]})
    commands = [(robot, type(command)) for robot, command in said if isinstance(command, Move | Correct)]
    assert commands[3:] == [(13, Move), (10, Correct), (2, Correct)]


def test_a_robot_that_went_astray_is_no_landmark_of_the_next_until_it_has_returned() -> None:
    _, said = push_of_figure_9({13: [ASTRAY, ASTRAY], 10: [ASTRAY]})
    again = [(robot, command) for robot, command in said if isinstance(command, Move)][3:]
    assert [robot for robot, _ in again] == [13, 10, 13]
    still = [{each.node: each.still for each in command.landmarks} for _, command in again]
    assert (still[0][10], still[1][13], still[2][10]) == (False, False, True)


# --- one-sided sight, and frames ------------------------------------------------------------------------------------


def test_the_fence_opens_where_two_robots_do_not_both_see_each_other() -> None:
    """Four around a hub, 90 degrees apart and near enough to see each other: if one does not see the next, a side is open."""
    swarm = Swarm({n: at(90.0 * n, 0.65) for n in range(1, 5)} | {9: (0.0, 0.0)})
    boundary_edges = [(1, 2), (1, 4), (2, 3), (3, 4)]
    assert swarm.update().robots(side.edge for side in swarm.planner.fence.sides) == boundary_edges
    views = {slot: dict(view) for slot, view in swarm.scan.views.items()}
    del views[swarm.slot[1]][swarm.slot[2]]
    swarm.scan = ScanResult(views, FlagComplex(views), ())
    sides = swarm.update().robots(side.edge for side in swarm.planner.fence.sides)
    assert sides == [(1, 4), (1, 9), (2, 3), (2, 9), (3, 4)]
    inward = [swarm.goal(plan) for plan in (*swarm.plans(1, 9), *swarm.plans(2, 9))]
    assert all(math.dist(each, at(135.0, 0.65)) < 0.5 for each in inward), "the open sides are those of the gap"


def test_turning_any_robots_frame_changes_no_plan() -> None:
    random = np.random.default_rng(3)
    position = {n: (float(x), float(y)) for n, (x, y) in enumerate(random.uniform(0.0, 2.2, (22, 2)))}
    one, other = (Swarm(position, base=0, turned_seed=seed).update() for seed in (1, 2))
    for mine, theirs in zip(one.planner.plans(), other.planner.plans(), strict=True):
        assert [(each.key, each.mover, each.anchors) for each in mine] == [
            (each.key, each.mover, each.anchors) for each in theirs
        ]
        for a, b in zip(mine, theirs, strict=True):
            assert one.goal(a) == pytest.approx(other.goal(b))
    assert one.planner.frontier == other.planner.frontier != ()
    assert one.planner.obstacle == other.planner.obstacle
