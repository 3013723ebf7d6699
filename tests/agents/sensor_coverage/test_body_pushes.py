"""Bodies of dead robots beside a walking robot: which yield, which push back, and which points of the walk are at walls."""

import math
from collections.abc import Collection, Sequence

import pytest

from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, contains, united
from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.motion.locomotion import STOP
from zwerm.agents.sensor_coverage.motion.odometry_frame import OdometryFrame, Touched
from zwerm.agents.sensor_coverage.motion.walls.dead_bodies import (
    HELD_MAX,
    PUSH_TICKS,
    REST_TICKS,
    DeadBodies,
    HeldPoints,
)
from zwerm.agents.sensor_coverage.motion.walls.near_arcs import NearPoint, NearPoints, NearWay
from zwerm.wire.messages import BodyVelocity

BODY, OTHER = 9, 4
EAST = 0.0


class AtBody:
    """A robot in touch with a body. A velocity moves it by `fraction` of a full step.

    In ticks without one it moves back, by these fractions of a full step.
    """

    step_m = 0.05

    def __init__(self, fraction: float, *back: float) -> None:
        self.position = 0.0, 0.0
        self.frame = OdometryFrame()
        self.fraction, self._back = fraction, list(back)
        self.touch((BODY, EAST))

    def touch(self, *contacts: tuple[int | None, float]) -> None:
        """Touch robots or walls (None) in these directions [deg], and nothing else."""
        self.frame.contacts = tuple(Touched(math.radians(degrees), node) for node, degrees in contacts)

    def velocity(self, x_m: float, y_m: float) -> BodyVelocity:
        return BodyVelocity(x_m, y_m)

    def drive(self, velocity: BodyVelocity) -> None:
        """Move as one tick of this velocity does."""
        x, y = self.position
        back_m = self._back.pop(0) * self.step_m if velocity == STOP and self._back else 0.0
        self.position = x + self.fraction * velocity.forward_m_s - back_m, y + self.fraction * velocity.left_m_s


def bodies_of(robot: AtBody) -> DeadBodies:
    return DeadBodies(robot, (BODY,))


def push(robot: AtBody, bodies: DeadBodies, moved_m: float = 0.0, heading_deg: float = EAST) -> list[BodyVelocity]:
    """Carry out the push that begins after a step of this length [m] and heading, and return its velocities."""
    velocities = []
    while (velocity := bodies.step(moved_m, math.radians(heading_deg))) is not None:
        velocities.append(velocity)
        robot.drive(velocity)
    return velocities


def test_a_robot_pushes_a_body_that_stops_it_and_stands_still_then() -> None:
    robot = AtBody(fraction=0.0)
    assert push(robot, bodies_of(robot)) == [BodyVelocity(robot.step_m, 0.0)] * PUSH_TICKS + [STOP] * REST_TICKS


def test_a_body_that_does_not_yield_counts_as_wall() -> None:
    robot = AtBody(fraction=0.0)
    bodies = bodies_of(robot)
    push(robot, bodies)
    assert bodies.firm() == (EAST,)
    assert bodies.contacts() == [Touched(EAST, None)]


def test_a_body_that_yields_stops_nothing_and_is_no_wall() -> None:
    robot = AtBody(fraction=0.5)
    bodies = bodies_of(robot)
    push(robot, bodies)
    assert bodies.firm() == ()
    assert bodies.contacts() == []


@pytest.mark.parametrize("back", [(0.5, 0.0), (0.1, 0.1)])
def test_a_robot_that_pushes_back_lives_and_is_no_wall(back: tuple[float, ...]) -> None:
    robot = AtBody(0.0, *back)
    bodies = bodies_of(robot)
    push(robot, bodies)
    assert not bodies.is_body(BODY)
    assert bodies.firm() == ()
    assert bodies.contacts() == [Touched(EAST, BODY)]
    assert push(robot, bodies) == []


def test_bodies_that_spring_apart_in_one_tick_are_walls() -> None:
    """So far they were pressed against the walls of a wedge."""
    robot = AtBody(0.0, 0.3, 0.0)
    bodies = bodies_of(robot)
    push(robot, bodies)
    assert bodies.firm() == (EAST,)


@pytest.mark.parametrize(
    ("moved_m", "contact"),
    [
        pytest.param(0.0, (OTHER, 0.0), id="a living robot"),
        pytest.param(0.0, (BODY, 120.0), id="a body behind"),
        pytest.param(0.03, (BODY, 0.0), id="a body that the robot drives past"),
    ],
)
def test_a_robot_does_not_push(moved_m: float, contact: tuple[int, float]) -> None:
    robot = AtBody(fraction=0.0)
    robot.touch(contact)
    assert push(robot, bodies_of(robot), moved_m) == []


@pytest.mark.parametrize(("turned_deg", "pushes"), [(20.0, False), (30.0, True)])
def test_a_body_is_pushed_again_in_another_direction(turned_deg: float, pushes: bool) -> None:
    robot = AtBody(fraction=0.0)
    bodies = bodies_of(robot)
    push(robot, bodies)
    robot.touch((BODY, turned_deg))
    assert bool(push(robot, bodies, moved_m=robot.step_m)) == pushes
    assert bodies.firm() == (math.radians(turned_deg),)


def test_no_body_counts_as_wall_while_another_robot_is_in_touch() -> None:
    """The other robot may have held the body, and it may leave."""
    robot = AtBody(fraction=0.0)
    bodies = bodies_of(robot)
    push(robot, bodies)
    robot.touch((BODY, 0.0), (OTHER, 90.0))
    assert bodies.firm() == ()


def test_a_walk_forgets_the_bodies_of_the_walk_before() -> None:
    robot = AtBody(fraction=0.0)
    bodies = bodies_of(robot)
    push(robot, bodies)
    bodies.begin()
    assert bodies.contacts() == []


# --- points of a walk -------------------------------------------------------------------------------------------------

Touch = tuple[tuple[int | None, float], ...]
WALL_EAST: Touch = ((None, 0.0),)
WALL_SOUTH: Touch = ((None, -90.0),)


def reported(touches: Sequence[Touch], yields: Collection[int] = ()) -> list[Waypoint]:
    """Return the points that a robot reports of a walk that touches these things.

    The body yields to pushes at the points with the numbers `yields`.
    """
    robot = AtBody(fraction=0.0)
    bodies, points = bodies_of(robot), list[Waypoint]()
    held = HeldPoints(bodies, points.append)
    for number, touch in enumerate(touches):
        robot.touch(*touch)
        robot.fraction = 0.5 if number in yields else 0.0
        push(robot, bodies)
        contacts = robot.frame.contacts
        walls = tuple(each.bearing_rad for each in contacts if each.node is None)
        robots = tuple(each.node for each in contacts if each.node is not None)
        held.take(Waypoint(*robot.position, (), walls, robots))
    held.end()
    return points


def body_from(first_deg: float, last_deg: float) -> list[Touch]:
    """Return points of a walk from a wall to another one, at a body of which the direction turns."""
    return [WALL_EAST, ((BODY, first_deg),), ((BODY, (first_deg + last_deg) / 2.0),), ((BODY, last_deg),), WALL_SOUTH]


def test_a_body_in_a_corner_counts_as_wall() -> None:
    """The robot turns round it by a quarter turn, from one wall of the corner to the other."""
    points = reported(body_from(0.0, -90.0))
    assert [[round(math.degrees(each)) for each in point.touched] for point in points] == [
        [0],
        [0],
        [-45],
        [-90],
        [-90],
    ]
    assert not any(point.robots for point in points)


def test_a_body_that_the_robot_does_not_turn_round_is_no_wall() -> None:
    """It may lie in a bend, and fill the way on."""
    points = reported(body_from(0.0, -55.0))
    assert [bool(point.touched) for point in points] == [True, False, False, False, True]
    assert [point.robots for point in points[1:4]] == [(BODY,)] * 3


@pytest.mark.parametrize(
    ("other_deg", "is_wall"),
    [
        pytest.param(-25.0, True, id="an acute corner of 65 degrees"),
        pytest.param(-90.0, False, id="the other side of a passage"),
        pytest.param(90.0, False, id="the same wall"),
        pytest.param(45.0, False, id="the body is not beside the other wall"),
    ],
)
def test_a_body_in_an_acute_corner_counts_as_wall(other_deg: float, is_wall: bool) -> None:
    """The direction to it turns by 45 degrees from push to push, between walls that it leans on."""
    touches: list[Touch] = [((None, 90.0),), ((BODY, 0.0),), ((BODY, 26.0),), ((BODY, 45.0),), ((None, other_deg),)]
    assert [bool(point.touched) for point in reported(touches)] == [True, is_wall, is_wall, is_wall, True]


def test_a_body_that_yields_on_the_way_round_is_no_wall() -> None:
    """The robot has pushed it to another place: there may be a way where it was."""
    points = reported(body_from(0.0, -90.0), yields=(2,))
    assert [bool(point.touched) for point in points] == [True, False, False, False, True]


def test_points_at_a_body_are_reported_when_the_walk_ends_and_are_no_wall() -> None:
    points = reported(body_from(0.0, -90.0)[:-1])
    assert [bool(point.touched) for point in points] == [True, False, False, False]


def test_points_at_a_body_are_held_back_up_to_a_number() -> None:
    robot = AtBody(fraction=0.0)
    points = list[Waypoint]()
    held = HeldPoints(bodies_of(robot), points.append)
    for _ in range(HELD_MAX):
        held.take(Waypoint(0.0, 0.0, (), (), (BODY,)))
    assert not points
    held.take(Waypoint(0.0, 0.0, (), (), (BODY,)))
    assert len(points) == HELD_MAX + 1


@pytest.mark.parametrize("yields", [False, True])
def test_a_body_in_a_corner_close_to_the_start_closes_the_arc_to_the_corner_if_it_is_wall(yields: bool) -> None:
    """A robot at its slot follows the walls of a corner at (0.18, -0.15) m, round a body there."""
    robot, start = AtBody(fraction=0.0), (-0.1, 0.1)
    way = NearWay(start, 1, 0.07)
    bodies = bodies_of(robot)
    near = NearPoints(way, lambda _: None)
    held = HeldPoints(bodies, near.take)
    around = [
        ((0.11 + 0.14 * math.sin(turn), -0.08 + 0.14 * math.cos(turn)), turn) for turn in (0.0, -0.8, -math.pi / 2)
    ]
    touches: list[tuple[tuple[float, float], Touch]] = [
        ((0.11, 0.10), WALL_EAST),
        *((at, ((BODY, math.degrees(-turn) - 90.0),)) for at, turn in around),
        ((-0.08, -0.08), WALL_SOUTH),
    ]
    for number, (at, touch) in enumerate(touches):
        robot.touch(*touch)
        robot.fraction = 0.5 if yields and number == 2 else 0.0
        push(robot, bodies, heading_deg=-60.0)
        walls = tuple(math.radians(degrees) for node, degrees in touch if node is None)
        at_body = not walls
        waypoint = Waypoint(*at, (), walls, (BODY,) if at_body else ())
        near.expect(NearPoint(at, walls, at_body), waypoint, at_other=False)
        held.take(waypoint)
    held.end()
    to_corner = Arc(math.atan2(-0.15 - start[1], 0.18 - start[0]), 0.0)
    assert contains(united(Arc(*each) for each in way.walls().followed), to_corner) is not yields
