"""The fence by bearings alone, on complexes built by hand: sides, exceptions, corners, angles, wedges."""

import math

import numpy as np
import pytest

from zwerm.agents.sensor_coverage.frontier.fence import (
    Side,
    fence,
    is_exception,
    nearest_on_side,
    relative,
    side_of,
    uncovered,
    wedges,
)
from zwerm.agents.sensor_coverage.frontier.paths import cheapest_routes
from zwerm.maths.simplicial import FlagComplex

Views = dict[int, dict[int, float]]
SIXTY = math.pi / 3.0


def swarm(
    slots: dict[int, tuple[float, float]], turned: dict[int, float] | None = None, range_m: float = 1.0, blind=()
) -> tuple[Views, FlagComplex]:
    """The bearings between robots at these places, each in the frame of its own robot."""
    turned = turned or {}
    views: Views = {
        i: {
            j: math.remainder(math.atan2(there[1] - here[1], there[0] - here[0]) - turned.get(i, 0.0), math.tau)
            for j, there in slots.items()
            if j != i and math.dist(here, there) <= range_m and (i, j) not in blind
        }
        for i, here in slots.items()
    }
    return views, FlagComplex(views)


def hexagon(side: float = 0.95) -> dict[int, tuple[float, float]]:
    """Robot 0 and six around it."""
    around = {n + 1: (side * math.cos(n * SIXTY), side * math.sin(n * SIXTY)) for n in range(6)}
    return {0: (0.0, 0.0), **around}


def test_relative_bearings_are_plain_differences_and_positive_to_the_left() -> None:
    """The formula as printed would make -170 degrees of 10."""
    view = {1: math.radians(175.0), 2: math.radians(-175.0)}
    assert relative(view, 1, 2) == pytest.approx(math.radians(10.0))
    assert relative(view, 2, 1) == pytest.approx(math.radians(-10.0))


def test_a_common_neighbour_is_on_the_side_that_both_ends_see_it_on() -> None:
    views, _ = swarm({1: (0.0, 0.0), 2: (0.9, 0.0), 3: (0.45, 0.5), 4: (0.45, -0.5)})
    assert side_of(views, 1, 2, 3) == 1
    assert side_of(views, 1, 2, 4) == -1
    assert side_of(views, 2, 1, 3) == -1


def test_an_edge_between_two_triangles_is_covered_on_both_sides_and_one_below_both_is_not() -> None:
    """Figure 7."""
    views, complex_ = swarm({1: (0.0, 0.0), 2: (0.9, 0.0), 3: (0.45, 0.5), 4: (0.45, -0.5)})
    assert uncovered(views, complex_, 1, 2) == ()
    views, complex_ = swarm({1: (0.0, 0.0), 2: (0.9, 0.0), 3: (0.3, 0.5), 4: (0.6, 0.6)})
    assert uncovered(views, complex_, 1, 2) == (-1,)


def test_the_fence_of_a_hexagon_is_its_boundary_and_a_new_robot_is_placed_at_60_degrees() -> None:
    views, complex_ = swarm(hexagon())
    found = fence(views, complex_, 0.0)
    boundary_edges = [(1, 2), (1, 6), (2, 3), (3, 4), (4, 5), (5, 6)]
    assert [side.edge for side in found.sides] == boundary_edges
    assert found.corners == ()
    assert all(side.angle_i_rad == pytest.approx(SIXTY) for side in found.sides)
    assert {side.edge: side.sign for side in found.sides}[1, 2] == -1


def test_an_edge_inside_other_triangles_of_a_common_neighbour_is_an_exception() -> None:
    """Figure 6(a): from k, the chain i, 3, 4, j passes beyond the edge {i, j}."""
    slots = {0: (0.0, 0.0), 1: (0.7, -0.4), 2: (0.7, 0.4), 3: (0.9, -0.2), 4: (0.9, 0.2)}
    views, complex_ = swarm(slots)
    assert is_exception(views, complex_, 1, 2)


def test_a_chain_on_this_side_of_the_edge_is_no_exception() -> None:
    """A robot within triangle kij: the printed rule would apply, although nothing covers the space beyond."""
    slots = {0: (0.0, 0.0), 1: (0.7, -0.4), 2: (0.7, 0.4), 3: (0.3, 0.0)}
    views, complex_ = swarm(slots)
    assert not is_exception(views, complex_, 1, 2)
    assert (1, 2) in [side.edge for side in fence(views, complex_, 0.0).sides]


def test_robots_exactly_in_line_along_a_wall_make_no_exception_edge() -> None:
    views, complex_ = swarm({1: (0.0, 0.0), 2: (0.4, 0.0), 3: (0.9, 0.0), 4: (0.4, 0.5)})
    assert relative(views[3], 1, 2) == 0.0
    assert not is_exception(views, complex_, 1, 2)


def test_robots_at_the_same_point_make_no_exception_edge() -> None:
    views, complex_ = swarm({1: (0.0, 0.0), 2: (0.9, 0.0), 3: (0.9, 0.0), 4: (0.45, 0.3)})
    assert not is_exception(views, complex_, 2, 3)


def test_a_gap_below_120_degrees_is_bisected() -> None:
    """Figure 8(b): min(60 degrees, half the angle to the next neighbour)."""
    slots = {1: (0.0, 0.0), 2: (0.95, 0.0), 3: (0.95 * math.cos(1.7), 0.95 * math.sin(1.7))}
    views, complex_ = swarm(slots)
    sides = {(side.i, side.j, side.sign): side for side in fence(views, complex_, 0.0).sides}
    assert sides[1, 2, 1].angle_i_rad == pytest.approx(0.85)
    assert sides[1, 2, 1].angle_j_rad == pytest.approx(SIXTY)
    assert sides[1, 2, -1].angle_i_rad == pytest.approx(SIXTY)
    assert nearest_on_side(views, complex_, 1, 2, 1) == 3


def test_a_corner_below_60_degrees_makes_obstacle_edges() -> None:
    """Figure 6(c): j and k do not see each other though they are near, so something stands between them."""
    slots = {1: (0.0, 0.0), 2: (0.9, 0.0), 3: (0.9 * math.cos(0.9), 0.9 * math.sin(0.9))}
    views, complex_ = swarm(slots, blind=((2, 3), (3, 2)))
    found = fence(views, complex_, 0.0)
    assert found.corners == ((1, 2), (1, 3))
    assert Side(1, 2, 1) not in found.sides


def test_a_bearing_from_one_end_only_makes_no_edge() -> None:
    views, complex_ = swarm(hexagon(), blind=((1, 2),))
    assert (1, 2) not in complex_
    assert (1, 2) not in [side.edge for side in fence(views, complex_, 0.15).sides]


def test_turning_any_robots_frame_does_not_change_the_fence() -> None:
    random = np.random.default_rng(5)
    slots = {n: (float(x), float(y)) for n, (x, y) in enumerate(random.uniform(0.0, 2.5, (25, 2)))}
    straight, complex_ = swarm(slots)
    turned, _ = swarm(slots, {n: float(random.uniform(-3.0, 3.0)) for n in slots})
    expected, found = fence(straight, complex_, 0.15), fence(turned, complex_, 0.15)
    assert found.corners == expected.corners
    assert [side[:3] for side in found.sides] == [side[:3] for side in expected.sides]
    assert len(found.sides) > 5
    for one, other in zip(found.sides, expected.sides, strict=True):
        assert one[3:] == pytest.approx(other[3:])


def test_wedges_close_the_fence_where_the_sign_rule_leaves_it_open() -> None:
    """Robot a sees i, b and j, edge ab crosses ij, and b and j do not see each other."""
    views, complex_ = swarm({1: (0.0, 0.0), 2: (0.95, 0.0)})
    assert [(i, a, b) for i, a, b, _ in wedges(views, complex_)] == [(1, 2, 2), (2, 1, 1)]
    views, complex_ = swarm(hexagon())
    boundary_edges = {frozenset((i, each)) for i, a, b, _ in wedges(views, complex_) for each in (a, b)}
    assert boundary_edges == {frozenset((n, n % 6 + 1)) for n in range(1, 7)}


def test_a_path_avoids_obstacle_edges_where_the_way_round_is_cheaper() -> None:
    """Figure 9(a): 12, 10, 6, 2; with the first edge at a wall it costs more than the path around it."""
    lists = {12: [10, 11], 10: [12, 6], 6: [10, 2], 2: [6, 11], 11: [12, 2]}
    complex_ = FlagComplex(lists)
    assert cheapest_routes(complex_, {12: 0.0}, (), 3.0).path(2) == (12, 11, 2)
    assert cheapest_routes(complex_, {12: 0.0}, ((11, 12), (2, 11)), 3.0).path(2) == (12, 10, 6, 2)


def test_the_path_begins_at_the_nearest_of_several_sources() -> None:
    complex_ = FlagComplex({n: [m for m in (n - 1, n + 1) if 0 <= m <= 6] for n in range(7)})
    ways = cheapest_routes(complex_, {0: 0.0, 6: 0.0}, (), 3.0)
    assert ways.path(2) == (0, 1, 2)
    assert ways.path(5) == (6, 5)
