"""The attempts to follow a wall into an open arc are bounded, and so are the times that they are counted anew."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_plans import (
    AT_EDGE_MAX,
    BEYOND_EDGE_RAD,
    FRACTIONS,
    ROUNDS_MAX,
    WallPlans,
)
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc
from zwerm.maths.simplicial import FlagComplex

OPEN = Arc(0.5, 1.0)
BESIDE = {0: 3.0}  # a neighbour in another direction


def attempts(walls: WallPlans, slot: int) -> int:
    """Make all attempts at an arc that stays open, and return their number."""
    made = 0
    while True:
        plans, exhausted = walls.plans_at(slot, BESIDE, [OPEN])
        if exhausted:
            return made
        walls.note_attempt(plans[0])
        made += 1
        assert 0.5 <= plans[0].direction % math.tau <= 1.5


def test_an_arc_that_stays_open_is_tried_a_bounded_number_of_times() -> None:
    walls = WallPlans(PlannerParameters(), Slots(), None)
    rounds = 0
    while True:
        assert attempts(walls, 4) == len(FRACTIONS)
        rounds += 1
        walls.unproven = (4,)
        if not walls.begin_again():
            break
    assert rounds == ROUNDS_MAX
    assert attempts(walls, 4) == 0


def test_attempts_are_not_counted_anew_where_no_arc_stays_open() -> None:
    walls = WallPlans(PlannerParameters(), Slots(), None)
    assert attempts(walls, 4) == len(FRACTIONS)
    assert not walls.begin_again()
    assert attempts(walls, 4) == 0


def test_a_narrow_arc_is_probed_once_unless_the_robot_is_in_touch_with_another_one() -> None:
    """A walk closes the wide one as a whole."""
    slots = Slots()
    walls = WallPlans(PlannerParameters(), slots, None)
    narrow, wide = Arc(2.0, 0.2), Arc(-1.0, 1.5)
    slots.in_touch[5] = (7,)
    assert walls.probes_at(5, [narrow]) == []
    assert [plan.direction for plan in walls.probes_at(4, [narrow, wide])] == [2.1]
    assert walls.probes_at(4, [Arc(2.05, 0.1)]) == []
    walls.forget()
    assert len(walls.probes_at(4, [narrow])) == 1


@pytest.mark.parametrize(("robot_rad", "edge_rad", "sign"), [(1.0, 1.2, 1), (1.2, 1.0, -1)])
def test_the_first_attempts_between_a_robot_and_a_wall_go_to_the_wall(
    robot_rad: float, edge_rad: float, sign: int
) -> None:
    """In the middle of the arc the robot may be in the way. Later attempts go there. All count for the arc."""
    walls = WallPlans(PlannerParameters(), Slots(), None)
    arc = Arc(1.0, 0.2)
    hands = []
    for _ in range(AT_EDGE_MAX):
        ((plan,), _) = walls.plans_at(4, {7: robot_rad}, [arc])
        assert plan.aim == pytest.approx(edge_rad + sign * BEYOND_EDGE_RAD)
        assert arc.start_rad < plan.direction < arc.start_rad + arc.width_rad
        hands.append(plan.hand)
        walls.note_attempt(plan)
    assert hands == [-sign, sign] * (AT_EDGE_MAX // 2)
    ((plan,), _) = walls.plans_at(4, {7: robot_rad}, [arc])
    assert plan.aim == plan.direction == pytest.approx(1.0 + FRACTIONS[AT_EDGE_MAX] * 0.2)


def test_a_walk_at_the_edge_begins_beyond_the_other_edge() -> None:
    """With the wall at its right hand, -1, the walk passes the slot; before it the robot follows it with the other hand."""
    walls = WallPlans(PlannerParameters(), Slots(), None)
    ((plan,), _) = walls.plans_at(4, {7: 1.0}, [Arc(1.0, 0.2)])
    assert plan.half_rad == pytest.approx(0.2 + BEYOND_EDGE_RAD)


@pytest.mark.parametrize("beside", [{7: 2.0}, {7: 1.0, 8: 1.2}])
def test_an_arc_between_walls_or_between_robots_is_tried_in_its_middle(beside: dict[int, float]) -> None:
    walls = WallPlans(PlannerParameters(), Slots(), None)
    ((plan,), _) = walls.plans_at(4, beside, [Arc(1.0, 0.2)])
    assert plan.aim == plan.direction == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("closed_rad", "movers"),
    [
        pytest.param((6.0, 0.0), {1}, id="slot 1 has a wide arc"),
        pytest.param((6.0, 6.0), {0, 1}, id="both have narrow arcs only"),
        pytest.param((0.0, 0.0), {0, 1}, id="both have wide arcs"),
    ],
)
def test_walks_go_into_narrow_arcs_only_where_no_slot_has_a_wide_one(
    closed_rad: tuple[float, float], movers: set[int]
) -> None:
    slots, views = Slots(), {0: {1: 0.0}, 1: {0: math.pi}}
    for slot, width_rad in enumerate(closed_rad):
        slots.add(slot)
        slots.near[slot] = [NearArc(Arc(0.1, width_rad), 1)] if width_rad else []
    walls = WallPlans(PlannerParameters(), slots, SwarmProof())
    assert {each.mover for each in walls.plans(ScanResult(views, FlagComplex(views), ()))} == movers
