"""Robots that come out of a depot where there is no room: they overlap, and no wall lets them through."""

import numpy as np
import pytest

from zwerm.scenario.tables import BodyTable
from zwerm.world.bodies import physics
from zwerm.world.bodies.physics import Physics
from zwerm.world.geometry.segments import Segments

SIDE_M, ROBOTS, DT_S = 0.3, 6, 0.1
CORNERS = ((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M))
WALLS = np.array([(*a, *b) for a, b in zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True)])


def crowded() -> np.ndarray:
    """Let robots out at one point of a closet, one every third tick; return their places [m]."""
    bodies = Physics(BodyTable(radius_m=0.07), WALLS, ROBOTS, DT_S)
    still = np.zeros(ROBOTS)
    for robot in range(ROBOTS):
        bodies.add(robot, np.array([0.12, 0.15]), 0.0)
        for _ in range(3):
            bodies.advance(still.copy(), None, still)
    for _ in range(50):
        bodies.advance(still.copy(), None, still)
    return bodies.position


def test_no_robot_is_pushed_through_a_wall() -> None:
    places = crowded()
    assert ((places > 0.0) & (places < SIDE_M)).all()


def test_the_solver_alone_pushes_robots_through_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(physics, "_SHOVING_TICKS", 0)
    places = crowded()
    assert not ((places > 0.0) & (places < SIDE_M)).all()


def test_a_way_crosses_a_segment_if_its_ends_are_on_different_sides() -> None:
    wall = Segments.of(np.array([[0.0, 0.0, 1.0, 0.0]]))
    ways = {
        (0.5, 0.1, 0.5, -0.1): True,
        (0.5, -0.1, 0.5, 0.1): True,
        (0.0, 0.1, 0.4, -0.1): True,
        (0.5, 0.2, 0.5, 0.1): False,  # before it
        (1.2, 0.1, 1.2, -0.1): False,  # beside it
        (-0.1, 0.1, -0.1, -0.1): False,
        (0.2, 0.1, 0.8, 0.1): False,  # along it
        (0.5, 0.1, 0.5, 0.1): False,  # no way
    }
    here, there = (np.array([way[first : first + 2] for way in ways]) for first in (0, 2))
    assert wall.crossed(here, there).tolist() == list(ways.values())
