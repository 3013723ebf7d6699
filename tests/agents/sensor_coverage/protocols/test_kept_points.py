"""Points of a walk that a robot receives before it has a view of its slot: they count once it has one."""

import math
from collections.abc import Callable

import pytest

from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.strips.stretches import StretchTracker
from zwerm.agents.sensor_coverage.frontier.wall_proof import mark_of
from zwerm.agents.sensor_coverage.local_node import MAKERS
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, SeenRobot, StateBeacon
from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.messages.pushes import ProvedArc
from zwerm.agents.sensor_coverage.messages.walls import ArcClosed, DeadInSight, NeighbourProved, PassedPoint
from zwerm.agents.sensor_coverage.neighbourhood.local_map import LocalMap
from zwerm.agents.sensor_coverage.protocols.component import Outgoing
from zwerm.agents.sensor_coverage.protocols.walls.wall_protocol import WallProtocol
from zwerm.agents.sensor_coverage.protocols.walls.wall_records import message_of

# The robot, its neighbour in the east, and the walking robot, which follows a wall in the south from west to east; their slots.
# Another robot takes the slot of the neighbour over.
ME, NEIGHBOUR, WALKER, HEIR = 7, 8, 9, 10
SLOTS = {ME: 4, NEIGHBOUR: 5, WALKER: 17, HEIR: 5}
# So far off [rad] is the direction to a robot that does not stand at its slot.
OFF_RAD = 0.5
# Directions [deg] to the points of the walk from the robot and its neighbour.
WAY = ({ME: -70.0}, {ME: -45.0, NEIGHBOUR: -135.0}, {ME: -30.0, NEIGHBOUR: -110.0})
STEPS_DEG, TRIANGLE_DEG = 40.0, 30.0


def state(node: int, number: int, epoch: int, moving: bool, *seen: SeenRobot, displaced: bool = False) -> StateBeacon:
    return StateBeacon(number, SLOTS[node], epoch, moving, False, 1, seen, (), (), NO_PATH_VECTOR, displaced=displaced)


class Here:
    """A robot at a slot that it has just taken: it has received states, and has not averaged a bearing yet."""

    on_step: Callable[[Waypoint], None] = staticmethod(lambda _: None)
    node = ME
    radius_m = 0.0

    def __init__(self) -> None:
        self.local_map = LocalMap(ME, PlannerParameters(walls="followed"), MAKERS)
        self.local_map.occupy(SLOTS[ME])
        self.local_map.heading = 0.0
        self.hear_neighbour(1, 3)
        self.local_map.receive(WALKER, state(WALKER, 1, 2, True), 0)
        self.dead, self.said_dead = dict[int, None](), dict[int, None]()
        self.told_dead: tuple[int, ...] = ()
        self.walls = WallProtocol(self)
        self.walk = StretchTracker(-1, self.radius_m)
        self.sees = dict[int, float]()

    @property
    def wall_walk(self) -> "Here":
        return self

    @property
    def settled(self) -> bool:
        return bool(self.local_map.samples) and self.local_map.settled(self.sees, 0)

    def hear_neighbour(self, number: int, epoch: int, displaced: bool = False) -> None:
        seen = SeenRobot(ME, self.local_map.epoch, SLOTS[ME], math.pi)
        self.local_map.receive(NEIGHBOUR, state(NEIGHBOUR, number, epoch, False, seen, displaced=displaced), 0)

    def look(self) -> None:
        self.sees = {NEIGHBOUR: 0.0, WALKER: -0.3}
        self.local_map.update_bearings(self.sees)

    def watch_walk(self, last: int = len(WAY)) -> None:
        for number, point in enumerate(WAY[:last], 1):
            seen = tuple((node, math.radians(each)) for node, each in point.items())
            self.pass_point(number, seen, (math.radians(-90.0),))
            self.walls.poll(0)

    def pass_point(
        self, number: int, seen: tuple[tuple[int, float], ...], walls: tuple[float, ...], robots: tuple[int, ...] = ()
    ) -> None:
        """Let a point of the walk be received."""
        self.walk.take(number, (0.0, 0.0), walls, robots, [node for node, _ in seen])
        stretch = None if self.walk.latest is None else message_of(self.walk.latest)
        self.walls.receive(WALKER, PassedPoint(1, number, -1, 1, seen, walls, robots, (0.0, 0.0), stretch), 0)

    @property
    def closed_deg(self) -> float:
        return 360.0 - math.degrees(sum(each.width_rad for each in self.local_map.proof.open_arcs()))


def test_points_of_a_walk_are_taken_once_the_robot_has_a_view_of_its_slot() -> None:
    """The walking robot is in sight all the time, and moves: its state agrees with no view."""
    here = Here()
    here.watch_walk()
    assert here.walls.outgoing() == []
    here.look()
    here.walls.poll(0)
    assert here.closed_deg == pytest.approx(STEPS_DEG + TRIANGLE_DEG)
    assert Outgoing(WALKER, ArcClosed(1)) in here.walls.outgoing()


def test_a_kept_point_does_not_count_for_a_robot_that_has_moved_since() -> None:
    here = Here()
    here.watch_walk()
    here.hear_neighbour(2, 4)
    here.look()
    here.walls.poll(0)
    assert here.closed_deg == pytest.approx(STEPS_DEG), "the triangle with the neighbour does not count"


@pytest.mark.parametrize("looks_first", [True, False])
def test_a_neighbour_that_was_pushed_away_from_its_slot_is_no_witness(looks_first: bool) -> None:
    here = Here()
    here.hear_neighbour(2, 3, displaced=True)
    if looks_first:
        here.look()
    here.watch_walk()
    if not looks_first:
        here.look()
        here.walls.poll(0)
    assert here.closed_deg == pytest.approx(STEPS_DEG), "the triangle with the neighbour does not count"
    here.hear_neighbour(3, 3)
    here.watch_walk()
    assert here.closed_deg == pytest.approx(STEPS_DEG + TRIANGLE_DEG), "it is back"


def test_kept_points_do_not_count_for_a_robot_that_has_moved_itself() -> None:
    here = Here()
    here.watch_walk()
    here.local_map.begin_drive()
    here.local_map.end_drive()
    here.hear_neighbour(2, 3)
    here.look()
    here.walls.poll(0)
    assert here.closed_deg == pytest.approx(0.0)
    here.watch_walk()
    assert here.closed_deg == pytest.approx(STEPS_DEG + TRIANGLE_DEG), "the next walk counts"


def test_points_of_a_robot_that_restarts_are_dropped() -> None:
    here = Here()
    here.watch_walk()
    here.walls.restarted(WALKER, 0)
    here.look()
    here.walls.poll(0)
    assert here.closed_deg == pytest.approx(0.0)


def test_a_robot_informs_its_neighbour_of_an_arc_that_the_neighbour_cannot_prove() -> None:
    """The neighbour did not see the first point of the walk."""
    here = Here()
    here.look()
    here.walls.poll(0)
    here.watch_walk()
    found = [each for each in here.walls.outgoing() if isinstance(each.message, NeighbourProved)]
    assert [(each.to, each.message.slot) for each in found] == [(NEIGHBOUR, SLOTS[NEIGHBOUR])]
    there = Here()
    there.look()
    there.local_map.update_proof()
    for slot in (99, SLOTS[ME]):
        assert there.closed_deg == pytest.approx(0.0)
        there.walls.receive(NEIGHBOUR, NeighbourProved(slot, ProvedArc((SLOTS[ME],), (SLOTS[NEIGHBOUR],), 0.0, 0.5)), 0)
    assert math.radians(there.closed_deg) == pytest.approx(0.5)


def test_a_slot_whose_robot_has_left_during_the_walk_is_informed_of_nothing() -> None:
    """The triangle was made of the point before."""
    here = Here()
    here.look()
    here.local_map.update_proof()
    here.local_map.proof.for_neighbours.append((99, ProvedArc((4,), (99,), 0.0, 0.5)))
    here.watch_walk(last=1)
    assert not any(isinstance(each.message, NeighbourProved) for each in here.walls.outgoing())
    assert here.local_map.proof.for_neighbours == []


# --- robots in touch with the walking robot, and dead robots -----------------------------------------------------------

BODY = 10


def seen_body(here: Here, number: int, direction_deg: float, walls: bool, touches: bool, sees: bool = False) -> None:
    """Have a point of a walk received, at which the walking robot touches walls, or touches or sees a robot without a slot."""
    seen = ((ME, math.radians(direction_deg)), *(((BODY, 1.0),) if sees else ()))
    touched = (math.radians(-90.0),) if walls else ()
    here.pass_point(number, seen, touched, (BODY,) if touches else ())


@pytest.mark.parametrize(("touches", "closed_deg"), [(False, 40.0), (True, 0.0)])
def test_a_robot_whose_slot_is_unknown_is_no_wall(touches: bool, closed_deg: float) -> None:
    """The walking robot turns round in front of it, from one wall of a passage to the other."""
    here = Here()
    here.look()
    here.local_map.update_proof()
    seen_body(here, 1, -70.0, True, False)
    seen_body(here, 2, -50.0, False, touches)
    seen_body(here, 3, -30.0, True, False)
    assert here.closed_deg == pytest.approx(closed_deg)


def test_points_that_a_robot_without_a_slot_saw_count_until_it_is_dead() -> None:
    here = Here()
    here.look()
    here.local_map.update_proof()
    seen_body(here, 1, -70.0, True, False, sees=True)
    seen_body(here, 2, -30.0, True, False, sees=True)
    assert here.closed_deg == pytest.approx(40.0)
    here.local_map.remove_dead(BODY)
    assert here.closed_deg == pytest.approx(0.0)


@pytest.mark.parametrize(("told", "closed_deg"), [((), 0.0), ((BODY,), 40.0)])
def test_a_robot_that_was_dead_before_the_walk_is_no_witness(told: tuple[int, ...], closed_deg: float) -> None:
    """Each wave of the census says who is dead: what such a walk closed stays closed."""
    here = Here()
    here.look()
    here.local_map.update_proof()
    here.told_dead = told
    seen_body(here, 1, -70.0, True, False, sees=True)
    seen_body(here, 2, -30.0, True, False, sees=True)
    here.local_map.proof.lose(mark_of(BODY))
    assert here.closed_deg == pytest.approx(closed_deg)


def test_a_walking_robot_is_told_once_which_robots_in_sight_are_dead() -> None:
    here = Here()
    here.dead[BODY] = None
    for number in (1, 2):
        seen_body(here, number, -70.0, True, False, sees=True)
    warnings = [each for each in here.walls.outgoing() if isinstance(each.message, DeadInSight)]
    assert warnings == [Outgoing(WALKER, DeadInSight(1, (BODY,)))]
    here.walls.begin(1, -1)
    here.walls.receive(NEIGHBOUR, DeadInSight(1, (BODY,)), 0)
    assert list(here.said_dead) == [BODY]
    here.walls.begin(2, -1)
    assert not here.said_dead, "another walk"


@pytest.mark.parametrize(
    ("node", "off_rad", "kept_deg"),
    [
        pytest.param(NEIGHBOUR, OFF_RAD, 0.0, id="this robot stands elsewhere"),
        pytest.param(HEIR, OFF_RAD, 0.0, id="another robot at the neighbour's slot stands elsewhere"),
        pytest.param(HEIR, 0.1, STEPS_DEG + TRIANGLE_DEG, id="another robot at the neighbour's slot"),
    ],
)
def test_what_a_former_robot_saw_of_walls_falls_where_one_stands_elsewhere(
    node: int, off_rad: float, kept_deg: float
) -> None:
    """The neighbour's slot saw the walk, too."""
    here = Here()
    here.look()
    here.walls.poll(0)
    here.watch_walk()
    here.local_map.learn_references()
    assert here.closed_deg == pytest.approx(STEPS_DEG + TRIANGLE_DEG)
    here.local_map.forget(NEIGHBOUR)
    seen = SeenRobot(ME, here.local_map.epoch, SLOTS[ME], math.pi + off_rad)
    here.local_map.receive(node, state(node, 3, 5, False, seen), 0)
    here.local_map.update_bearings({node: off_rad})
    here.local_map.learn_references()
    assert here.closed_deg == pytest.approx(kept_deg)


@pytest.mark.parametrize(("displaced", "closed_deg"), [(False, STEPS_DEG + TRIANGLE_DEG), (True, 0.0)])
def test_a_robot_that_was_pushed_away_takes_no_point_for_its_slot(displaced: bool, closed_deg: float) -> None:
    here = Here()
    here.look()
    here.walls.poll(0)
    here.local_map.set_displaced(displaced)
    assert here.local_map.state(False).displaced is displaced
    here.watch_walk()
    assert here.closed_deg == pytest.approx(closed_deg)
