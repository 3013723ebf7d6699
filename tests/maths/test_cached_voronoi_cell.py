"""A cached cell equals a newly clipped cell."""

import importlib.util
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm import run
from zwerm.maths import cached_voronoi_cell
from zwerm.maths.cached_voronoi_cell import CachedVoronoiCell
from zwerm.maths.polygons import estimated_centroid, nearest_point, voronoi_cell
from zwerm.wire.messages import Neighbour
from zwerm.world.geometry.tessellation import Tessellation

COMPILED = pytest.mark.skipif(
    cached_voronoi_cell.__file__.endswith(".py"), reason="the C extension of the cell has not been made: no C compiler"
)
# Prints the trace of a run, with the source of the cell where the extension is.
INTERPRETED = """
import sys
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("zwerm.maths.cached_voronoi_cell", sys.argv[1])
module = sys.modules[spec.name] = module_from_spec(spec)
spec.loader.exec_module(module)
from zwerm import run
print(run("voronoi-coverage-table1", runner="inline", overrides=sys.argv[2:]).trace)
assert sys.modules[spec.name] is module
"""

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
ANGLES = np.arange(7) * (math.tau / 7)
HEPTAGON = 0.5 + 0.45 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
L_SHAPE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.5, 0.5), (0.5, 1.0), (0.0, 1.0)])
REGIONS = pytest.mark.parametrize("region", [SQUARE, HEPTAGON, L_SHAPE], ids=["square", "heptagon", "L"])


def clipped(region, others, value, gx, gy):
    """Return the target by the definition: clip by all robots, truncate, integrate."""
    cell = voronoi_cell(region, [(other.x_m, other.y_m) for other in others])
    return estimated_centroid(cell, value, gx, gy) or nearest_point(region)


def seen(position, robot, region, turned=0.0, voronoi=True):
    """Return the region and the neighbours as a robot sees them that is turned."""
    rotation = np.array([[math.cos(turned), -math.sin(turned)], [math.sin(turned), math.cos(turned)]])
    others = np.delete(np.arange(len(position)), robot)
    if voronoi:
        pairs = Tessellation().pairs(position)
        others = np.sort(pairs[(pairs == robot).any(axis=1)].sum(axis=1) - robot)
    relative = ((position[others] - position[robot]) @ rotation).tolist()
    corners = tuple(map(tuple, ((region - position[robot]) @ rotation).tolist()))
    return corners, tuple(Neighbour(node, x, y) for node, (x, y) in zip(others.tolist(), relative, strict=True))


def walk(seed, count, steps, scale):
    """Yield positions of a swarm that wanders within the square."""
    random = np.random.default_rng(seed)
    position = random.uniform(0.05, 0.95, (count, 2))
    for _ in range(steps):
        yield position
        position = np.clip(position + random.normal(scale=scale, size=position.shape), 0.001, 0.999)


@REGIONS
@pytest.mark.parametrize("voronoi", [True, False], ids=["neighbours", "everyone"])
@pytest.mark.parametrize("scale", [0.001, 0.1])
def test_a_cached_voronoi_cell_has_the_centroid_of_the_clipped_one(region, voronoi, scale):
    random = np.random.default_rng(1)
    cells = [CachedVoronoiCell() for _ in range(12)]
    for position in walk(2, 12, 40, scale):
        gradient = random.normal(size=2).tolist()
        for robot, cell in enumerate(cells):
            corners, others = seen(position, robot, region, 0.3 * robot, voronoi)
            # Fields of every sort: positive on the cell, negative on some of it, and all over it.
            for value in (3.0, 0.05, -3.0):
                expected = clipped(corners, others, value, *gradient)
                assert cell.target(corners, others, value, *gradient) == pytest.approx(expected, abs=1e-12)


def test_the_cache_changes_no_bit_of_an_answer():
    kept = [CachedVoronoiCell() for _ in range(30)]
    found_anew = 0
    for position in walk(3, 30, 60, 0.003):
        for robot, cell in enumerate(kept):
            before = cell._order
            corners, others = seen(position, robot, SQUARE)
            assert cell.target(corners, others, 1.0, 0.3, -0.2) == CachedVoronoiCell().target(
                corners, others, 1.0, 0.3, -0.2
            )
            found_anew += cell._order is not before
    assert 100 < found_anew < 1000  # of 1800: orders were kept, and orders were found


@COMPILED
def test_the_compiled_cell_is_that_of_its_source_to_the_bit_and_no_older():
    source = Path(cached_voronoi_cell.__file__).with_name("cached_voronoi_cell.py")
    assert Path(cached_voronoi_cell.__file__).stat().st_mtime >= source.stat().st_mtime
    spec = importlib.util.spec_from_file_location("cached_voronoi_cell_source", source)
    assert spec is not None
    interpreted = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(interpreted)
    pairs = [(CachedVoronoiCell(), interpreted.CachedVoronoiCell()) for _ in range(30)]
    for position in walk(3, 30, 60, 0.003):
        for robot, (compiled, plain) in enumerate(pairs):
            corners, others = seen(position, robot, SQUARE)
            found = plain.target(corners, others, 1.0, 0.3, -0.2)
            assert compiled.target(corners, others, 1.0, 0.3, -0.2) == found


@COMPILED
def test_a_run_has_the_same_trace_interpreted():
    overrides = ["robots.count=12", "time.duration_s=5.0"]
    source = Path(cached_voronoi_cell.__file__).with_name("cached_voronoi_cell.py")
    command = [sys.executable, "-c", INTERPRETED, str(source), *overrides]
    interpreted = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert run("voronoi-coverage-table1", runner="inline", overrides=overrides).trace == interpreted


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(-6, 14), st.integers(-6, 14)), min_size=1, max_size=14), st.integers(0, 2**32))
def test_robots_on_a_grid_at_one_place_on_one_line_or_outside_have_the_clipped_cell(places, seed):
    """Corners where four bisectors meet, bisectors that coincide, robots on the boundary."""
    position = np.array(places) / 8.0
    cell = CachedVoronoiCell()
    for shuffle in range(3):
        corners, others = seen(position, 0, SQUARE, voronoi=False)
        expected = clipped(corners, others, 2.0, 0.1, 0.2)
        assert cell.target(corners, others, 2.0, 0.1, 0.2) == pytest.approx(expected, abs=1e-9)
        order = np.random.default_rng(seed + shuffle).permutation(len(others)) + 1
        position = position[[0, *order]]


def test_an_order_that_winds_about_the_robot_twice_is_not_taken_for_a_cell():
    def star(step):
        return tuple(Neighbour(k, 0.2 * math.cos(k * step), 0.2 * math.sin(k * step)) for k in range(5))

    corners = tuple(map(tuple, (SQUARE - 0.45).tolist()))
    cell = CachedVoronoiCell()
    cell.target(corners, star(math.tau / 5), 1.0, 0.0, 0.0)
    # The same neighbours in the order of a pentagram: consecutive bisectors still turn left.
    expected = clipped(corners, star(2 * math.tau / 5), 1.0, 1.0, 0.0)
    assert cell.target(corners, star(2 * math.tau / 5), 1.0, 1.0, 0.0) == pytest.approx(expected, abs=1e-12)


def test_a_neighbour_and_a_wall_that_come_nearer_cut_the_cell_also_where_the_robot_is_pushed_through_the_wall():
    def at(x, y):
        return tuple(map(tuple, (SQUARE - (x, y)).tolist()))

    ring = [Neighbour(k, 0.2 * math.cos(k), 0.2 * math.sin(k)) for k in range(6)]
    cell = CachedVoronoiCell()
    for far in (0.9, 0.5, 0.1, 0.05, 0.5):
        others = (*ring, Neighbour(6, far, 0.01))
        for x in (0.5, 0.9, 0.95, 0.99, 1.05, 0.95, 1.0, 3.0, 0.5, -3.0):
            expected = clipped(at(x, 0.5), others, 1.0, 0.0, 0.0)
            assert cell.target(at(x, 0.5), others, 1.0, 0.0, 0.0) == pytest.approx(expected, abs=1e-12)
