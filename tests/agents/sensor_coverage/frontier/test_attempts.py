"""The attempts to follow a wall into an open arc are bounded, and so are the times that they are counted anew."""

import math

from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_plans import FRACTIONS, ROUNDS_MAX, WallPlans
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc

OPEN = Arc(0.5, 1.0)


def attempts(walls: WallPlans, slot: int) -> int:
    """Make all attempts at an arc that stays open, and return their number."""
    made = 0
    while True:
        plans, exhausted = walls.plans_at(slot, 0, [OPEN])
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
