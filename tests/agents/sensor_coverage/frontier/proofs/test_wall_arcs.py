"""The arcs at walls of one slot: what it closes without any other slot."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.proofs.wall_arcs import WallArcs
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc


@pytest.mark.parametrize(
    ("walls", "point", "closes"),
    [
        pytest.param((0, 200), 60, True, id="from the point on, and on past the line to the other slot"),
        pytest.param((0, 170), 60, False, id="not up to that line"),
        pytest.param((50, 200), 60, False, id="not where the robot sees the point when it is pushed"),
        pytest.param((-200, 0), -60, True, id="the point is to the right"),
        pytest.param(
            (-25, 200), 0, False, id="the point is in the direction of the other slot, which side is not known"
        ),
        pytest.param((0, 360), 0, True, id="walls all around"),
    ],
)
def test_walls_close_what_is_beyond_a_triangle_with_a_point_beside_the_robot(
    walls: tuple[int, int], point: int, closes: bool
) -> None:
    """The other slot is in the direction 0. Rays from there go past the point, up to the opposite direction."""
    edged = Arc(math.radians(walls[0]), math.radians(walls[1] - walls[0]))
    assert WallArcs([], [], {}, [edged], []).close_beyond(0.0, math.radians(point)) is closes
