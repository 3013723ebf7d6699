"""Parked bodies: the physics engine steps only moving bodies and those near them, without any effect on positions."""

import numpy as np
import pytest

from zwerm.scenario.tables import BodyTable
from zwerm.world.bodies import parking, physics
from zwerm.world.bodies.physics import Physics

SIDE = 14
COUNT = SIDE * SIDE
BODY = BodyTable(kind="holonomic", radius_m=0.05, max_speed_m_s=0.5, substeps=2)
WALLS = np.array([[0.0, 0.0, 20.0, 0.0], [20.0, 0.0, 20.0, 20.0], [20.0, 20.0, 0.0, 20.0], [0.0, 20.0, 0.0, 0.0]])


def grid() -> Physics:
    """Return robots on a grid of 1 m."""
    bodies = Physics(BODY, WALLS, COUNT, 0.1)
    for robot in range(COUNT):
        row, column = divmod(robot, SIDE)
        bodies.add(robot, np.array([1.0 + column, 1.0 + row]), 0.0)
    return bodies


def drive(bodies: Physics, ticks: int, robot: int, forward_m_s: float, left_m_s: float = 0.0) -> list[np.ndarray]:
    """Drive one robot, and return the positions after every tick."""
    forward, left = np.zeros(COUNT), np.zeros(COUNT)
    forward[robot], left[robot] = forward_m_s, left_m_s
    found = []
    for _ in range(ticks):
        bodies.advance(forward, left, np.zeros(COUNT))
        found.append(bodies.position.copy())
    return found


def in_engine(bodies: Physics) -> int:
    return len(bodies._space.bodies)


def test_robots_that_stand_still_far_from_others_leave_the_engine() -> None:
    bodies = grid()
    assert in_engine(bodies) == COUNT
    drive(bodies, 30, 0, 0.001)
    assert in_engine(bodies) <= 3


def test_a_small_swarm_and_one_of_which_many_move_park_no_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    bodies = grid()
    everyone = np.full(COUNT, 0.01)
    for _ in range(40):
        bodies.advance(everyone, None, np.zeros(COUNT))
    assert in_engine(bodies) == COUNT
    for module in (parking, physics):
        monkeypatch.setattr(module, "FEW_BODIES", COUNT)
    bodies = grid()
    drive(bodies, 40, 0, 0.001)
    assert in_engine(bodies) == COUNT


def test_a_robot_pushes_a_parked_row_as_it_pushes_one_that_was_never_parked(monkeypatch: pytest.MonkeyPatch) -> None:
    parked = grid()
    drive(parked, 40, COUNT - 1, 0.0001)
    assert in_engine(parked) < COUNT
    pushed = drive(parked, 60, 0, 0.5)
    for module in (parking, physics):
        monkeypatch.setattr(module, "FEW_BODIES", COUNT)
    never = grid()
    drive(never, 40, COUNT - 1, 0.0001)
    expected = drive(never, 60, 0, 0.5)
    assert expected[-1][2, 0] > 3.05, "the third robot of the row is pushed as well"
    assert np.abs(np.array(pushed) - np.array(expected)).max() < 1e-9


def test_a_parked_robot_drives_at_the_tick_of_its_command() -> None:
    bodies = grid()
    drive(bodies, 41, 0, 0.001)
    before = bodies.position[100].copy()
    [after] = drive(bodies, 1, 100, 0.5)
    assert after[100, 0] == pytest.approx(before[0] + 0.05)


def test_two_runs_that_park_are_bit_identical_and_another_drive_differs() -> None:
    def places(speed: float) -> bytes:
        bodies = grid()
        drive(bodies, 35, 7, 0.01)
        return np.array(drive(bodies, 60, 0, speed)).tobytes()

    assert places(0.5) == places(0.5)
    assert places(0.5) != places(0.49)


def test_a_robot_that_leaves_while_it_is_parked_is_gone() -> None:
    bodies = grid()
    drive(bodies, 40, 0, 0.001)
    for robot in range(60, COUNT):
        bodies.remove(robot)
    drive(bodies, 10, 0, 0.001)
    assert in_engine(bodies) == 60
