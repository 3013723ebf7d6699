"""The cells that a picture of robot teams shows follow from the swept slices."""

import numpy as np

from zwerm.view.layers.robot_teams import Slice, cells_of


def test_a_room_is_one_cell() -> None:
    found = cells_of([(float(k), 0.0, 5.0) for k in range(5)])
    assert found.middles.tolist() == [[2.0, 2.5]]
    assert found.edges == []


def test_an_obstacle_makes_four_cells_in_a_ring() -> None:
    slices: list[Slice] = [(0.0, 0.0, 9.0), (1.0, 0.0, 9.0)]
    slices += [(x, low, high) for x in (2.0, 3.0, 4.0) for low, high in ((0.0, 3.0), (6.0, 9.0))]
    slices += [(5.0, 0.0, 9.0), (6.0, 0.0, 9.0)]
    found = cells_of(slices)
    assert len(found.middles) == 4
    degree = np.bincount(np.array(found.edges).ravel(), minlength=4)
    assert degree.tolist() == [2, 2, 2, 2]
    assert sorted(map(tuple, found.gates.tolist())) == [(1.5, 1.5), (1.5, 7.5), (4.5, 1.5), (4.5, 7.5)]


def test_the_order_of_slices_and_sweeps_in_parts_have_no_influence() -> None:
    slices: list[Slice] = [(0.0, 0.0, 5.0), (1.0, 0.0, 3.0), (1.0, 2.5, 5.0), (1.0, 0.0, 5.0), (2.0, 0.0, 5.0)]
    assert cells_of(slices).edges == cells_of(slices[::-1]).edges == []
    assert len(cells_of(slices).middles) == 1


def test_slices_that_no_robot_swept_keep_cells_apart() -> None:
    found = cells_of([(0.0, 0.0, 5.0), (1.0, 0.0, 5.0), (4.0, 0.0, 5.0)])
    assert len(found.middles) == 2
    assert found.edges == []


def test_nothing_swept_is_no_cell() -> None:
    assert cells_of([]).middles.shape == (0, 2)
