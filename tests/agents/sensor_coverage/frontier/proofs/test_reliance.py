"""Slots that close gaps between their walls by relying on each other: in a circle nobody has seen the space."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.proofs.reliance import Answered, Fan, circular_gaps
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc


def arc(start: float, end: float) -> Arc:
    return Arc(math.radians(start), math.radians(end - start))


def fan(other: int, to_other: float, to_point: float, from_other: float) -> Fan:
    return Fan(other, math.radians(to_other), math.radians(to_point), math.radians(from_other), ())


def degrees(gaps: dict[int, list[Arc]]) -> dict[int, list[tuple[int, int]]]:
    """Return gaps by slot, as their starts and ends [deg]."""
    return {
        slot: [(round(math.degrees(start)) % 360, round(math.degrees(start + width)) % 360) for start, width in arcs]
        for slot, arcs in gaps.items()
    }


# Three robots nearly in a line, left of a door, as drawn building 853 showed: each sees a point of the wall past the others.
GAPS = {4: [arc(31, 76)], 0: [arc(-68, -21)], 1: [arc(58, 78)]}
FANS = {4: [fan(0, 100.5, -65.3, -75.2)], 0: [fan(1, -83.6, 4.5, 80.2)], 1: [fan(4, 83.6, -45.7, -77.6)]}


def test_slots_that_rely_on_each_other_in_a_circle_leave_their_gaps_open() -> None:
    assert degrees(circular_gaps(GAPS, FANS)) == {4: [(31, 76)], 0: [(292, 339)], 1: [(58, 78)]}


@pytest.mark.parametrize("slot", GAPS)
def test_a_chain_that_comes_to_a_wall_closes_all_gaps(slot: int) -> None:
    assert circular_gaps({**GAPS, slot: []}, FANS) == {}


def test_a_gap_without_a_triangle_is_left_and_so_is_what_relies_on_it() -> None:
    assert degrees(circular_gaps(GAPS, {**FANS, 1: []})) == {4: [(31, 76)], 0: [(292, 339)], 1: [(58, 78)]}


@pytest.mark.parametrize(
    ("gap", "open_deg"),
    [
        pytest.param(arc(20, 30), (0, 28), id="rays that come to the gap beyond the point"),
        pytest.param(arc(100, 130), (0, 50), id="the gap is at the point"),
        pytest.param(arc(150, 170), None, id="the gap is on the near side of the point"),
        pytest.param(arc(-60, -10), None, id="no ray turns as far"),
    ],
)
@pytest.mark.parametrize("side", [1, -1])
def test_only_rays_that_come_to_a_gap_of_the_other_slot_stay_open(
    gap: Arc, open_deg: tuple[int, int] | None, side: int
) -> None:
    """Slot 0 sees slot 1 in the direction 0, and a point at 60 degrees. Slot 1 sees the point at 120 degrees."""

    def turned(each: Arc) -> Arc:
        return each if side > 0 else Arc(-each.start_rad - each.width_rad, each.width_rad)

    gaps = {0: [turned(arc(0, 50))], 1: [turned(gap)]}
    left = circular_gaps(gaps, {0: [fan(1, 0.0, side * 60.0, side * 120.0)]})
    expected = {} if open_deg is None else {0: [turned(arc(*open_deg))]}
    assert degrees({0: left.get(0, [])}) == degrees({0: expected.get(0, [])})


def test_a_slot_that_sees_another_one_between_two_robots_leaves_what_is_behind_them_to_these() -> None:
    """Slot 6 stands in the mouth of a bend, between robots on both sides, and sees slot 3 and a point beside it past these."""
    gap = {3: [arc(24, 95)]}
    past = fan(6, -178.2, 13.1, 6.8)
    assert circular_gaps(gap, {3: [past]}) == {}
    left = circular_gaps(gap, {3: [past._replace(beyond=[arc(11.8, 89)])]})
    assert degrees(left) == {3: [(24, 95)]}


@pytest.mark.parametrize(
    ("others", "open_deg"),
    [
        pytest.param([(1, arc(30, 60))], [], id="it closes what is there"),
        pytest.param([(1, arc(60, 90))], [(40, 50)], id="it has a gap there"),
        pytest.param([(1, arc(60, 90)), (2, arc(0, 40))], [], id="one of two"),
        pytest.param([(0, arc(30, 60))], [(40, 50)], id="the slot itself has the gap"),
        pytest.param([], [(40, 50)], id="none"),
    ],
)
def test_another_slot_answers_for_a_gap_if_it_has_none_there(
    others: list[tuple[int, Arc]], open_deg: list[tuple[int, int]]
) -> None:
    gaps = {0: [arc(40, 50)], 1: [arc(80, 100)], 2: []}
    left = circular_gaps(gaps, {}, {0: [Answered(arc(40, 50), others)]})
    assert degrees({0: left.get(0, [])}) == {0: open_deg}


def test_slots_that_answer_for_each_other_leave_their_gaps_open() -> None:
    """The second slot closes what it answers for by a triangle that relies on the first."""
    gaps = {0: [arc(165, 175)], 1: [arc(80, 100)]}
    answered = {0: [Answered(arc(165, 175), [(1, arc(60, 90))])]}
    behind, clear = fan(0, 60.0, 120.0, 170.0), fan(2, 60.0, 120.0, 170.0)
    assert degrees(circular_gaps(gaps, {1: [behind]}, answered)) == {0: [(165, 175)], 1: [(80, 100)]}
    assert circular_gaps(gaps, {1: [clear]}, answered) == {}, "negative control: slot 2 has no gap"


def test_other_slots_answer_for_no_more_of_a_gap_than_is_closed_but_for_the_edge_of_sight() -> None:
    answered = Answered(arc(40, 50), [(1, arc(60, 90))])
    within = list(answered.within([arc(30, 44), arc(48, 60)]))
    assert degrees({0: [each.gap for each in within]}) == {0: [(40, 44), (48, 50)]}
    assert {tuple(each.others) for each in within} == {tuple(answered.others)}
