"""The point to drive to: by landmarks that stand still, else by odometry while the other landmarks drive."""

import math
from typing import Final

import pytest

from zwerm.agents.sensor_coverage.messages.commands import Landmark
from zwerm.agents.sensor_coverage.motion.landmark_target import target_point

HOP_M: Final = 0.95
# The robot is at (0, 0), its goal here [m], and the landmarks stand here [m].
GOAL: Final = 0.06, 0.03
STANDING: Final = {1: (0.95, 0.0), 2: (0.475, 0.82)}


def landmarks(still: dict[int, bool]) -> list[Landmark]:
    there = {node: (x - GOAL[0], y - GOAL[1]) for node, (x, y) in STANDING.items()}
    return [Landmark(node, math.atan2(y, x), still[node]) for node, (x, y) in there.items()]


def seen(moved_m: float = 0.0) -> dict[int, float]:
    """Return the bearings of the landmarks, of which the second is still on its way."""
    return {1: math.atan2(*reversed(STANDING[1])), 2: math.atan2(STANDING[2][1], STANDING[2][0] - moved_m)}


def test_landmarks_that_stand_still_determine_the_offset() -> None:
    target = target_point(landmarks({1: True, 2: True}), seen(), (0.5, 0.5), HOP_M)
    assert (target.x, target.y) == pytest.approx(GOAL, abs=0.01)
    assert not target.used_moving_landmarks


def test_odometry_and_not_a_landmark_on_its_way_determines_the_offset() -> None:
    """The bearing of the second landmark is off by 36 degrees, which is an offset of half a hop."""
    target = target_point(landmarks({1: True, 2: False}), seen(0.5), GOAL, HOP_M)
    assert (target.x, target.y) == pytest.approx(GOAL)
    assert target.used_moving_landmarks, "it homes again when the landmark stands"


def test_without_a_known_way_landmarks_on_their_way_determine_the_offset() -> None:
    """The former robot at the slot never saw the robot that comes from outside the complex."""
    target = target_point(landmarks({1: True, 2: False}), seen(), None, HOP_M)
    assert (target.x, target.y) == pytest.approx(GOAL, abs=0.01)
    assert target.used_moving_landmarks, "it homes again when the landmark stands"
    lonely = target_point(landmarks({1: True, 2: False})[:1], seen(), None, HOP_M)
    assert (lonely.x, lonely.y) == (0.0, 0.0)
    assert lonely.used_odometry
