"""Which of several robots in one direction a walking robot touches: the next steps of its walk show it."""

import math

import msgspec
import numpy as np
import pytest

from zwerm.agents.sensor_coverage.messages.commands import Sighting, Waypoint
from zwerm.agents.sensor_coverage.motion.walls.touched_robots import POINTS_MAX, TouchedRobots

RADIUS_M = 0.07
NOISE_RAD = math.pi / 72.0
# The walking robot comes from the west along a wall, touches robot 7 at (0, 0), and passes it. Robot 8 is behind robot 7.
PLACES = {7: (0.14, 0.0), 8: (0.74, 0.0)}
CONTACT = (0.0, 0.0)
PASSING = ((0.0, 0.05), (0.04, 0.1), (0.09, 0.13), (0.14, 0.14), (0.19, 0.13), (0.24, 0.1))


def points(way: tuple[tuple[float, float], ...], supposed: int, seed: int) -> list[Waypoint]:
    """Return the points of a walk. At the first one the contact is supposed to be with one robot."""
    random = np.random.Generator(np.random.Philox(seed))
    found = []
    for x_m, y_m in way:
        seen = tuple(
            Sighting(node, math.atan2(y - y_m, x - x_m) + random.normal(0.0, NOISE_RAD))
            for node, (x, y) in PLACES.items()
        )
        touched = (supposed,) if (x_m, y_m) == CONTACT else ()
        found.append(Waypoint(x_m, y_m, seen, (-math.pi / 2.0,) if touched else (), touched))
    return found


def reported(way: tuple[tuple[float, float], ...], supposed: int, seed: int = 1) -> list[Waypoint]:
    """Return the points that are reported; each contact may be with robot 7 or with robot 8."""
    found = list[Waypoint]()
    judge = TouchedRobots(RADIUS_M, found.append)
    for point in points(way, supposed, seed):
        if point.robots:
            judge.note(point.x_m, point.y_m, [(0.0, (supposed, 15 - supposed))])
        judge.take(point)
    judge.end()
    return found


@pytest.mark.parametrize("supposed", [7, 8])
@pytest.mark.parametrize("seed", range(20))
def test_the_robot_in_touch_is_the_one_whose_bearing_changes(supposed: int, seed: int) -> None:
    found = reported((CONTACT, *PASSING), supposed, seed)
    assert [(each.x_m, each.y_m) for each in found] == [CONTACT, *PASSING]
    assert [each.robots for each in found] == [(7,), *[()] * len(PASSING)]


def test_a_contact_that_stays_uncertain_is_with_none() -> None:
    """The walking robot turns back on the line on which both robots are."""
    back = tuple((-0.05 * step, 0.0) for step in range(1, POINTS_MAX + 2))
    assert [each.robots for each in reported((CONTACT, *back), 7)] == [()] * (POINTS_MAX + 2)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(
    ("x_m", "walls", "robots"),
    [
        pytest.param(0.14, (-math.pi / 2.0,), (7,), id="the robot is in touch"),
        pytest.param(0.55, (-math.pi / 2.0, 0.1), (), id="a wall ends there, and the robot is behind the corner"),
    ],
)
def test_a_contact_with_a_robot_that_is_far_away_is_one_with_a_wall(
    x_m: float, walls: tuple[float, ...], robots: tuple[int, ...], seed: int
) -> None:
    found = list[Waypoint]()
    judge = TouchedRobots(RADIUS_M, found.append)
    for point in points((CONTACT, *PASSING), 7, seed):
        bearing = math.atan2(-point.y_m, x_m - point.x_m) + math.remainder(
            point.sightings[0].bearing_rad - math.atan2(-point.y_m, PLACES[7][0] - point.x_m), math.tau
        )
        if point.robots:
            judge.note(point.x_m, point.y_m, [(0.1, (7,))])
        judge.take(msgspec.structs.replace(point, sightings=(Sighting(7, bearing),)))
    judge.end()
    assert (found[0].touched, found[0].robots) == (walls, robots)


def test_a_contact_with_one_robot_stays_one_if_nothing_shows_how_far_away_it_is() -> None:
    found = list[Waypoint]()
    judge = TouchedRobots(RADIUS_M, found.append)
    first = points((CONTACT,), 7, 1)[0]
    judge.note(*CONTACT, [(0.0, (7,))])
    judge.take(first)
    assert found == [], "the next points may show it"
    judge.end()
    assert found == [first]


def with_robot_at(place: tuple[float, float], way: tuple[tuple[float, float], ...], hidden: int = 0) -> Waypoint:
    """Return the first point of a way in touch with something in line with robot 7, which is hidden at the next points."""
    found = list[Waypoint]()
    judge = TouchedRobots(RADIUS_M, found.append)
    for number, (x_m, y_m) in enumerate(way):
        seen = () if 1 <= number <= hidden else (Sighting(7, math.atan2(place[1] - y_m, place[0] - x_m)),)
        if number == 0:
            judge.note(x_m, y_m, [(0.0, (7,))])
        judge.take(Waypoint(x_m, y_m, seen, (), (7,) if number == 0 else ()))
    judge.end()
    return found[0]


AWAY = (CONTACT, (-0.02, 0.03), (-0.04, 0.06), (-0.06, 0.09), (-0.08, 0.12), (-0.1, 0.15), (-0.12, 0.18))


@pytest.mark.parametrize(("distance_m", "robots"), [(0.14, (7,)), (0.6, ())])
def test_a_robot_that_drives_away_from_a_corner_does_not_take_it_for_a_robot(
    distance_m: float, robots: tuple[int, ...]
) -> None:
    """The bearings of robot 7 are off by less than 20 degrees all the time if it is in touch, or not."""
    assert with_robot_at((distance_m, 0.0), AWAY).robots == robots


@pytest.mark.parametrize(("hidden", "robots"), [(0, (7,)), (2, ())])
def test_a_robot_that_goes_out_of_sight_at_once_is_not_in_touch(hidden: int, robots: tuple[int, ...]) -> None:
    assert with_robot_at((0.14, 0.0), AWAY[: 1 + hidden] + AWAY[3:], hidden).robots == robots


def test_a_robot_on_another_one_is_in_touch_with_it() -> None:
    """As the first robot at its station, which it leaves: its bearing turns by more than that of a robot beside it."""
    assert with_robot_at((0.01, 0.0), AWAY).robots == (7,)
