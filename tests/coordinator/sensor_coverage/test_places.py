"""The places of slots, from the directions between them and the distances that robots drove."""

import cmath
from itertools import combinations

import numpy as np
import pytest

from zwerm.coordinator.sensor_coverage.places import UNKNOWN_M, places

DRIVEN_SD_M, BEARING_SD_RAD = 0.02, 0.01


def test_one_driven_side_of_a_triangle_gives_the_others() -> None:
    truth = {0: 0j, 3: 0.9 + 0j, 7: 0.3 + 0.4j}
    directions = {(a, b): (truth[b] - truth[a]) / abs(truth[b] - truth[a]) for a, b in combinations(truth, 2)}
    found = places(directions, {(0, 3): 0.9})
    assert abs(found[7] - found[0]) == pytest.approx(0.5, abs=0.01)
    assert abs(found[7] - found[3]) == pytest.approx(abs(truth[7] - truth[3]), abs=0.01)
    assert cmath.phase(found[7] - found[0]) == pytest.approx(cmath.phase(truth[7]), abs=0.01)


def test_a_distance_that_nothing_determines_counts_as_a_hop() -> None:
    found = places({(0, 1): 1j, (5, 6): 1 + 0j}, {(5, 6): 0.4})
    assert found[1] - found[0] == pytest.approx(UNKNOWN_M * 1j, abs=1e-4)
    assert found[6] - found[5] == pytest.approx(0.4, abs=0.01)
    assert places({}, {}) == {}


@pytest.mark.parametrize("seed", range(5))
def test_places_of_drawn_swarms_agree_with_the_truth(seed: int) -> None:
    """Robots in a corridor: each drove from one of the two before it, and sees those within 1 m."""
    draw = np.random.default_rng(seed)
    truth, driven_m = [0j], dict[tuple[int, int], float]()
    for new in range(1, 40):
        behind = max(0, new - int(draw.integers(1, 3)))
        truth.append(truth[behind] + cmath.rect(draw.uniform(0.3, 0.9), draw.uniform(-0.9, 0.9)))
        driven_m[behind, new] = abs(truth[new] - truth[behind]) + draw.normal(0.0, DRIVEN_SD_M)
    directions = {
        (a, b): cmath.rect(1.0, cmath.phase(truth[b] - truth[a]) + draw.normal(0.0, BEARING_SD_RAD))
        for a, b in combinations(range(40), 2)
        if abs(truth[a] - truth[b]) < 1.0
    }
    found = places(directions, driven_m)
    off_m = [abs(abs(found[a] - found[b]) - abs(truth[a] - truth[b])) for a, b in directions.keys() - driven_m.keys()]
    assert len(off_m) > 10
    assert max(off_m) < 0.1
