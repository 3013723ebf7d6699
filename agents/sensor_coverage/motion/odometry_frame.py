"""What a robot makes of its readings: where odometry says it is, whom it sees, and which walls it touches.

All of it is in the frame the robot had when it came out, whatever that is: a robot that is turned keeps its directions by
the odometry's turn. Bearings of robots that stand still are averaged while this robot does too.
"""

import cmath
import math

from zwerm.agents.sensor_coverage.messages.commands import Sighting
from zwerm.wire.messages import Observation

# A touch switch faces a robot, not a wall, if one is seen this far beside its sector [rad].
ROBOT_BESIDE_RAD = 0.2


class OdometryFrame:
    """One robot's knowledge of the moment, and its averages."""

    def __init__(self) -> None:
        self.x_m = 0.0
        self.y_m = 0.0
        self.turned_rad = 0.0
        self.seen: dict[int, float] = {}
        self.touched: tuple[float, ...] = ()
        self._sums: dict[int, tuple[complex, int]] = {}

    def take(self, observation: Observation) -> None:
        """Take in one observation."""
        moved = observation.odometry
        if moved is not None:
            cos, sin = math.cos(self.turned_rad), math.sin(self.turned_rad)
            self.x_m += cos * moved.forward_m - sin * moved.left_m
            self.y_m += sin * moved.forward_m + cos * moved.left_m
            self.turned_rad += moved.turn_rad
        turned = self.turned_rad
        self.seen = {each.node: each.bearing_rad + turned for each in observation.bearings or ()}
        self.touched = tuple(
            each.bearing_rad + turned
            for each in observation.touch or ()
            if not any(
                abs(math.remainder(bearing - turned - each.bearing_rad, math.tau))
                < each.half_width_rad + ROBOT_BESIDE_RAD
                for bearing in self.seen.values()
            )
        )

    def forget(self, nodes: tuple[int, ...] | None = None) -> None:
        """Drop the averages of `nodes`, or all."""
        if nodes is None:
            self._sums.clear()
        for node in nodes or ():
            self._sums.pop(node, None)

    def average(self) -> None:
        """Add what is seen now to the averages; who is out of sight is forgotten."""
        sums = self._sums
        self._sums = {}
        for node, bearing in self.seen.items():
            total, count = sums.get(node, (0j, 0))
            self._sums[node] = total + cmath.exp(1j * bearing), count + 1

    def averaged(self, samples: int) -> bool:
        """Tell whether everyone in sight was averaged over `samples`, and nobody else is on record."""
        return self._sums.keys() == self.seen.keys() and all(n >= samples for _, n in self._sums.values())

    def count(self, node: int) -> int:
        """Return how many readings the average of a robot's bearing has."""
        return self._sums[node][1] if node in self._sums else 0

    def spread(self) -> float | None:
        """Return how much one bearing errs [rad], by the averages with at least 4 readings, or None if there are none.

        It is the median over the robots in sight, the lower of two: some of them may have moved.
        """
        found = sorted(2.0 * max(0.0, 1.0 - abs(total) / n) * n / (n - 1) for total, n in self._sums.values() if n >= 4)
        return math.sqrt(found[(len(found) - 1) // 2]) if found else None

    def sightings(self) -> tuple[Sighting, ...]:
        """Return the averages, ascending by id."""
        return tuple(Sighting(node, cmath.phase(total)) for node, (total, _) in sorted(self._sums.items()))
