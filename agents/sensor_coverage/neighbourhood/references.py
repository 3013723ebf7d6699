"""The reference directions from one robot's slot to the slots around, and the ways from there."""

import cmath
import math
from collections.abc import Callable, Iterable
from enum import Enum, auto

from zwerm.agents.sensor_coverage.frontier.directions import (
    DISPLACED_M_MIN,
    Reference,
    is_displaced,
    refined_reference,
)
from zwerm.agents.sensor_coverage.messages.pushes import ReferenceBearing


class Displaced(Enum):
    """Which of two robots that see each other stands elsewhere than the former one at its slot."""

    NONE = auto()
    SELF = auto()
    OTHER = auto()


class References:
    """The reference directions from one robot's slot, by the slots to which they lead.

    `ways` has by slot the way (x, y) [m] by which a robot came from there: the first robot, or the first displaced one.
    """

    def __init__(
        self, inherited: Iterable[ReferenceBearing] = (), ways: Iterable[tuple[int, float, float]] = ()
    ) -> None:
        """Begin with those of the former robot at the slot."""
        self.ways: dict[int, tuple[float, float]] = {slot: (x_m, y_m) for slot, x_m, y_m in ways}
        self._known: dict[int, Reference] = {
            each.slot: (cmath.rect(1.0, each.direction_rad), each.count) for each in inherited
        }
        self._learned: dict[int, tuple[int, ...]] = {}  # by robot: the numbers of the latest readings at both ends
        self._readers: dict[int, int] = {}  # by slot: the robot there at the latest reading

    def is_new(self, node: int, numbers: tuple[int, ...]) -> bool:
        """Return whether a robot's readings with these numbers have not been taken yet."""
        return self._learned.get(node) != numbers

    def take(
        self, node: int, slot: int, numbers: tuple[int, ...], there_rad: float, back_rad: float, distance_m: float
    ) -> Displaced:
        """Take a reading from both ends; return which robot stands elsewhere than the former one at its slot.

        One does if the direction is off: the other one if it is not the robot of the latest reading. `distance_m` is the
        distance of that slot [m], infinite if it is not known.
        """
        known, is_new = self._known.get(slot), self._readers.get(slot, node) != node
        displaced = is_displaced(known, there_rad, back_rad, distance_m)
        self._learned[node], self._readers[slot] = numbers, node
        self._known[slot] = refined_reference(known, there_rad, back_rad)
        if not displaced:
            return Displaced.NONE
        return Displaced.OTHER if is_new else Displaced.SELF

    def take_way(self, slot: int, way: tuple[float, float]) -> bool:
        """Take the way from a slot; return whether it shows that this robot stands elsewhere than a former one.

        A robot displaced along its lines of sight, or together with others, sees these in the same directions.
        """
        known = self.ways.setdefault(slot, way)
        if math.dist(known, way) <= DISPLACED_M_MIN:
            return False
        self.ways[slot] = way
        return True

    def memory(self, at: Callable[[int], int | None]) -> tuple[ReferenceBearing, ...]:
        """Return the references for the next robot at the slot; `at` returns the robot at a slot, or None."""
        return tuple(
            ReferenceBearing(slot, node, cmath.phase(mean), count)
            for slot, (mean, count) in sorted(self._known.items())
            if (node := at(slot)) is not None
        )

    def items(self) -> Iterable[tuple[int, Reference]]:
        """Return the slots and the reference directions to them."""
        return self._known.items()
