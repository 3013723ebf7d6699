"""Both phases of a task, in a plane without noise: the way along observations, and the line that is crossed."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot, to_steps
from zwerm.agents.landmark_exploration.motion import (
    CROSSED_TICKS,
    PROGRESS_TICKS,
    Drive,
    explore,
    homing,
    travel,
    wander,
)
from zwerm.agents.landmark_exploration.view import ExplorerView, Slide
from zwerm.wire.messages import Contact, LandmarkBearing, Observation

STEP = 0.05
LANDMARKS = {1: (0.0, 0.0), 2: (1.0, 0.0), 3: (0.5, 0.8), 4: (1.4, 0.7), 5: (2.0, 0.1), 6: (1.9, 0.9)}


class Plane:
    """A point robot that sees landmarks within 1 m, and touches a wall `above` which it cannot go."""

    def __init__(self, x: float, y: float, above: float = math.inf, heading: float = 0.0) -> None:
        self.x, self.y, self.above, self.heading = x, y, above, heading
        self.view = ExplorerView()
        self.tick = 0
        self.look()

    def look(self) -> None:
        near = [
            LandmarkBearing(each, math.atan2(y - self.y, x - self.x) - self.heading)
            for each, (x, y) in LANDMARKS.items()
            if math.hypot(x - self.x, y - self.y) <= 1.0
        ]
        touch = (Contact(math.pi / 2 - self.heading, 0.2),) if self.y >= self.above - 1e-9 else ()
        self.view.take(Observation(self.tick, 0.0, landmarks=tuple(near), compass_rad=self.heading, touch=touch))

    def follow(self, drive: Drive, ticks: int = 2_000) -> Any:
        for _ in range(ticks):
            try:
                direction = next(drive)
            except StopIteration as end:
                return end.value
            if direction is not None:
                self.x += STEP * math.cos(direction)
                self.y = min(self.y + STEP * math.sin(direction), self.above)
            self.tick += 1
            self.look()
        return None


def snapshot_at(x: float, y: float) -> BearingSnapshot:
    return Plane(x, y).view.snapshot


def random() -> np.random.Generator:
    return np.random.default_rng(1)


@pytest.mark.parametrize("start", [(0.4, 0.3), (0.7, -0.3), (0.2, 0.5)])
def test_the_bearing_controller_arrives_from_anywhere(start: tuple[float, float]) -> None:
    target = {each: math.atan2(y - 0.2, x - 0.6) for each, (x, y) in LANDMARKS.items() if each <= 3}
    plane = Plane(*start)
    for _ in range(200):
        length, direction = homing(plane.view.bearing, target)
        plane.x += 0.3 * STEP * length * math.cos(direction)
        plane.y += 0.3 * STEP * length * math.sin(direction)
        plane.look()
    assert math.hypot(plane.x - 0.6, plane.y - 0.2) < 0.05


def test_travel_passes_observations_that_share_two_landmarks() -> None:
    plane = Plane(0.3, 0.2)
    path = [snapshot_at(0.8, 0.4), snapshot_at(1.3, 0.4), snapshot_at(1.7, 0.5)]
    assert len(set(path[0].landmarks) & set(path[2].landmarks)) < len(path[0].landmarks)
    drive = travel(plane.view, path, random(), lambda: {5, 6} <= set(plane.view.bearing))
    assert plane.follow(drive) == "arrived"
    assert plane.x > 1.0


def test_travel_gives_up_where_nothing_on_the_path_is_seen() -> None:
    plane = Plane(0.3, 0.2)
    drive = travel(plane.view, [BearingSnapshot((90, 91), (0, 64))], random(), lambda: False)
    assert plane.follow(drive) == "unreached"


def test_travel_goes_all_the_way_back_to_a_vertex_where_the_next_is_lost_from_sight() -> None:
    """The vertex ahead is seen at every other tick only: a robot that aims at it whenever it can does not get on."""
    plane = Plane(0.4, 0.3)
    here, ahead = snapshot_at(0.3, 0.6), BearingSnapshot((90, 91), (0, 64))  # to the left, and down to the right
    aims: list[str] = []
    take = plane.look

    def look() -> None:
        take()
        if len(aims) % 2 == 0:
            plane.view.bearing |= {90: -0.8, 91: -0.2}
        aims.append("both" if 90 in plane.view.bearing else "one")

    plane.look = look  # type: ignore[method-assign]
    look()
    closest = math.inf
    drive = travel(plane.view, [here, ahead], random(), lambda: False)
    for _ in range(30):
        direction = next(drive)
        assert direction is not None
        plane.x, plane.y = plane.x + STEP * math.cos(direction), plane.y + STEP * math.sin(direction)
        plane.look()
        closest = min(closest, math.hypot(plane.x - 0.3, plane.y - 0.6))
    assert closest < 0.15


def test_travel_gives_up_without_progress_however_long_the_path_is() -> None:
    plane = Plane(0.3, 0.2, above=0.3)
    path = [snapshot_at(0.3, 0.9)] + [BearingSnapshot((90, 91), (0, 64))] * 50
    assert plane.follow(travel(plane.view, path, random(), lambda: False)) == "unreached"
    assert plane.tick < 2 * PROGRESS_TICKS


def test_exploring_ends_left_of_the_line_wherever_it_begins() -> None:
    for y in (-0.4, -0.05, 0.3):
        plane = Plane(0.5, y, heading=1.0)
        reached: list[float] = []

        def left(plane: Plane = plane, reached: list[float] = reached) -> bool:
            reached.append(plane.y)
            return plane.y > 0.1

        assert plane.follow(explore(plane.view, 1, 2, random(), left, 40, 40)) == "cleared"
        assert plane.y > 0.1


def test_a_wall_right_behind_the_line_is_an_obstacle_boundary() -> None:
    plane = Plane(0.5, -0.4, above=2 * STEP)
    assert plane.follow(explore(plane.view, 1, 2, random(), lambda: False, 40, 40)) == "boundary"


def test_a_wall_well_behind_the_line_is_none() -> None:
    plane = Plane(0.5, -0.4, above=STEP * (CROSSED_TICKS + 8))
    assert plane.follow(explore(plane.view, 1, 2, random(), lambda: False, 40, 40)) == "timed-out"


def test_minimal_effort_ends_one_tick_behind_the_line() -> None:
    plane = Plane(0.5, -0.4)
    assert plane.follow(explore(plane.view, 1, 2, random(), lambda: False, 40, 1)) == "timed-out"
    assert 0.0 < plane.y <= 2 * STEP


def test_a_frontier_whose_landmarks_are_not_seen_is_not_reached() -> None:
    plane = Plane(0.5, 0.3)
    assert plane.follow(explore(plane.view, 80, 81, random(), lambda: False, 40, 40)) == "unreached"


def view_with(contacts: tuple[float, ...], tick: int = 1) -> Any:
    return SimpleNamespace(contacts=contacts, tick=tick)


def test_sliding_leads_away_from_every_contact() -> None:
    slide = Slide(random())
    for contacts in ((0.0,), (0.3, 1.2), (math.pi / 2, math.pi)):
        for wanted in np.linspace(-math.pi, math.pi, 17):
            direction = slide.along(float(wanted), view_with(contacts))
            assert direction is not None
            assert all(math.cos(direction - each) <= 0.051 for each in contacts)


def test_sliding_keeps_its_hand_in_a_corner() -> None:
    slide = Slide(random())
    first = slide.along(0.2, view_with((0.0,), 1))
    second = slide.along(-0.2, view_with((0.0,), 2))
    assert first is not None
    assert second is not None
    assert math.sin(first) * math.sin(second) > 0.0


def test_no_hand_leads_round_and_round_in_a_corner() -> None:
    """From a corner at the origin a robot wants to go along the left wall: the other hand leads it down into the corner."""
    slide, place = Slide(random()), np.array([0.0, 0.02])
    slide.along(-1.3, view_with((-math.pi / 2,), 0))  # takes the hand that leads down
    for tick in range(1, 200):
        contacts = tuple(
            direction for near, direction in zip(place <= 0.01, (math.pi, -math.pi / 2), strict=True) if near
        )
        direction = slide.along(2.06, view_with(contacts, tick))
        assert direction is not None
        place = np.maximum(place + 0.05 * np.array([math.cos(direction), math.sin(direction)]), 0.0)
        if place[1] > 2.0:
            break
    assert place[1] > 2.0


def test_a_robot_that_is_shut_in_stands_still() -> None:
    shut_in = view_with(tuple(np.linspace(0.0, 6.0, 8)))
    assert Slide(random()).along(0.0, shut_in) is None
    assert Slide(random()).along(1.0, view_with(())) == 1.0


def test_wandering_turns_away_from_walls() -> None:
    plane = Plane(0.5, 0.5, above=0.5)
    drive = wander(plane.view, random())
    for _ in range(20):
        next(drive)
    plane.look()
    assert math.cos(next(drive) or 0.0) <= 1.0
    assert plane.follow(drive, 200) is None


def test_bearings_are_compass_bearings() -> None:
    straight, turned = Plane(0.4, 0.3), Plane(0.4, 0.3, heading=2.0)
    assert straight.view.snapshot == turned.view.snapshot
    assert to_steps(-math.pi) == to_steps(math.pi) == 128
