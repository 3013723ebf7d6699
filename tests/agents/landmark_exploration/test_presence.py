"""Navigation without bearings: places follow from what appears and disappears, and goals are reached by them."""

import math

import numpy as np
import pytest

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.motion import Drive
from zwerm.agents.landmark_exploration.presence import PresenceTracker, seek
from zwerm.agents.landmark_exploration.view import ExplorerView
from zwerm.wire.messages import LandmarkBearing, Observation

STEP, RANGE = 0.05, 1.0
LANDMARKS = np.random.default_rng(5).uniform(0.0, 6.0, (110, 2))


class Walk:
    """A robot on an open plane that senses which landmarks are within the range, and no bearing."""

    def __init__(self, at: tuple[float, float]) -> None:
        self.at = np.array(at)
        self.view = ExplorerView()
        self.tracker = PresenceTracker(RANGE / STEP)
        self.moved: float | None = None
        self.look()

    def seen(self, at: tuple[float, float] | None = None) -> tuple[int, ...]:
        here = self.at if at is None else np.array(at)
        return tuple(np.flatnonzero(np.hypot(*(LANDMARKS - here).T) <= RANGE).tolist())

    def look(self) -> None:
        readings = tuple(LandmarkBearing(each, 0.0) for each in self.seen())
        self.view.take(Observation(self.view.tick, 0.0, landmarks=readings, touch=(), compass_rad=0.0))
        self.tracker.update(self.view, self.moved)

    def step(self, direction: float | None) -> None:
        self.moved = direction
        if direction is not None:
            self.at = self.at + STEP * np.array([math.cos(direction), math.sin(direction)])
        self.look()

    def follow(self, drive: Drive, ticks: int) -> str:
        for _ in range(ticks):
            try:
                direction = next(drive)
            except StopIteration as end:
                return str(end.value)
            self.step(direction)
        return "still on the way"

    def errors(self) -> list[float]:
        """Return the errors of the places of the landmarks that appeared or disappeared at least three times [ranges]."""
        return [
            math.hypot(*(STEP * np.array(place) - (LANDMARKS[each] - self.at)))
            for each, place in self.tracker.places.items()
            if len(self.tracker.events(each)) >= 3
        ]


def test_a_landmark_that_appears_is_one_range_ahead() -> None:
    walk = Walk((1.0, 3.0))
    before = set(walk.view.bearing)
    while set(walk.view.bearing) <= before:
        before = set(walk.view.bearing)
        walk.step(0.0)
    (new, *_) = set(walk.view.bearing) - before
    assert walk.tracker.places[new] == (RANGE / STEP, 0.0)


def test_after_a_few_events_places_are_near_the_truth() -> None:
    walk, random = Walk((3.0, 3.0)), np.random.default_rng(1)
    for _ in range(40):
        direction = math.atan2(*(np.array([3.0, 3.0]) - walk.at)[::-1]) + random.normal(0.0, 1.5)
        for _ in range(12):
            walk.step(direction)
    errors = walk.errors()
    assert len(errors) >= 8
    assert np.median(errors) < 0.15


def test_a_place_long_out_of_sight_is_dropped() -> None:
    walk = Walk((0.5, 3.0))
    known = set(walk.view.bearing)
    for _ in range(100):
        walk.step(0.0)
    for _ in range(100):
        walk.step(None)
    assert known & set(walk.tracker.places) <= set(walk.view.bearing)


@pytest.mark.parametrize("seed", range(5))
def test_a_path_of_observations_leads_to_where_all_of_the_last_is_seen_in_a_few_tries(seed: int) -> None:
    walk = Walk((1.0, 1.0 + seed))
    places = [(x, y) for x, y in zip(np.linspace(1.0, 5.0, 7), np.linspace(1.0 + seed, 5.0 - seed, 7), strict=True)]
    path = [BearingSnapshot(seen, (0,) * len(seen)) for seen in map(walk.seen, places[1:])]
    goal = path[-1].landmarks

    def arrived() -> bool:
        return all(each in walk.view.bearing for each in goal)

    assert not arrived()
    random = np.random.default_rng(seed)
    ends = [walk.follow(seek(walk.tracker, walk.view, path, random, arrived), 3_000) for _ in range(4)]
    assert ends[-1] == "arrived"
    assert set(goal) <= set(walk.seen())


def test_a_goal_that_does_not_exist_is_given_up() -> None:
    walk = Walk((1.0, 1.0))
    nowhere = BearingSnapshot((500, 501), (0, 0))
    drive = seek(walk.tracker, walk.view, [nowhere], np.random.default_rng(1), lambda: False)
    assert walk.follow(drive, 3_000) == "unreached"
