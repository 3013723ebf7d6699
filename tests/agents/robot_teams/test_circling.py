"""Two robots that circle each other come free, and a robot that others led away from its boundary gives no fact about it."""

import math

import numpy as np
import pytest

from zwerm.agents.robot_teams.mapping.facts import BOTTOM, RIGHT, TOP, End, SweptSegment, TracedArc
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.motion.manoeuvres import BoundaryTrace, SliceGrid
from zwerm.agents.robot_teams.motion.pilot import CIRCLE_S, DONE, FAILED, Headway, Pilot
from zwerm.agents.robot_teams.motion.senses import GAP_M, Beside, Senses
from zwerm.agents.robot_teams.work import Work

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


def traced(away_m: float, robot: bool) -> BoundaryTrace:
    """Follow a wall along y = 5 from slice 0, then one `away_m` below it, to slice 1; a `robot` may be in the way between."""
    trace = BoundaryTrace(End(0, TOP, 5_000), RIGHT, GRID, lambda senses: [])
    path = [(x, 5.0, True) for x in np.arange(0.0, 0.5, 0.05)]
    path += [(0.5, 5.0 - y, False) for y in np.linspace(0.0, away_m, 20)]
    path += [(x, 5.0 - away_m, True) for x in np.arange(0.5, 1.1, 0.05)]
    for tick, (x, y, touches) in enumerate(path):
        walls = ((0.0, 1.0),) if touches else ()
        if (
            trace.step(Senses(tick, float(x), float(y), walls, ()), [(1.0, 0.0)] if robot and not touches else [])
            is None
        ):
            break
    return trace


@pytest.mark.parametrize(("away_m", "robot", "certain"), [(0.8, False, True), (0.8, True, False), (3.0, False, False)])
def test_an_arc_is_certain_only_if_no_body_led_the_robot_to_another_wall(
    away_m: float, robot: bool, certain: bool
) -> None:
    trace = traced(away_m, robot)
    assert trace.end == End(1, TOP, round(5_000 - 1_000 * away_m))
    assert trace.arc is not None
    assert trace.arc.stop == trace.end
    assert trace.certain == certain


def test_an_arc_that_is_not_certain_is_a_fact_once_it_is_traced_twice() -> None:
    start, stop, other = End(0, TOP, 5_000), End(1, TOP, 4_200), End(1, TOP, 3_000)
    work = Work(SliceMap(), GRID, SPEED_M_S * DT_S, lambda: Senses(0, 0.0, 5.0, (), ()), lambda senses: [])
    for end in (start, stop, other):
        work.map.add(SweptSegment(end.slice, end.y_mm - 500, end.y_mm, ()))

    def trace(end: End) -> int:
        work.at = start
        activity = work.trace(RIGHT)
        manoeuvre = next(activity)
        assert isinstance(manoeuvre, BoundaryTrace)
        manoeuvre.end, manoeuvre.certain = end, False
        manoeuvre.arc = TracedArc(start, RIGHT, end, 1_000, 900, 5_000, ())
        assert next(activity, None) is None
        return len(work.map.facts.arcs)

    assert [trace(stop), trace(other), trace(stop)] == [0, 0, 0], "each led elsewhere than the one before"
    assert trace(stop) == 1


def test_a_wall_in_line_with_the_last_touch_is_the_same_wall() -> None:
    """Bodies lead the robot 3 m along a straight wall beside the slice."""
    trace = BoundaryTrace(End(0, TOP, 5_000), RIGHT, GRID, lambda senses: [])
    path = [(0.0, 5.0, True), (0.5, 5.0, True), *[(0.3, 5.0 - y, False) for y in np.linspace(0.0, 3.0, 60)]]
    for tick, (x, y, touches) in enumerate([*path, (0.5, 2.0, True), (0.5, 1.5, True), (-0.01, 1.5, True)]):
        walls = ((1.0, 0.0), (0.0, -1.0)) if touches else ()
        trace.step(Senses(tick, float(x), float(y), walls, ()), ())
    assert trace.arc is not None
    assert trace.arc.stop == End(0, BOTTOM, 1_500)


@pytest.mark.parametrize(("parked", "proves"), [(End(1, TOP, 5_000), True), (End(0, BOTTOM, 4_500), False)])
def test_only_a_robot_at_the_next_end_tells_a_robot_at_a_wall_where_it_leads(parked: End, proves: bool) -> None:
    for walls in ((), ((0.0, 1.0),)):
        trace = BoundaryTrace(End(0, TOP, 5_000), RIGHT, GRID, lambda senses: [parked])
        trace.step(Senses(0, 0.0, 5.0, ((0.0, 1.0),), ()), ())
        trace.step(Senses(1, 0.05, 5.0, ((0.0, 1.0),), ()), ())
        trace.step(Senses(2, 0.1, 4.98, walls, ()), [(0.0, -1.0)])
        assert (trace.end == parked) == (proves and bool(walls))


@pytest.mark.parametrize("known", [True, False])
def test_a_trace_ends_at_a_robot_at_the_other_end_of_its_slice_and_never_circles(known: bool) -> None:
    """A robot stands at the upper end of an obstacle, 2 m high, which the trace goes around from its lower end."""
    parked = End(0, BOTTOM, 7_000)
    trace = BoundaryTrace(End(0, TOP, 5_000), RIGHT, GRID, lambda senses: [parked] if known else [])
    wall, robot = ((-1.0, 0.0),), ((0.0, -1.0),)
    right = [(0.5, 5.0 + y, wall, ()) for y in np.linspace(0.0, 2.3, 24)]
    over = [(0.5 - x, 7.5, (), robot) for x in np.linspace(0.0, 1.0, 11)]
    left = [(-0.5, 7.5 - y, ((1.0, 0.0),), ()) for y in np.linspace(0.0, 3.0, 31)]
    under = [(-0.5 + x, 4.5, ((0.0, 1.0),), ()) for x in np.linspace(0.0, 1.0, 11)]
    steps = 0
    for _ in range(3):
        for x, y, walls, blocks in [*right, *over, *left, *under]:
            steps += 1
            if trace.step(Senses(steps, float(x), float(y), walls, ()), blocks) is None:
                assert trace.end == (parked if known else None)
                assert (trace.arc is not None) == known
                assert steps <= len([*right, *over, *left, *under])
                return
    raise AssertionError("the trace goes around in a circle")
