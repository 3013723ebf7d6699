"""Cells, closed forms and quadrature, each compared with another method."""

import math
from itertools import combinations

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import cubature, dblquad
from scipy.spatial import Voronoi

from zwerm.maths.polygons import estimated_centroid, linear_centroid, moments, nearest_point, voronoi_cell
from zwerm.world.arena.arena import Arena
from zwerm.world.fields.constant import Constant
from zwerm.world.fields.gaussians import Gaussians
from zwerm.world.fields.linear import Linear
from zwerm.world.geometry import tessellation
from zwerm.world.geometry.quadrature import integrate
from zwerm.world.geometry.tessellation import Tessellation
from zwerm.world.geometry.voronoi_cells import VoronoiCells

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
HEPTAGON = [(0.5 + 0.5 * math.cos(angle), 0.5 + 0.4 * math.sin(angle)) for angle in np.arange(7) * (math.tau / 7)]

unit = st.floats(0.001, 0.999)
# Apart by more than what counts as one place.
swarms = (
    st.lists(st.tuples(unit, unit), min_size=1, max_size=40, unique=True)
    .filter(lambda places: all(math.dist(p, q) > 1e-10 for p, q in combinations(places, 2)))
    .map(np.array)
)


def relative(polygon, here):
    return [(x - here[0], y - here[1]) for x, y in polygon]


def cell_of(position, robot, region):
    here = position[robot]
    others = [tuple(other - here) for row, other in enumerate(position) if row != robot]
    return [(x + here[0], y + here[1]) for x, y in voronoi_cell(relative(region, here), others)]


def random_cells(count, seed):
    """Yield cells of random swarms, relative to their robots, and a linear field that is positive on each."""
    random = np.random.default_rng(seed)
    while count > 0:
        position = random.uniform(0.02, 0.98, (random.integers(2, 60), 2))
        for robot in range(len(position)):
            cell = relative(cell_of(position, robot, SQUARE), position[robot])
            gradient = random.normal(size=2)
            lowest = min(gradient[0] * x + gradient[1] * y for x, y in cell)
            yield cell, -lowest * random.uniform(1.0, 4.0), *gradient.tolist()
            count -= 1
            if count == 0:
                return


# --- cells ----------------------------------------------------------------------------------------------------------


@settings(max_examples=150, deadline=None)
@given(swarms)
@pytest.mark.parametrize("region", [SQUARE, HEPTAGON], ids=["square", "heptagon"])
def test_cells_tile_the_region(region, position):
    outline = shapely.Polygon(region)
    cells = [
        shapely.Polygon(cell) for robot in range(len(position)) if len(cell := cell_of(position, robot, region)) > 2
    ]
    assert sum(cell.area for cell in cells) == pytest.approx(outline.area, rel=1e-9)
    assert shapely.union_all(cells, grid_size=1e-12).area == pytest.approx(outline.area, rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(5, 60))
def test_cells_are_those_of_scipy(seed, count):
    position = np.random.default_rng(seed).uniform(0.01, 0.99, (count, 2))
    # Mirror images across the four sides close every cell at the square.
    mirrored = np.concatenate([position] + [np.abs([2 * a, 0] - position) * [1 if a else -1, 1] for a in (0, 1)])
    mirrored = np.concatenate([mirrored] + [np.abs([0, 2 * b] - position) * [1, 1 if b else -1] for b in (0, 1)])
    diagram = Voronoi(mirrored)
    for robot in range(count):
        expected = shapely.Polygon(diagram.vertices[diagram.regions[diagram.point_region[robot]]]).convex_hull
        found = shapely.Polygon(cell_of(position, robot, SQUARE))
        assert found.hausdorff_distance(expected) < 1e-9


@settings(max_examples=100, deadline=None)
@given(swarms)
def test_voronoi_neighbours_alone_give_the_same_cell_as_all_robots(position):
    arena = Arena(shapely.Polygon(SQUARE))
    for robot, cell in enumerate(VoronoiCells(arena, Constant(1.0)).cells(position)):
        everyone = relative(cell_of(position, robot, SQUARE), position[robot])
        assert shapely.Polygon(cell).hausdorff_distance(shapely.Polygon(everyone)) < 1e-9


def test_a_kept_or_repaired_triangulation_equals_a_new_one(monkeypatch):
    made = []
    triangulate = tessellation._triangulate
    monkeypatch.setattr(tessellation, "_triangulate", lambda position: made.append(1) or triangulate(position))
    random = np.random.default_rng(5)
    position = random.random((80, 2))
    kept = Tessellation()
    changes = mended = 0
    for _ in range(300):
        before, earlier = kept.pairs(position), len(made)
        position = np.clip(position + random.normal(scale=0.0007, size=position.shape), 0.0, 1.0)
        found = kept.pairs(position)
        mended += found is not before and len(made) == earlier
        np.testing.assert_array_equal(found, Tessellation().pairs(position))
        changes += found is not before
    assert 20 < mended < changes < 290  # the kept, the repaired and the new have been compared


def test_a_hull_that_is_dented_or_crossed_is_repaired_too(monkeypatch):
    angle = np.arange(9) * (math.tau / 9)
    inner = np.random.default_rng(6).uniform(-0.5, 0.5, (20, 2))
    made, hulls = [], []
    kept = Tessellation()
    triangulate = tessellation._triangulate
    for step in range(120):
        # Every third of the outer robots goes in and out again, the others stay, at their own distances from the middle.
        radius = 1.0 - 0.4 * math.sin(step * math.pi / 120) * (np.arange(9) % 3 == 0) + 0.001 * np.arange(9)
        position = np.concatenate([radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), inner])
        expected = Tessellation().pairs(position)
        monkeypatch.setattr(tessellation, "_triangulate", lambda place: made.append(1) or triangulate(place))
        np.testing.assert_array_equal(kept.pairs(position), expected)
        monkeypatch.setattr(tessellation, "_triangulate", triangulate)
        hulls.append(kept._mesh.hull.shape[1])
    assert (len(made), max(hulls), min(hulls), hulls[-1]) == (1, 9, 6, 9)


@pytest.mark.parametrize(
    "position",
    [
        [(0.5, 0.5)] * 4,
        [(0.1, 0.1), (0.2, 0.2), (0.3, 0.3), (0.7, 0.7), (0.9, 0.9)],
        [(0.5, 0.5), (0.5, 0.5), (0.1, 0.1), (0.9, 0.2), (0.4, 0.8), (0.5, 0.5)],
        [(0.5, 0.5), (0.1, 0.2)],
        [(0.3, 0.3)],
    ],
    ids=["one place", "one line", "three at one place", "two", "one"],
)
def test_robots_at_one_place_or_on_one_line_still_have_cells_that_cover_the_region(position):
    position = np.array(position)
    cells = VoronoiCells(Arena(shapely.Polygon(SQUARE)), Constant(1.0)).cells(position)
    places = {tuple(here): shapely.Polygon(cell).area for here, cell in zip(position.tolist(), cells, strict=True)}
    assert sum(places.values()) == pytest.approx(1.0)


def test_a_cell_that_is_far_from_the_region_is_empty_and_the_way_back_is_the_nearest_place():
    here = np.array([3.0, 0.5])
    region = relative(SQUARE, here)
    assert voronoi_cell(region, [(-2.0, 0.0)]) == []
    assert nearest_point(region) == (-2.0, 0.0)


# --- the closed form ------------------------------------------------------------------------------------------------


def printed_moments(polygon):
    """Return the six integrals as the paper prints them, side by side."""
    i00 = i10 = i01 = i20 = i11 = i02 = 0.0
    for (x, y), (u, v) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        i00 += (v - y) * (u + x) / 2
        i01 += ((x - u) * (v**2 + v * y + y**2) + 3 * (u * v**2 - x * y**2)) / 6
        i10 += (v - y) * (u**2 + u * x + x**2) / 6
        i11 += (v - y) * (2 * u * x * (v + y) + u**2 * (3 * v + y) + x**2 * (v + 3 * y)) / 24
        i02 += ((x - u) * (v**3 + v**2 * y + v * y**2 + y**3) + 4 * (u * v**3 - x * y**3)) / 12
        i20 += (v - y) * (u**3 + u**2 * x + u * x**2 + x**3) / 12
    return i00, i10, i01, i20, i11, i02


def test_the_moments_are_those_the_paper_prints():
    for cell, *_ in random_cells(200, seed=1):
        np.testing.assert_allclose(moments(cell), printed_moments(cell), rtol=1e-11, atol=1e-16)


def adaptive(cells, fields):
    """Return (n, 3) mass and centroid by scipy's adaptive cubature over the triangles between corners and their mean."""
    middle = [np.mean(cell, axis=0) for cell in cells]
    owner = np.repeat(np.arange(len(cells)), [len(cell) for cell in cells])
    p = np.array(middle)[owner]
    a = np.concatenate([np.array(cell) for cell in cells])
    b = np.concatenate([np.roll(cell, -1, axis=0) for cell in cells])
    jacobian = np.abs((a - p)[:, 0] * (b - p)[:, 1] - (a - p)[:, 1] * (b - p)[:, 0])
    value, gradient = np.array(fields)[owner, 0], np.array(fields)[owner, 1:]

    def integrand(at):
        s, t = at[:, 0, None, None], at[:, 1, None, None]
        place = p + s * ((1.0 - t) * (a - p) + t * (b - p))  # (nodes, triangles, 2)
        density = (value + (gradient * place).sum(axis=2)) * jacobian * at[:, 0, None]
        return np.stack([density, density * place[:, :, 0], density * place[:, :, 1]], axis=1)

    found = cubature(integrand, [0.0, 0.0], [1.0, 1.0], rule="genz-malik", rtol=1e-12, atol=1e-18)
    assert found.status == "converged"
    total = np.column_stack([np.bincount(owner, row) for row in found.estimate])
    return total / np.column_stack([np.ones(len(cells)), total[:, 0], total[:, 0]])


def test_the_closed_form_is_adaptive_quadrature_to_a_billionth_over_ten_thousand_cells_and_fields():
    worst = 0.0
    cases = list(random_cells(10_000, seed=3))
    for start in range(0, len(cases), 500):
        some = cases[start : start + 500]
        expected = adaptive([cell for cell, *_ in some], [field for _, *field in some])
        for (cell, *field), right in zip(some, expected.tolist(), strict=True):
            found = linear_centroid(cell, *field)
            size = max(math.hypot(x, y) for x, y in cell)
            worst = max(worst, abs(found[0] / right[0] - 1.0), math.dist(found[1:], right[1:]) / size)
    assert worst < 1e-9


@settings(max_examples=300, deadline=None)
@given(swarms, st.floats(-10.0, 10.0), st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
@example(np.array([[0.5, 0.5]]), 0.0, 0.0, 0.0)
@example(np.array([[0.5, 0.5], [0.2, 0.2]]), -1.0, 0.0, 0.0)
@example(np.array([[0.5, 0.5], [0.2, 0.2]]), -1.0, 1e-300, 0.0)
@example(np.array([[0.5, 0.5], [0.5, 0.5 + 2e-12], [0.5 + 2e-12, 0.5]]), 1.0, 2.0, 3.0)
@example(np.array([[0.001, 0.5]]), 5e-324, 0.0, 5e-324)
def test_the_centroid_lies_in_the_cell_for_every_field(position, value, gx, gy):
    for robot in range(len(position)):
        cell = relative(cell_of(position, robot, SQUARE), position[robot])
        centroid = estimated_centroid(cell, value, gx, gy)
        assert centroid is not None
        x, y = centroid
        assert shapely.Polygon(cell).distance(shapely.Point(x, y)) < 1e-9


def test_a_steep_field_is_truncated_to_where_its_estimate_is_positive():
    # 1 + 4 x over the square about the robot is negative left of x = -1/4: V+ is three quarters of it.
    square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    centroid = estimated_centroid(square, 1.0, 4.0, 0.0)
    assert centroid is not None
    x, y = centroid
    # A density that rises from 0 over a width of 3/4 has its centroid at two thirds of it.
    assert (x, y) == (pytest.approx(-0.25 + 0.75 * 2.0 / 3.0), pytest.approx(0.0))
    mass, untruncated, _ = linear_centroid(square, 1.0, 4.0, 0.0)
    assert (mass, untruncated) == (pytest.approx(1.0), pytest.approx(1.0 / 3.0))


@pytest.mark.parametrize("value", [0.0, -1.0, -1e-320])
def test_where_the_field_is_zero_or_negative_everywhere_the_centroid_is_the_cells_own(value):
    triangle = [(-1.0, -1.0), (2.0, -1.0), (-1.0, 2.0)]
    assert estimated_centroid(triangle, value, 0.0, 0.0) == (pytest.approx(0.0), pytest.approx(0.0))


@pytest.mark.parametrize("cell", [[], [(1.0, 1.0)], [(1.0, 1.0), (2.0, 2.0)], [(0.0, 0.0)] * 3])
def test_a_cell_without_area_has_no_centroid(cell):
    assert estimated_centroid(cell, 1.0, 2.0, 3.0) is None


# --- the truth ------------------------------------------------------------------------------------------------------


def test_the_worlds_quadrature_agrees_with_scipys_over_a_gaussian():
    hill = Gaussians([0.56], [(0.2, 0.2)], [0.7])
    position = np.random.default_rng(4).uniform(0.05, 0.95, (10, 2))
    cells = [cell_of(position, robot, SQUARE) for robot in range(10)]
    found = integrate(cells, position, hill)

    def cost(y, x):
        nearest = np.square(position - (x, y)).sum(axis=1).min()
        return 0.5 * nearest * hill.value(np.array([[x, y]]))[0]

    assert found.mass.sum() == pytest.approx(
        dblquad(lambda y, x: hill.value(np.array([[x, y]]))[0], 0, 1, 0, 1, epsrel=1e-9)[0], rel=1e-9
    )
    assert found.cost.sum() == pytest.approx(dblquad(cost, 0, 1, 0, 1, epsabs=1e-5, epsrel=1e-3)[0], rel=1e-2)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32), st.integers(2, 30))
def test_the_cost_never_rises_for_a_linear_field(seed, count):
    random = np.random.default_rng(seed)
    position = random.uniform(0.02, 0.98, (count, 2))
    coverage = VoronoiCells(Arena(shapely.Polygon(SQUARE)), Linear(1.5, tuple(random.uniform(-0.7, 0.7, 2))))
    costs = []
    for _ in range(15):
        exact = coverage.integrals(position)
        estimated = coverage.targets(position)
        # The linear estimate of a linear field is the field.
        np.testing.assert_allclose(estimated, exact.centroid - position, atol=1e-12)
        costs.append(exact.cost.sum())
        position = position + 0.1 * estimated  # k dt = 5 /s x 0.02 s
    assert (np.diff(costs) <= 1e-15).all()
    assert costs[-1] < costs[0]
