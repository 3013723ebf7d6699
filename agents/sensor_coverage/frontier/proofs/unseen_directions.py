"""The directions in which a slot alone saw walks: a neighbour that stood there then did not see them, and nobody else did."""

import math
from typing import Final

from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc

# Directions this close [deg] to the sides of an arc are not within it: bearings have noise.
BESIDE_DEG: Final = 2


class UnseenDirections:
    """Whole degrees in which a slot saw points of walks, by the neighbour that did not see them."""

    def __init__(self) -> None:
        self._bits: dict[int, int] = {}  # bit n: a point between n and n + 1 degrees

    def note(self, neighbour: int, direction_rad: float) -> None:
        """Record a direction [rad] of a point that only the slot saw, while the neighbour stood."""
        self._bits[neighbour] = (
            self._bits.get(neighbour, 0) | 1 << math.floor(math.degrees(direction_rad % math.tau)) % 360
        )

    def within(self, neighbour: int, arc: Arc) -> bool:
        """Return whether there is such a direction within an arc."""
        first = math.ceil(math.degrees(arc.start_rad % math.tau)) + BESIDE_DEG
        width = math.floor(math.degrees(arc.width_rad)) - 2 * BESIDE_DEG
        bits = self._bits.get(neighbour, 0)
        return width > 0 and bool((bits | bits << 360) >> first & (1 << width) - 1)
