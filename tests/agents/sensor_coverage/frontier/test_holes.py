"""Holes by bearings: the way around, the way in, and whether anything was met there."""

import math

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.frontier.holes import Hole, holes, is_bare, sides
from zwerm.agents.sensor_coverage.frontier.planner import Planner, PlannerParameters
from zwerm.agents.sensor_coverage.frontier.services import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import Sighting
from zwerm.maths.simplicial import FlagComplex

Positions = dict[int, tuple[float, float]]


def seen(places: Positions) -> tuple[dict[int, dict[int, float]], FlagComplex]:
    """What robots at these places see of each other within 1 m, in one frame."""
    views = {
        i: {
            j: math.atan2(there[1] - here[1], there[0] - here[0])
            for j, there in places.items()
            if j != i and math.dist(here, there) <= 1.0
        }
        for i, here in places.items()
    }
    return views, FlagComplex(views)


def rhombus(angle_rad: float) -> Positions:
    """Four robots 0.95 m apart in a ring; 1 and 3 are at the acute corners."""
    x, y = 0.95 * math.cos(angle_rad / 2.0), 0.95 * math.sin(angle_rad / 2.0)
    return {1: (-x, 0.0), 2: (0.0, -y), 3: (x, 0.0), 4: (0.0, y)}


def the_hole(places: Positions) -> Hole:
    (found,) = holes(*seen(places))
    return found


@pytest.mark.parametrize("order", [(1, 2, 3, 4), (4, 2, 1, 3), (2, 1, 4, 3)])
def test_a_hole_is_on_the_left_of_the_way_around_it_whatever_the_ids_are(order: tuple[int, ...]) -> None:
    square = rhombus(math.radians(80.0))
    hole = the_hole({order[place - 1]: at for place, at in square.items()})
    widths = {corner.place: math.degrees(corner.width_rad) for corner in hole}
    assert [widths[each] for each in order] == pytest.approx([80.0, 100.0, 80.0, 100.0])
    for corner in hole:
        x, y = square[order.index(corner.place) + 1]
        assert corner.faces(math.atan2(-y, -x)), "the middle is in the hole"
        assert not corner.faces(math.atan2(y, x))


def test_a_disc_has_no_hole_and_a_rhombus_with_a_short_diagonal_neither() -> None:
    assert holes(*seen(rhombus(math.radians(60.0)))) == []


def test_what_was_met_beside_a_hole_does_not_make_it_an_obstacle_and_what_was_met_in_it_does() -> None:
    places = rhombus(math.radians(66.0))
    hole = the_hole(places)
    assert is_bare(hole, *seen(places), lambda _: ())
    assert is_bare(hole, *seen(places), lambda place: {2: (-math.pi / 2.0,), 1: (math.pi,)}.get(place, ()))
    assert not is_bare(hole, *seen(places), lambda place: {2: (math.pi / 2.0,)}.get(place, ()))


def test_what_a_robot_that_stands_in_a_hole_met_counts_but_for_what_is_behind_it() -> None:
    """A ring of seven, and an eighth robot within that sees three of them: with those it makes two triangles."""
    ring = {n: (1.05 * math.cos(n * math.tau / 7.0), 1.05 * math.sin(n * math.tau / 7.0)) for n in range(7)}
    within, outside = {**ring, 8: (0.4, 0.0)}, {**ring, 8: (1.7, 0.0)}
    for places, direction, bare in (
        (within, math.pi, False),
        (within, 0.3, True),
        (outside, math.pi, True),
        (outside, 0.3, True),
    ):
        views, complex_ = seen(places)
        hole = next(each for each in holes(views, complex_) if len(each) > 5)
        assert is_bare(hole, views, complex_, lambda _: ())
        assert is_bare(hole, views, complex_, lambda place, met=direction: (met,) if place == 8 else ()) == bare


def test_what_a_robot_met_that_two_see_in_a_hole_counts_whatever_its_direction() -> None:
    ring = {n: (1.1 * math.cos(n * math.tau / 7.0), 1.1 * math.sin(n * math.tau / 7.0)) for n in range(7)}
    places = {**ring, 8: (0.35, 0.22)}
    views, complex_ = seen(places)
    hole = next(each for each in holes(views, complex_) if len(each) > 5)
    assert 8 in complex_.neighbours[0]
    assert 8 not in {corner.place for corner in hole}
    assert not is_bare(hole, views, complex_, lambda place: (0.3,) if place == 8 else ())


def test_a_robot_that_goes_in_halves_the_narrow_corners() -> None:
    hole = the_hole(rhombus(math.radians(66.0)))
    found = {side.edge: side for side in sides(hole)}
    assert sorted(found) == [(1, 2), (1, 4), (2, 3), (3, 4)]
    assert math.degrees(found[1, 2].angle_i_rad) == pytest.approx(33.0)
    assert math.degrees(found[1, 2].angle_j_rad) == pytest.approx(57.0)
    assert found[1, 2].sign == 1, "the hole is on the left of the way from 1 to 2"
    assert found[1, 4].sign == -1


def planner(places: Positions, wall_at: int | None = None) -> Planner:
    known = Slots()
    for node in sorted(places):
        assert known.found(node) == node
    views, complex_ = seen(places)
    for node, view in views.items():
        known.take(node, [Sighting(other, bearing) for other, bearing in view.items()])
    known.learn_references(views)
    if wall_at is not None:
        x, y = places[wall_at]
        known.walls[wall_at] = [math.atan2(-y, -x)]
    found = Planner(PlannerParameters(), known)
    found.look(ScanResult(views, complex_, (0,)))
    return found


@pytest.mark.parametrize("wall_at", [None, 2])
def test_four_robots_that_just_miss_each_other_get_a_fifth_unless_there_is_a_wall(wall_at: int | None) -> None:
    """The corner rule alone would leave them as they are: both of their narrow corners are below 60 degrees and a margin."""
    places = {0: (-1.7, 0.0), **rhombus(math.radians(65.0))}
    mine = planner(places, wall_at)
    edges = [(1, 2), (1, 4), (2, 3), (3, 4)]
    assert not any(side.edge in edges and _inward(side.edge, side.sign) for side in mine.fence.sides)
    _, _, last, _ = mine.plans()
    assert sorted({plan.key[:2] for plan in last}) == ([] if wall_at else edges)
    for plan in last:
        x, y = places[plan.mover]
        goal = np.array((x + plan.hop_m * math.cos(plan.direction), y + plan.hop_m * math.sin(plan.direction)))
        others = [at for place, at in places.items() if place and place != plan.mover]
        assert all(np.hypot(*(goal - each)) < 1.0 for each in others), "the fifth sees all four, and so fills the hole"


def _inward(pair: tuple[int, int], sign: int) -> bool:
    return sign == {(1, 2): 1, (1, 4): -1, (2, 3): 1, (3, 4): 1}[pair]


# --- a swarm that has come apart ------------------------------------------------------------------------------------


def test_a_piece_of_the_swarm_that_is_out_of_sight_is_somewhere_to_go() -> None:
    """Four in single file; the last two have drifted out of sight of the second, whose place is still known."""
    together = {0: (0.0, 0.0), 1: (0.95, 0.0), 2: (1.9, 0.1), 3: (2.8, 0.1)}
    mine = planner(together)
    assert bridges(mine) == {}
    apart = {place: (x + 0.1 * (place > 1), y) for place, (x, y) in together.items()}
    mine.look(ScanResult(*seen(apart), (0,)))
    found = bridges(mine)
    assert sorted(found) == [1, 2], "either may go; only one of them can be reached"
    assert found[1].direction == pytest.approx(math.atan2(0.1, 0.95))
    assert found[1].anchors == (1,)
    for _ in range(PlannerParameters().attempts_max):
        mine.note_attempt(found[1])
    assert sorted(bridges(mine)) == [2], "not for ever"


def bridges(mine: Planner) -> dict[int, Plan]:
    return {plan.mover: plan for plan in next(mine.plans()) if plan.key[2] == 0}
