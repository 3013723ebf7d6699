"""Which of several triangles beside an edge count, where each slot keeps its own proof."""

import pytest

from zwerm.agents.sensor_coverage.frontier.proofs.chosen_triangles import KEPT_MAX, ChosenTriangles
from zwerm.agents.sensor_coverage.messages.pushes import ProvedArc, WalkTriangle

BESIDE, LEFT, RIGHT = 1, 1, -1


def triangle(
    here_rad: float,
    there_rad: float,
    number: int,
    side: int = RIGHT,
    hand: int = RIGHT,
    walk: int = 5,
    needed: tuple[int, ...] = (BESIDE,),
    seen: tuple[int, ...] = (BESIDE,),
    stretch: int = 1,
) -> ProvedArc:
    mark = WalkTriangle(BESIDE, side, there_rad, walk, stretch, number, hand)
    return ProvedArc(needed, seen, 0.0, here_rad, mark)


def chosen(*arcs: ProvedArc) -> ChosenTriangles:
    triangles = ChosenTriangles()
    for each in arcs:
        assert each.triangle is not None
        triangles.add(each, each.triangle)
    return triangles


@pytest.mark.parametrize(
    ("side", "hand", "wide_number", "goes_round"),
    [
        pytest.param(
            RIGHT, RIGHT, 1, True, id="from far to near, the wall on the right, the space on the right of the edge"
        ),
        pytest.param(RIGHT, RIGHT, 9, False, id="from near to far"),
        pytest.param(LEFT, RIGHT, 9, True, id="the space on the left of the edge"),
        pytest.param(LEFT, RIGHT, 1, False, id="the space on the left, from far to near"),
        pytest.param(RIGHT, LEFT, 9, True, id="the wall on the left"),
        pytest.param(LEFT, LEFT, 1, True, id="the wall and the space on the left"),
    ],
)
def test_two_triangles_that_cross_count_if_the_walk_led_around_the_space_between(
    side: int, hand: int, wide_number: int, goes_round: bool
) -> None:
    """The slot beside is in the east. A robot with the wall on its right turns to the left, as seen from here."""
    wide, narrow = triangle(1.2, 0.5, wide_number, side, hand), triangle(0.4, 1.1, 10 - wide_number, side, hand)
    for arcs in ((wide, narrow), (narrow, wide)):
        assert list(chosen(*arcs).counting((BESIDE,))) == ([wide, narrow] if goes_round else [wide])


def test_triangles_on_both_sides_of_an_edge_count() -> None:
    arcs = (triangle(1.2, 0.5, 9), triangle(0.4, 1.1, 1, LEFT))
    assert list(chosen(*arcs).counting((BESIDE,))) == [*arcs]


def test_of_two_triangles_that_cross_only_one_counts_if_the_wall_between_their_points_was_not_followed_to_its_end() -> (
    None
):
    """The walk met a robot between the two points, which may have stood in front of an opening and has died since."""
    wide, narrow = triangle(1.2, 0.5, 1, stretch=1), triangle(0.4, 1.1, 9, stretch=6)
    assert list(chosen(wide, narrow).counting((BESIDE,))) == [wide]


def test_of_two_triangles_that_cross_only_one_counts_if_no_walk_led_around_the_space_between() -> None:
    """The points are of two walks: one may be in a passage, and the other one at the wall beside it."""
    wide, narrow, inner = triangle(1.2, 0.5, 1), triangle(0.4, 1.1, 9, walk=6), triangle(0.3, 0.4, 9, walk=7, needed=())
    assert list(chosen(wide, narrow, inner).counting((BESIDE,))) == [wide, inner]
    assert list(chosen(wide, narrow._replace(start_rad=0.1), inner).counting(())) == [inner]


def test_another_triangle_counts_when_a_slot_of_the_first_one_does_not_stand() -> None:
    wide, narrow = triangle(1.2, 0.5, 9, needed=(BESIDE, 2)), triangle(0.4, 1.1, 1)
    triangles = chosen(narrow, wide)
    assert list(triangles.counting((BESIDE, 2))) == [wide]
    assert list(triangles.counting((BESIDE,))) == [narrow]
    assert list(triangles.counting(())) == []
    assert list(triangles.all()) == [wide, narrow]


def test_a_triangle_is_forgotten_when_a_slot_is_lost_that_saw_its_point() -> None:
    wide, narrow = triangle(1.2, 0.5, 9, seen=(BESIDE, 3)), triangle(0.4, 1.1, 1)
    triangles = chosen(wide, narrow)
    triangles.lose((3,))
    assert list(triangles.counting((BESIDE,))) == [narrow]


def test_triangles_that_close_nothing_more_are_not_kept() -> None:
    outer = [triangle(1.2, 0.5, 1), triangle(0.4, 1.1, 9)]
    inner = [triangle(0.8, 0.8, 5), triangle(1.1, 0.4, 2), triangle(1.0, 0.4, 2, needed=(BESIDE, 2))]
    for arcs in ((*outer, *inner), (*inner, *outer)):
        assert list(chosen(*arcs).all()) == outer
    several = [triangle(1.0 + 0.001 * each, 0.5, 1, needed=(BESIDE, 10 + each)) for each in range(KEPT_MAX + 2)]
    assert list(chosen(*several).all()) == several[:1:-1]
