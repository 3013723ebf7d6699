"""A robot's position by odometry, and its readings in a frame that does not turn with the body.

The frame is the body frame at the moment when the robot came out of the depot. Bearings of visible robots are averaged
while this robot and they stand still.
"""

import cmath
import math
from collections.abc import Iterable
from typing import NamedTuple

from zwerm.wire.messages import Contact, Observation

# A closed touch switch faces a robot, not a wall, if a robot is visible within this angle of the switch's sector.
ROBOT_BESIDE_RAD = 0.2
# Readings that an average needs before its spread is used.
SPREAD_READINGS_MIN = 4


class Touched(NamedTuple):
    """A closed touch switch: the bearing [rad] of a wall; or of the robot `node`, which is visible in its sector.

    `switch_rad` is the direction [rad] of the switch.
    """

    bearing_rad: float
    node: int | None
    switch_rad: float = 0.0


class OdometryFrame:
    """Position [m], turn [rad], bearings [rad] of visible robots and touched walls, and averages of bearings."""

    def __init__(self) -> None:
        self.x_m = 0.0
        self.y_m = 0.0
        self.turned_rad = 0.0
        self.seen: dict[int, float] = {}
        self.contacts: tuple[Touched, ...] = ()
        self.touched: tuple[float, ...] = ()
        self._touch: tuple[Contact, ...] = ()
        self._sums: dict[int, tuple[complex, int]] = {}

    def update(self, observation: Observation) -> None:
        """Take in one observation."""
        moved = observation.odometry
        if moved is not None:
            cos, sin = math.cos(self.turned_rad), math.sin(self.turned_rad)
            self.x_m += cos * moved.forward_m - sin * moved.left_m
            self.y_m += sin * moved.forward_m + cos * moved.left_m
            self.turned_rad += moved.turn_rad
        turned = self.turned_rad
        self.seen = {each.node: each.bearing_rad + turned for each in observation.bearings or ()}
        self._touch = observation.touch or ()
        if observation.touch:
            self.contacts = tuple(self._contact(each, turned) for each in observation.touch)
            self.touched = tuple(each.bearing_rad for each in self.contacts if each.node is None)
        else:
            self.contacts = self.touched = ()

    @property
    def touched_robots(self) -> tuple[int, ...]:
        """The robots in touch."""
        return tuple(each.node for each in self.contacts if each.node is not None)

    def touched_among(self) -> list[tuple[float, tuple[int, ...]]]:
        """Return for each closed switch that faces robots its bearing [rad] and those robots, the nearest to it first."""
        turned = self.turned_rad
        return [(each.bearing_rad + turned, faced) for each in self._touch if (faced := self._faced(each, turned))]

    def _contact(self, contact: Contact, turned: float) -> Touched:
        """Return what a closed switch faces: the visible robot nearest to its direction, or a wall."""
        nearest, switch_rad = next(iter(self._faced(contact, turned)), None), contact.bearing_rad + turned
        return Touched(switch_rad if nearest is None else self.seen[nearest], nearest, switch_rad)

    def _faced(self, contact: Contact, turned: float) -> tuple[int, ...]:
        """Return the visible robots that a closed switch may face, the nearest to its direction first."""
        direction = contact.bearing_rad + turned
        beside = contact.half_width_rad + ROBOT_BESIDE_RAD
        off = [(abs(math.remainder(bearing - direction, math.tau)), node) for node, bearing in self.seen.items()]
        return tuple(node for _, node in sorted(each for each in off if each[0] < beside))

    # --- averages -----------------------------------------------------------------------------------------------------

    def forget(self, nodes: Iterable[int] | None = None) -> None:
        """Drop the averages of `nodes`, or all averages."""
        if nodes is None:
            self._sums.clear()
        else:
            for node in nodes:
                self._sums.pop(node, None)

    def average(self) -> None:
        """Add the visible robots' bearings to the averages, and drop the averages of all other robots."""
        sums = self._sums
        self._sums = {}
        for node, bearing in self.seen.items():
            total, count = sums.get(node, (0j, 0))
            self._sums[node] = total + cmath.exp(1j * bearing), count + 1

    def averaged(self, samples: int) -> bool:
        """Return whether exactly the visible robots are averaged, each over at least `samples` readings."""
        return self._sums.keys() == self.seen.keys() and all(n >= samples for _, n in self._sums.values())

    def count(self, node: int) -> int:
        """Return the number of readings in the average of a robot's bearing."""
        return self._sums[node][1] if node in self._sums else 0

    def averages(self) -> dict[int, float]:
        """Return the averaged bearings [rad] by robot, ascending."""
        return {node: cmath.phase(total) for node, (total, _) in sorted(self._sums.items())}

    def spread(self) -> float | None:
        """Return the standard deviation [rad] of one bearing, or None without an average of enough readings.

        It is the lower median over the visible robots, because some of them may have moved.
        """
        found = sorted(
            2.0 * max(0.0, 1.0 - abs(total) / n) * n / (n - 1)
            for total, n in self._sums.values()
            if n >= SPREAD_READINGS_MIN
        )
        return math.sqrt(found[(len(found) - 1) // 2]) if found else None
