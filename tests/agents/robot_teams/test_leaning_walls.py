"""Walls almost parallel to a slice: the bearing of a touch does not tell to which side they lean."""

import pytest

from zwerm.agents.robot_teams.mapping.facts import BOTTOM, LEFT, RIGHT, End
from zwerm.agents.robot_teams.mapping.slice_map import TOLERANCE_MM
from zwerm.agents.robot_teams.motion.manoeuvres import BoundaryTrace, SliceGrid, SliceSweep
from zwerm.agents.robot_teams.motion.senses import Senses

GRID = SliceGrid(0.0, 0.95)
STEP_M = 0.05
# A wall on the left pushes the robot off slice 1 below this height.
TOUCHED_M = 4.0
SLOPE = 0.019


def swept_down(lean: float, start_m: float = 6.0) -> SliceSweep:
    """Sweep slice 1 down along the wall, which the robot's touch tells to lean by `lean`."""
    sweep = SliceSweep(1, BOTTOM, GRID, STEP_M, lambda senses: [])
    y = start_m
    for tick in range(200):
        touches = y < TOUCHED_M
        x = GRID.x_m(1) + (SLOPE * (TOUCHED_M - y) if touches else 0.0)
        if sweep.step(Senses(tick, x, y, ((-1.0, lean),) if touches else (), ()), ()) is None:
            break
        y -= STEP_M
    return sweep


@pytest.mark.parametrize("lean", [-0.028, -0.019, -0.01, 0.0])
def test_robots_with_other_headings_measure_the_same_end(lean: float) -> None:
    end = swept_down(lean).end
    assert end is not None
    assert abs(end.y_mm - 1000.0 * TOUCHED_M) <= TOLERANCE_MM


def test_a_sweep_that_begins_beside_its_slice_measures_no_end() -> None:
    assert swept_down(-0.019, start_m=3.0).end is None


@pytest.mark.parametrize(("back_m", "arrives"), [(0.27, False), (2.3, True)])
def test_a_trace_that_is_pushed_back_is_not_at_the_other_end(back_m: float, arrives: bool) -> None:
    """The wall on the left is beside both ends of the slice; the trace begins at the lower one."""
    line = GRID.x_m(1)
    trace = BoundaryTrace(End(1, BOTTOM, 240), RIGHT, GRID, lambda senses: [])
    way = ((line, 0.24), (line + 0.05, 0.24), (line + 0.01, back_m), (line - 0.03, back_m))
    for tick, (x, y) in enumerate(way):
        trace.step(Senses(tick, x, y, ((0.0, -1.0),) if tick < 2 else ((-1.0, -0.018),), ()), ())
    assert (trace.end is not None) == arrives


def test_a_trace_that_begins_without_a_touch_looks_for_its_wall() -> None:
    trace = BoundaryTrace(End(1, BOTTOM, 4_000), LEFT, GRID, lambda senses: [])
    assert trace.step(Senses(0, GRID.x_m(1), 4.0, (), ()), ()) == (0.0, -1.0)
