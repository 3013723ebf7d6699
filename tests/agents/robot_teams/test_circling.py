"""Two robots that circle each other come free, and a robot that others led away from its boundary gives no fact about it."""

import math

import numpy as np
import pytest

from zwerm.agents.robot_teams.mapping.facts import BOTTOM, RIGHT, TOP, End
from zwerm.agents.robot_teams.motion.manoeuvres import BoundaryTrace, SliceGrid
from zwerm.agents.robot_teams.motion.pilot import CIRCLE_S, DONE, FAILED, Headway, Pilot
from zwerm.agents.robot_teams.motion.senses import GAP_M, Beside, Senses

DT_S, SPEED_M_S, RADIUS_M = 0.05, 1.0, 0.25
GRID = SliceGrid(0.0, 0.95)
CORNER = End(0, TOP, 5_000)


def senses(tick: int, places: np.ndarray, before: np.ndarray, node: int) -> Senses:
    """Return what robot `node` of two senses in open space."""
    (x, y), (u, v), (was_u, was_v) = places[node], places[1 - node], before[1 - node]
    apart = math.hypot(u - x, v - y)
    gap = apart - 2.0 * RADIUS_M - GAP_M
    beside = Beside(1 - node, u, v, (u - x) / apart, (v - y) / apart, gap, u - was_u, v - was_v)
    return Senses(tick, x, y, (), (beside,))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_robots_that_trace_around_each_other_come_free(seed: int) -> None:
    """Both keep the body of the other on their hand."""
    pilots = [Pilot(node, SPEED_M_S, DT_S, np.random.default_rng([seed, node])) for node in (0, 1)]
    for pilot in pilots:
        pilot.start(BoundaryTrace(CORNER, RIGHT, GRID, lambda senses: []))
    places = before = np.array([[0.475, 4.72], [0.475, 4.16]])
    for tick in range(round(3.0 * CIRCLE_S / DT_S)):
        found = [senses(tick, places, before, node) for node in (0, 1)]
        before, velocity = places, np.array([pilot.step(each) for pilot, each in zip(pilots, found, strict=True)])
        places = places + DT_S * velocity
        if any(pilot.state in (DONE, FAILED) for pilot in pilots):
            return
    pytest.fail(f"both still trace, at {places.tolist()}")


def circling(seconds: float, radius_m: float, touches: bool) -> Headway:
    headway = Headway(DT_S)
    for tick in range(round(seconds / DT_S)):
        angle = SPEED_M_S * DT_S * tick / radius_m
        headway.note(Senses(tick, radius_m * math.cos(angle), radius_m * math.sin(angle), (), ()), touches)
    return headway


def test_small_circles_beside_robots_are_no_headway() -> None:
    assert circling(CIRCLE_S + 1.0, 0.6, True).circles
    assert not circling(CIRCLE_S + 1.0, 0.6, True).stands
    assert not circling(CIRCLE_S - 1.0, 0.6, True).circles
    assert not circling(CIRCLE_S + 1.0, 0.6, False).circles, "alone, it follows a small boundary"
    assert not circling(10.0 * CIRCLE_S, 3.0, True).circles


def traced(away_m: float) -> BoundaryTrace:
    """Follow a wall along y = 5 from slice 0, then one `away_m` below it, to slice 1. Bodies lead from one to the other."""
    trace = BoundaryTrace(End(0, TOP, 5_000), RIGHT, GRID, lambda senses: [])
    path = [(x, 5.0, True) for x in np.arange(0.0, 0.5, 0.05)]
    path += [(0.5, 5.0 - y, False) for y in np.linspace(0.0, away_m, 20)]
    path += [(x, 5.0 - away_m, True) for x in np.arange(0.5, 1.1, 0.05)]
    for tick, (x, y, touches) in enumerate(path):
        walls = ((0.0, 1.0),) if touches else ()
        if trace.step(Senses(tick, float(x), float(y), walls, ()), ()) is None:
            break
    return trace


def test_a_wall_far_from_the_last_touch_gives_no_arc() -> None:
    near = traced(0.8)
    assert near.arc is not None
    assert near.arc.stop == near.end == End(1, TOP, 4_200)
    far = traced(3.0)
    assert far.arc is None
    assert far.end == End(1, TOP, 2_000)


def test_a_wall_in_line_with_the_last_touch_is_the_same_wall() -> None:
    """Bodies lead the robot 3 m along a straight wall beside the slice."""
    trace = BoundaryTrace(End(0, TOP, 5_000), RIGHT, GRID, lambda senses: [])
    path = [(0.0, 5.0, True), (0.5, 5.0, True), *[(0.3, 5.0 - y, False) for y in np.linspace(0.0, 3.0, 60)]]
    for tick, (x, y, touches) in enumerate([*path, (0.5, 2.0, True), (0.5, 1.5, True), (-0.01, 1.5, True)]):
        walls = ((1.0, 0.0), (0.0, -1.0)) if touches else ()
        trace.step(Senses(tick, float(x), float(y), walls, ()), ())
    assert trace.arc is not None
    assert trace.arc.stop == End(0, BOTTOM, 1_500)


def test_a_robot_at_an_end_proves_nothing_to_a_robot_without_a_wall() -> None:
    parked = End(0, BOTTOM, 4_500)
    for walls in ((), ((0.0, 1.0),)):
        trace = BoundaryTrace(End(0, TOP, 5_000), RIGHT, GRID, lambda senses: [parked])
        trace.step(Senses(0, 0.0, 5.0, ((0.0, 1.0),), ()), ())
        trace.step(Senses(1, 0.05, 5.0, ((0.0, 1.0),), ()), ())
        trace.step(Senses(2, 0.1, 4.98, walls, ()), [(0.0, -1.0)])
        assert (trace.end == parked) == bool(walls)
