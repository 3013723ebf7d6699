"""Flag complexes and their homology, against complexes built by hand and against gudhi."""

import math
from itertools import combinations

import gudhi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.maths.simplicial import (
    FlagComplex,
    betti,
    bits,
    edge,
    find_redundant,
    hole_cycles,
    may_leave,
    relative_cycles,
)

Graph = dict[int, list[int]]


def graph(*edges: tuple[int, int], alone: tuple[int, ...] = ()) -> Graph:
    lists: Graph = {vertex: [] for vertex in (*alone, *sorted({v for e in edges for v in e}))}
    for i, j in edges:
        lists[i].append(j)
        lists[j].append(i)
    return lists


def ring(count: int, first: int = 0) -> list[tuple[int, int]]:
    return [(first + n, first + (n + 1) % count) for n in range(count)]


def wheel(count: int) -> Graph:
    return graph(*ring(count), *((n, count) for n in range(count)))


def disc_graph(position: np.ndarray, range_m: float) -> Graph:
    apart = np.hypot(*(position[:, None] - position[None, :]).transpose(2, 0, 1))
    near = (apart <= range_m) & ~np.eye(len(position), dtype=bool)
    return {n: np.flatnonzero(row).tolist() for n, row in enumerate(near)}


def gudhi_betti(complex_: FlagComplex, dimensions: int) -> list[int]:
    tree = gudhi.SimplexTree()
    for simplex in (*((v,) for v in complex_.vertices), *complex_.edges, *complex_.triangles):
        tree.insert(list(simplex))
    tree.compute_persistence(homology_coeff_field=2, persistence_dim_max=True)
    return [*tree.betti_numbers(), 0, 0, 0][:dimensions]


def gudhi_relative_b2(complex_: FlagComplex, fence: list[tuple[int, int]]) -> int:
    """H2 of the pair, as that of the complex with a cone over the fence (the paper's vertex Q)."""
    tree, apex = gudhi.SimplexTree(), max(complex_.vertices, default=0) + 1
    for simplex in (*((v,) for v in complex_.vertices), *complex_.edges, *complex_.triangles):
        tree.insert(list(simplex))
    for i, j in fence:
        tree.insert([i, j, apex])
    tree.compute_persistence(homology_coeff_field=2, persistence_dim_max=True)
    return [*tree.betti_numbers(), 0, 0, 0][2]


def gudhi_b1_coned(complex_: FlagComplex, cycles: list[tuple[int, ...]]) -> int:
    """The holes that remain after the holes of the cycles are filled."""
    tree = gudhi.SimplexTree()
    for simplex in (*((v,) for v in complex_.vertices), *complex_.edges, *complex_.triangles):
        tree.insert(list(simplex))
    for apex, cycle in enumerate(cycles, 1 + max(complex_.vertices, default=0)):
        for i, j in zip(cycle, (*cycle[1:], cycle[0]), strict=True):
            tree.insert([i, j, apex])
    tree.compute_persistence(homology_coeff_field=2, persistence_dim_max=True)
    return [*tree.betti_numbers(), 0, 0][1]


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    count = draw(st.integers(1, 12))
    pairs = list(combinations(range(count), 2))
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    return graph(*chosen, alone=tuple(range(count)))


# --- by hand --------------------------------------------------------------------------------------------------------


def test_an_edge_needs_both_ends_to_see_each_other() -> None:
    complex_ = FlagComplex({1: [2, 3], 2: [1], 3: []})
    assert complex_.edges == ((1, 2),)


def test_a_neighbour_that_never_reported_is_no_vertex() -> None:
    assert FlagComplex({1: [2, 9], 2: [1]}).vertices == (1, 2)


def test_three_robots_that_all_see_each_other_are_a_triangle() -> None:
    complex_ = FlagComplex(graph((1, 2), (2, 3), (1, 3), (3, 4)))
    assert complex_.triangles == ((1, 2, 3),)
    assert complex_.common(1, 2) == (3,)


@pytest.mark.parametrize(
    ("lists", "expected"),
    [
        (graph(alone=(1,)), (1, 0)),
        (graph(alone=(1, 2)), (2, 0)),
        (graph(*ring(3)), (1, 0)),
        (graph(*ring(4)), (1, 1)),
        (graph(*ring(4), *ring(5, 10)), (2, 2)),
        (wheel(6), (1, 0)),
    ],
)
def test_betti_numbers_of_small_complexes_are_known(lists: Graph, expected: tuple[int, int]) -> None:
    assert betti(FlagComplex(lists)) == expected


def test_a_wheels_hub_is_its_fundamental_class_and_may_not_leave() -> None:
    complex_ = FlagComplex(wheel(6))
    cycles, edges = relative_cycles(complex_, [edge(*each) for each in ring(6)])
    assert [chain.bit_count() for chain in cycles] == [6]
    assert {complex_.edges[n] for n in bits(edges[0])} == {edge(*each) for each in ring(6)}
    assert not may_leave(6, complex_.neighbours)
    assert find_redundant(complex_, [edge(*each) for each in ring(6)]).redundant == ()


def test_of_two_hubs_one_is_redundant() -> None:
    lists = graph(*ring(6), *((n, hub) for n in range(6) for hub in (6, 7)), (6, 7))
    found = find_redundant(FlagComplex(lists), [edge(*each) for each in ring(6)])
    assert found.redundant in ((6,), (7,))
    assert len(found.cycle) == 6
    assert set(found.boundary) == {edge(*each) for each in ring(6)}


def test_an_open_fence_makes_no_robot_redundant() -> None:
    """With a fence chain that is not closed, a tetrahedron's boundary would wrongly be accepted as a certificate."""
    lists = graph(*ring(6), *((n, hub) for n in range(6) for hub in (6, 7)), (6, 7))
    assert find_redundant(FlagComplex(lists), [edge(*each) for each in ring(6)][:4]).redundant == ()


def test_a_robot_in_no_triangle_is_never_redundant() -> None:
    lists = graph((0, 1), (1, 2), (2, 3), (2, 4), (3, 4))
    assert 1 not in find_redundant(FlagComplex(lists), [(2, 3), (3, 4), (2, 4)]).redundant


def test_the_cycle_around_a_hole_is_a_shortest_one() -> None:
    """A square within a hexagon, one hole: the square is the way. Beside it another, of five."""
    outer, inner = ring(6), ring(4, 6)
    spokes = [(0, 6), (1, 6), (1, 7), (2, 7), (3, 7), (3, 8), (4, 8), (4, 9), (5, 9), (0, 9)]
    lists = graph(*outer, *inner, *spokes, *ring(5, 20), (20, 0))
    assert hole_cycles(FlagComplex(lists)) == [(6, 7, 8, 9), (20, 21, 22, 23, 24)]


def test_a_disc_has_no_cycle_around_a_hole() -> None:
    assert hole_cycles(FlagComplex(wheel(6))) == []


# --- against gudhi --------------------------------------------------------------------------------------------------


@settings(max_examples=150, deadline=None, derandomize=True)
@given(graphs())
def test_there_is_one_cycle_for_each_hole_and_no_cycle_is_a_boundary(lists: Graph) -> None:
    complex_ = FlagComplex(lists)
    cycles = hole_cycles(complex_)
    for cycle in cycles:
        assert all(edge(*pair) in complex_ for pair in zip(cycle, (*cycle[1:], cycle[0]), strict=True))
    # A cone over every one of them fills every hole, and each of them is needed.
    for kept in range(len(cycles) + 1):
        assert gudhi_b1_coned(complex_, cycles[:kept]) == len(cycles) - kept


@settings(max_examples=150, deadline=None, derandomize=True)
@given(graphs())
def test_betti_numbers_agree_with_gudhi(lists: Graph) -> None:
    complex_ = FlagComplex(lists)
    assert list(betti(complex_)) == gudhi_betti(complex_, 2)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(graphs(), st.data())
def test_relative_h2_agrees_with_gudhi(lists: Graph, data: st.DataObject) -> None:
    complex_ = FlagComplex(lists)
    fence = data.draw(st.lists(st.sampled_from(complex_.edges), unique=True)) if complex_.edges else []
    assert len(relative_cycles(complex_, fence)[0]) == gudhi_relative_b2(complex_, fence)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(graphs())
def test_a_vertex_that_may_leave_changes_neither_pieces_nor_holes(lists: Graph) -> None:
    complex_ = FlagComplex(lists)
    before = gudhi_betti(complex_, 2)
    for vertex in complex_.vertices:
        if may_leave(vertex, complex_.neighbours):
            assert gudhi_betti(complex_.without([vertex]), 2) == before


def random_disc(cells: int, seed: int) -> tuple[FlagComplex, list[tuple[int, int]]]:
    """A square of cells x cells, each with a robot at random in it, and robots around it that are the fence."""
    random = np.random.default_rng(seed)
    side, cell = 0.4 * cells, 0.4
    around = 4 * math.ceil(side / 0.8)
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side], [0, 0]])
    along = np.linspace(0, 4, around, endpoint=False)
    border = np.stack([np.interp(along, np.arange(5), corners[:, axis]) for axis in (0, 1)], axis=1)
    grid = np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), axis=-1).reshape(-1, 2) * cell
    position = np.vstack([border, grid + random.uniform(0.0, cell, (cells * cells, 2))])
    return FlagComplex(disc_graph(position, 1.0)), [edge(n, (n + 1) % around) for n in range(around)]


def test_certificates_hold_on_random_complexes() -> None:
    """The cycle is one: over Z2 its triangles' edges cancel but for the boundary, which is fence; and no hole opens."""
    spared = 0
    for seed in range(150):
        complex_, fence = random_disc(3 + seed % 3, seed)
        found = find_redundant(complex_, fence)
        odd: dict[tuple[int, int], int] = {}
        for i, j, k in found.cycle:
            for each in ((i, j), (i, k), (j, k)):
                odd[each] = odd.get(each, 0) ^ 1
        assert sorted(each for each, parity in odd.items() if parity) == sorted(found.boundary)
        assert set(found.boundary) <= set(fence)
        assert not {v for each in found.cycle for v in each} & set(found.redundant)
        assert gudhi_betti(complex_.without(found.redundant), 2) == gudhi_betti(complex_, 2)
        spared += len(found.redundant)
    assert spared > 750
