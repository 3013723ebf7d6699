"""Holes by bearings: their cycles, the drives into them, and obstacles that robots met in them."""

import math

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.frontier.holes import Hole, holes, is_bare, sides
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner import Planner
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import Sighting
from zwerm.maths.simplicial import FlagComplex

Positions = dict[int, tuple[float, float]]


def seen(slots: Positions) -> tuple[dict[int, dict[int, float]], FlagComplex]:
    """The bearings between robots at these places within 1 m, in one frame."""
    views = {
        i: {
            j: math.atan2(there[1] - here[1], there[0] - here[0])
            for j, there in slots.items()
            if j != i and math.dist(here, there) <= 1.0
        }
        for i, here in slots.items()
    }
    return views, FlagComplex(views)


def rhombus(angle_rad: float) -> Positions:
    """Four robots 0.95 m apart in a ring; 1 and 3 are at the acute corners."""
    x, y = 0.95 * math.cos(angle_rad / 2.0), 0.95 * math.sin(angle_rad / 2.0)
    return {1: (-x, 0.0), 2: (0.0, -y), 3: (x, 0.0), 4: (0.0, y)}


def the_hole(slots: Positions) -> Hole:
    (add,) = holes(*seen(slots))
    return add


@pytest.mark.parametrize("order", [(1, 2, 3, 4), (4, 2, 1, 3), (2, 1, 4, 3)])
def test_a_hole_is_on_the_left_of_its_cycle_for_any_order_of_ids(order: tuple[int, ...]) -> None:
    square = rhombus(math.radians(80.0))
    hole = the_hole({order[slot - 1]: at for slot, at in square.items()})
    widths = {corner.slot: math.degrees(corner.width_rad) for corner in hole}
    assert [widths[each] for each in order] == pytest.approx([80.0, 100.0, 80.0, 100.0])
    for corner in hole:
        x, y = square[order.index(corner.slot) + 1]
        assert corner.faces(math.atan2(-y, -x)), "the middle is in the hole"
        assert not corner.faces(math.atan2(y, x))


def test_a_disc_and_a_rhombus_with_a_short_diagonal_have_no_hole() -> None:
    assert holes(*seen(rhombus(math.radians(60.0)))) == []


def test_a_hole_is_an_obstacle_if_a_robot_met_something_in_it_and_not_beside_it() -> None:
    slots = rhombus(math.radians(66.0))
    hole = the_hole(slots)
    assert is_bare(hole, *seen(slots), lambda _: ())
    assert is_bare(hole, *seen(slots), lambda slot: {2: (-math.pi / 2.0,), 1: (math.pi,)}.get(slot, ()))
    assert not is_bare(hole, *seen(slots), lambda slot: {2: (math.pi / 2.0,)}.get(slot, ()))


def test_an_obstacle_met_by_a_robot_inside_a_hole_counts_unless_it_is_behind_the_robot() -> None:
    """A ring of seven, and an eighth robot within that sees three of them: with those it makes two triangles."""
    ring = {n: (1.05 * math.cos(n * math.tau / 7.0), 1.05 * math.sin(n * math.tau / 7.0)) for n in range(7)}
    within, outside = {**ring, 8: (0.4, 0.0)}, {**ring, 8: (1.7, 0.0)}
    for slots, direction, bare in (
        (within, math.pi, False),
        (within, 0.3, True),
        (outside, math.pi, True),
        (outside, 0.3, True),
    ):
        views, complex_ = seen(slots)
        hole = next(each for each in holes(views, complex_) if len(each) > 5)
        assert is_bare(hole, views, complex_, lambda _: ())
        assert is_bare(hole, views, complex_, lambda slot: (direction,) if slot == 8 else ()) == bare  # noqa: B023


def test_an_obstacle_met_by_a_robot_that_two_see_in_a_hole_counts_in_any_direction() -> None:
    ring = {n: (1.1 * math.cos(n * math.tau / 7.0), 1.1 * math.sin(n * math.tau / 7.0)) for n in range(7)}
    slots = {**ring, 8: (0.35, 0.22)}
    views, complex_ = seen(slots)
    hole = next(each for each in holes(views, complex_) if len(each) > 5)
    assert 8 in complex_.neighbours[0]
    assert 8 not in {corner.slot for corner in hole}
    assert not is_bare(hole, views, complex_, lambda slot: (0.3,) if slot == 8 else ())


def test_a_robot_that_drives_into_a_hole_bisects_its_narrow_corners() -> None:
    hole = the_hole(rhombus(math.radians(66.0)))
    add = {side.edge: side for side in sides(hole)}
    assert sorted(add) == [(1, 2), (1, 4), (2, 3), (3, 4)]
    assert math.degrees(add[1, 2].angle_i_rad) == pytest.approx(33.0)
    assert math.degrees(add[1, 2].angle_j_rad) == pytest.approx(57.0)
    assert add[1, 2].sign == 1, "the hole is on the left of the way from 1 to 2"
    assert add[1, 4].sign == -1


def planner(slots: Positions, wall_at: int | None = None) -> Planner:
    known = Slots()
    for node in sorted(slots):
        assert known.add(node) == node
    views, complex_ = seen(slots)
    for node, view in views.items():
        known.take(node, [Sighting(other, bearing) for other, bearing in view.items()])
    known.learn_references(views)
    if wall_at is not None:
        x, y = slots[wall_at]
        known.walls[wall_at] = [math.atan2(-y, -x)]
    add = Planner(PlannerParameters(), known, SwarmProof())
    add.update(ScanResult(views, complex_, (0,)))
    return add


@pytest.mark.parametrize("wall_at", [None, 2])
def test_four_robots_just_out_of_range_of_each_other_get_a_fifth_unless_there_is_a_wall(wall_at: int | None) -> None:
    """The corner rule alone would leave them as they are: both of their narrow corners are below 60 degrees and a margin."""
    slots = {0: (-1.7, 0.0), **rhombus(math.radians(65.0))}
    mine = planner(slots, wall_at)
    edges = [(1, 2), (1, 4), (2, 3), (3, 4)]
    assert not any(side.edge in edges and _inward(side.edge, side.sign) for side in mine.fence.sides)
    _, _, last, *_ = mine.plans()
    assert sorted({plan.key[:2] for plan in last}) == ([] if wall_at else edges)
    for plan in last:
        x, y = slots[plan.mover]
        goal = np.array((x + plan.hop_m * math.cos(plan.direction), y + plan.hop_m * math.sin(plan.direction)))
        others = [at for slot, at in slots.items() if slot and slot != plan.mover]
        assert all(np.hypot(*(goal - each)) < 1.0 for each in others), "the fifth sees all four, and so fills the hole"


def _inward(pair: tuple[int, int], sign: int) -> bool:
    return sign == {(1, 2): 1, (1, 4): -1, (2, 3): 1, (3, 4): 1}[pair]


# --- a swarm that has come apart ------------------------------------------------------------------------------------


def test_the_planner_proposes_a_bridge_to_a_component_out_of_sight() -> None:
    """Four in single file; the last two have drifted out of sight of the second, whose place is still known."""
    run_concurrently = {0: (0.0, 0.0), 1: (0.95, 0.0), 2: (1.9, 0.1), 3: (2.8, 0.1)}
    mine = planner(run_concurrently)
    assert bridges(mine) == {}
    apart = {slot: (x + 0.1 * (slot > 1), y) for slot, (x, y) in run_concurrently.items()}
    mine.update(ScanResult(*seen(apart), (0,)))
    add = bridges(mine)
    assert sorted(add) == [1, 2], "either may go; only one of them can be reached"
    assert add[1].direction == pytest.approx(math.atan2(0.1, 0.95))
    assert add[1].anchors == (1,)
    for _ in range(PlannerParameters().attempts_max):
        mine.note_attempt(add[1])
    assert sorted(bridges(mine)) == [2], "not for ever"


def bridges(mine: Planner) -> dict[int, Plan]:
    return {plan.mover: plan for plan in next(mine.plans()) if plan.key[2] == 0}
