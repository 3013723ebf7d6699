"""Calls of the physics engine that are bound once do the same as pymunk's own methods."""

import sys
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from pymunk import batch

from zwerm.scenario.tables import BodyTable
from zwerm.world.bodies import engine_calls, physics
from zwerm.world.bodies.physics import Physics

COUNT = 12
WALLS = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 1.0, 1.0], [1.0, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]])


def poses() -> np.ndarray:
    """Return the poses of robots in a narrow arena, at every tick; one of them leaves, and comes back."""
    body = BodyTable(kind="holonomic", radius_m=0.08, max_speed_m_s=0.5, substeps=5, friction=0.3)
    swarm = Physics(body, WALLS, COUNT, 0.1)
    for robot in range(COUNT):
        row, column = divmod(robot, 4)
        swarm.add(robot, np.array([0.15 + 0.22 * column, 0.2 + 0.3 * row]), 0.5 * robot)
    random = np.random.Generator(np.random.Philox(2))
    found = []
    for tick in range(120):
        if tick == 40:
            swarm.remove(5)
        if tick == 80:
            swarm.add(5, np.array([0.5, 0.5]), 1.0)
        forward, left, turn = random.uniform(-0.5, 0.5, (3, COUNT))
        swarm.advance(forward, left, turn)
        found.append(np.column_stack([swarm.position, swarm.heading]))
    return np.array(found)


def test_bound_calls_move_bodies_as_pymunks_own_methods_do(monkeypatch: pytest.MonkeyPatch) -> None:
    bound = poses()
    assert np.abs(np.diff(bound, axis=0)).max() > 0.01, "the control: robots move"
    for name in ("substeps", "reader"):
        monkeypatch.setattr(physics, name, partial(getattr(engine_calls, name), library=None))
    assert np.array_equal(poses(), bound)


def test_the_locked_version_of_pymunk_has_the_names_that_are_bound() -> None:
    assert engine_calls.LIBRARY is not None


def test_a_pymunk_without_these_names_is_used_by_its_own_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymunk._chipmunk_cffi", SimpleNamespace())
    assert engine_calls._library() is None
    monkeypatch.setitem(sys.modules, "pymunk._chipmunk_cffi", None)
    assert engine_calls._library() is None


def test_no_buffer_is_made_when_bodies_enter_or_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    class Counted(batch.Buffer):
        """A buffer that counts: pymunk never frees one."""

        def __init__(self) -> None:
            made.append(self)
            super().__init__()

    monkeypatch.setattr(batch, "Buffer", Counted)
    swarm = Physics(
        BodyTable(kind="holonomic", radius_m=0.08, max_speed_m_s=0.5, continuous_collision=True), WALLS, 2, 0.1
    )
    counts = []
    for _ in range(5):
        for robot in range(2):
            swarm.add(robot, np.array([0.41 + 0.18 * robot, 0.5]), np.pi * robot)
        for _ in range(3):
            swarm.advance(np.full(2, 0.5), np.zeros(2), np.zeros(2))
        for robot in range(2):
            swarm.remove(robot)
        counts.append(len(made))
    assert len(set(counts)) == 1
