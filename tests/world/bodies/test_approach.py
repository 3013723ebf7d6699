"""Continuous collision: bodies that meet stop where they touch, at any speed, also between walls and in a crowd."""

import subprocess
import sys
from itertools import combinations

import numpy as np
import pytest

from zwerm.scenario.tables import BodyTable
from zwerm.world.bodies.physics import Physics

RADIUS_M = 0.25
SLOP_M = 1e-5
SIDE_M = 2.0
WALLS = np.array(
    [
        [0.0, 0.0, SIDE_M, 0.0],
        [SIDE_M, 0.0, SIDE_M, SIDE_M],
        [SIDE_M, SIDE_M, 0.0, SIDE_M],
        [0.0, SIDE_M, 0.0, 0.0],
    ]
)


def bodies(positions: list[tuple[float, float]], *, continuous: bool, friction: float = 0.0) -> Physics:
    """Return robots in a room, at 1 m/s at most and 12.5 mm a substep."""
    body = BodyTable(
        kind="holonomic",
        radius_m=RADIUS_M,
        max_speed_m_s=1.0,
        substeps=4,
        friction=friction,
        continuous_collision=continuous,
    )
    found = Physics(body, WALLS, len(positions), 0.05)
    for robot, position in enumerate(positions):
        found.add(robot, np.array(position), 0.0)
    return found


def overlap_m(swarm: Physics) -> float:
    return max(2.0 * RADIUS_M - float(np.hypot(*(a - b))) for a, b in combinations(swarm.position, 2))


def drawn_overlap_m(seed: int, friction: float, *, continuous: bool) -> float:
    """Return the greatest overlap while six robots drive about a room that they half fill."""
    draws = np.random.default_rng(seed)
    swarm = bodies(
        [(0.3 + 0.55 * (k % 3), 0.3 + 0.55 * (k // 3)) for k in range(6)], continuous=continuous, friction=friction
    )
    worst = 0.0
    for tick in range(100):
        if tick % 10 == 0:
            course = draws.uniform(0.0, 2.0 * np.pi, 6)
            drive = np.cos(course), np.sin(course), draws.uniform(-1.0, 1.0, 6)
        swarm.advance(*drive)
        worst = max(worst, overlap_m(swarm))
    return worst


@pytest.mark.parametrize("continuous", [True, False])
def test_two_robots_that_meet_head_on_overlap_only_without_continuous_collision(continuous: bool) -> None:
    swarm = bodies([(0.4, 1.0), (1.593, 1.0)], continuous=continuous)
    drive, still = np.array([1.0, -1.0]), np.zeros(2)
    worst = 0.0
    for _ in range(20):
        swarm.advance(drive, still, still)
        worst = max(worst, overlap_m(swarm))
    assert (worst <= SLOP_M) == continuous
    assert overlap_m(swarm) > -1e-3, "they did not meet"


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_robots_that_crowd_between_walls_never_overlap(seed: int, friction: float) -> None:
    assert drawn_overlap_m(seed, friction, continuous=True) <= SLOP_M
    assert drawn_overlap_m(seed, friction, continuous=False) > 1e-3


def test_a_robot_still_pushes_another_and_slides_along_it() -> None:
    swarm = bodies([(0.4, 1.0), (1.0, 1.0)], continuous=True)
    forward, left = np.array([0.5, 0.0]), np.zeros(2)
    for _ in range(40):
        swarm.advance(forward, left, np.zeros(2))
    assert swarm.position[1, 0] > 1.2, "the second robot was not pushed"
    before = swarm.position[0].copy()
    forward, left = np.array([0.1, 0.0]), np.array([0.3, 0.0])
    for _ in range(20):
        swarm.advance(forward, left, np.zeros(2))
    assert swarm.position[0, 1] - before[1] > 0.2, "the first robot did not slide"


def test_robots_that_meet_nobody_move_as_they_do_without_it() -> None:
    ends = []
    for continuous in (True, False):
        swarm = bodies([(0.4, 0.4), (1.6, 1.6)], continuous=continuous)
        for _ in range(10):
            swarm.advance(np.array([0.4, -0.4]), np.array([0.1, 0.2]), np.array([0.3, 0.5]))
        ends.append(swarm.position.copy())
    assert np.array_equal(ends[0], ends[1])


@pytest.mark.parametrize("scenario", ["gossip-max", "robot-teams-one"])
def test_only_runs_with_continuous_collision_import_scipy(scenario: str) -> None:
    script = f"import sys, zwerm\nzwerm.run({scenario!r}, runner='inline', overrides=['time.duration_s=0.2'])\n"
    command = [sys.executable, "-c", script + "print('scipy' in sys.modules)"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == str(scenario == "robot-teams-one")
