"""The landmark complex and the navigation graph do not depend on the order of observations; gudhi agrees on their homology."""

import random
from itertools import combinations

import gudhi
from hypothesis import given
from hypothesis import strategies as st

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.landmark_complex import LandmarkComplex
from zwerm.maths.strong_collapse import betti, collapsed

simplices = st.lists(st.frozensets(st.integers(0, 11), max_size=6).map(lambda each: tuple(sorted(each))), max_size=25)


def complex_of(some: list[tuple[int, ...]]) -> LandmarkComplex:
    found = LandmarkComplex()
    for number, each in enumerate(some):
        found.update(BearingSnapshot(each, (number % 256,) * len(each)), (number, 0))
    return found


def graph_of(complex_: LandmarkComplex) -> set[tuple[tuple[int, ...], tuple[int, ...], int]]:
    name = complex_.simplices
    return {(name[v], name[w], shared) for v, around in complex_.neighbours.items() for w, shared in around.items()}


@given(simplices, st.randoms())
def test_complex_and_graph_do_not_depend_on_the_order(some: list[tuple[int, ...]], order: random.Random) -> None:
    ranked = [(BearingSnapshot(each, (number % 256,) * len(each)), (number, 0)) for number, each in enumerate(some)]
    shuffled = [*ranked, *ranked]
    order.shuffle(shuffled)
    one, other = LandmarkComplex(), LandmarkComplex()
    for found, observations in ((one, ranked), (other, shuffled)):
        for snapshot, rank in observations:
            found.update(snapshot, rank)
    assert sorted(one.simplices.values()) == sorted(other.simplices.values())
    assert graph_of(one) == graph_of(other)
    assert one.table == other.table


@given(simplices)
def test_free_simplices_are_those_that_are_no_face_of_another(some: list[tuple[int, ...]]) -> None:
    distinct = {frozenset(each) for each in some if each}
    free = {each for each in distinct if not any(each < other for other in distinct)}
    complex_ = complex_of(some)
    assert {frozenset(each) for each in complex_.simplices.values()} == free
    assert graph_of(complex_) == {
        (tuple(sorted(s)), tuple(sorted(t)), len(s & t)) for s in free for t in free if s != t and len(s & t) >= 2
    }
    for each in distinct:
        assert complex_.contains(each)


def test_the_graph_of_figure_7() -> None:
    # Three observations in a row, of which the first two share an edge and the last two a triangle.
    complex_ = complex_of([(1, 2, 3), (2, 3, 4, 5, 6), (4, 5, 6, 7), (2, 3)])
    assert graph_of(complex_) == {
        ((1, 2, 3), (2, 3, 4, 5, 6), 2),
        ((2, 3, 4, 5, 6), (1, 2, 3), 2),
        ((2, 3, 4, 5, 6), (4, 5, 6, 7), 3),
        ((4, 5, 6, 7), (2, 3, 4, 5, 6), 3),
    }


def test_the_table_keeps_a_simplex_that_became_a_face() -> None:
    complex_ = LandmarkComplex()
    complex_.update(BearingSnapshot((1, 2), (10, 20)))
    complex_.update(BearingSnapshot((1, 2, 3), (11, 21, 31)))
    assert list(complex_.simplices.values()) == [(1, 2, 3)]
    assert complex_.table == {(1, 2): (10, 20), (1, 2, 3): (11, 21, 31)}
    assert complex_.snapshot_of(0) == BearingSnapshot((1, 2), (10, 20))


def gudhi_betti(some: list[tuple[int, ...]]) -> tuple[int, int]:
    tree = gudhi.SimplexTree()
    for each in some:
        for face in combinations(each, min(len(each), 3)):
            tree.insert(list(face))
    tree.compute_persistence(homology_coeff_field=2, min_persistence=-1, persistence_dim_max=True)
    numbers = [*tree.betti_numbers(), 0, 0]
    return numbers[0], numbers[1]


@given(simplices)
def test_gudhi_finds_the_same_betti_numbers(some: list[tuple[int, ...]]) -> None:
    some = [each for each in some if each]
    if some:
        assert betti(some) == gudhi_betti(some)
    else:
        assert betti(some) == (0, 0)


def test_an_annulus_of_triangles_collapses_to_a_cycle_and_keeps_its_hole() -> None:
    count = 40
    ring = [tuple(sorted({i, (i + 1) % count, 100 + i, 100 + (i + 1) % count})) for i in range(count)]
    assert betti(ring) == gudhi_betti(ring) == (1, 1)
    assert len(collapsed(ring)) <= count
    assert betti([*ring, tuple(range(count))]) == (1, 0)
