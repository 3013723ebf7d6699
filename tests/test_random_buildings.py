"""The generator of buildings."""

import pytest
import shapely
from random_buildings import KINDS, OPENING_M, random_building


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_draws_one_connected_building(kind: str) -> None:
    texts = [random_building(kind, seed) for seed in range(8)]
    assert texts == [random_building(kind, seed) for seed in range(8)]
    assert len(set(texts)) == 8
    for text in texts:
        free = shapely.from_wkt(text)
        assert free.is_valid
        # A body with a margin gets everywhere.
        assert free.buffer(-0.48 * OPENING_M).geom_type == "Polygon"
