"""Random arenas and starts: the same for the same seed, and with room for every robot."""

from itertools import combinations
from math import hypot

import numpy as np
import pytest
from random_arenas import ORIGIN_M, random_arena, start_group
from shapely.geometry import Point, Polygon

BODY_M = 0.25


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_eight_robots_start_apart_and_clear_of_walls(seed: int) -> None:
    arena, _ = random_arena(seed, 1)
    free = Polygon(arena["polygon"], arena["obstacles"])
    poses = start_group(np.random.default_rng(seed), free, 8, ORIGIN_M)
    assert len(poses) == 8
    assert all(free.buffer(-BODY_M).contains(Point(x, y)) for x, y, _ in poses)
    assert all(hypot(x - u, y - v) > 2.0 * BODY_M for (x, y, _), (u, v, _) in combinations(poses, 2))
    assert poses == start_group(np.random.default_rng(seed), free, 8, ORIGIN_M)
    assert poses != start_group(np.random.default_rng(seed + 1), free, 8, ORIGIN_M)


def test_where_there_is_no_room_for_one_row_robots_start_in_several() -> None:
    free = Polygon([(0, 0), (3, 0), (3, 6), (0, 6)])
    poses = start_group(np.random.default_rng(1), free, 4, ORIGIN_M)
    assert len({y for _, y, _ in poses}) == 2


def test_no_room_at_all_is_an_error() -> None:
    with pytest.raises(ValueError, match="no room for 9 robots"):
        start_group(np.random.default_rng(1), Polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), 9, ORIGIN_M)
