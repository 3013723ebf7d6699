"""A triangle with a point whose angle is nearly 180 degrees closes nothing: noise decides on which side it is."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.fans import fan_of
from zwerm.agents.sensor_coverage.frontier.wall_proof import WalkPoint


@pytest.mark.parametrize(("angle_deg", "counts"), [(160.0, True), (174.0, True), (177.0, False), (-179.0, False)])
def test_a_flat_triangle_with_a_point_of_a_walk_counts_at_no_slot(angle_deg: float, counts: bool) -> None:
    """Slot 0 sees slot 1 in the east and the point nearly in the west, as slot 26 did beside the mouth of a passage."""
    views = {0: {1: 0.0}, 1: {0: math.pi}}
    neighbours = {0: (1,), 1: (0,)}
    point = WalkPoint({0: math.radians(angle_deg), 1: math.pi - math.copysign(0.05, angle_deg)}, (), ())
    walls_beyond = {(slot, side): True for slot in (0, 1) for side in (1, -1)}
    assert fan_of(point, views, neighbours, walls_beyond) == (((0, 1), (1, 0)) if counts else ())
