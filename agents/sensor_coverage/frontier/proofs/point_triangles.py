"""Triangles of two slots and a point of a walk that count, for all points of all walks.

They depend on what the slots that saw the point see, and on whether followed walls lie beyond the lines of sight. A point
for which none of this has changed keeps its triangles.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Mapping, Sequence
from typing import Final

from zwerm.agents.sensor_coverage.frontier.wall_proof import Beyond, Pair, WalkPoint, arc_between, fan_of

# A point of a walk lies within a triangle's angle only if it is this far from its sides: bearings have noise.
HIDDEN_MIN_RAD: Final = math.radians(5.0)

Views = Mapping[int, Mapping[int, float]]


class PointTriangles:
    """The triangles of all points, by the number of the point."""

    def __init__(self) -> None:
        self._stretch_of: dict[int, int] = {}  # the number of the first point of the stretch, by the number of a point
        self._of_stretch: dict[tuple[int, int], list[WalkPoint]] = {}  # the points of a stretch that a slot saw
        # Of these the directions [rad] of those that another slot did not see, ascending, by slot, other slot and stretch.
        # They hold for the number of points beside them: points of no stretch are one stretch, to which later walks add.
        self._lost: dict[tuple[int, int, int], tuple[int, Sequence[float]]] = {}
        self._basis: dict[int, tuple[object, object]] = {}
        self._pairs: dict[int, tuple[Pair, ...]] = {}

    def add(self, slot: int, number: int, stretch: int, point: WalkPoint) -> None:
        """Add a point of a walk that a slot saw."""
        self._stretch_of[number] = stretch
        self._of_stretch.setdefault((slot, stretch), []).append(point)

    def stretch_of(self, number: int) -> int:
        """Return the number of the first point of a point's stretch, or -1."""
        return self._stretch_of.get(number, -1)

    def pairs(self, number: int) -> tuple[Pair, ...]:
        """Return the pairs of slots whose triangle with a point counts, as they were found last."""
        return self._pairs.get(number, ())

    def drop(self, number: int) -> None:
        """Let no triangle with a point count."""
        self._pairs.pop(number, None)
        self._basis.pop(number, None)

    def find(
        self,
        number: int,
        point: WalkPoint,
        views: Views,
        neighbours: Mapping[int, Collection[int]],
        versions: Mapping[int, int],
        at_walls: Beyond,
    ) -> tuple[Pair, ...]:
        """Find the pairs of slots whose triangle with a point counts; see `fan_of`. `versions` count the changes of views."""
        stretch = self.stretch_of(number)
        seen = [(slot, versions[slot]) for slot in point.seen if slot in neighbours]
        basis = [(slot, version, len(self._of_stretch[slot, stretch])) for slot, version in seen], at_walls
        if self._basis.get(number) == basis:
            return self._pairs[number]
        self._basis[number] = basis
        hidden: dict[Pair, None] = {}
        while True:
            pairs = fan_of(point, views, neighbours, at_walls, hidden)
            more = [
                pair for pair in pairs if any(self._hides(each, stretch, point, views) for each in (pair, pair[::-1]))
            ]
            if not more:
                self._pairs[number] = pairs
                return pairs
            hidden |= dict.fromkeys(more)

    def _hides(self, pair: Pair, stretch: int, point: WalkPoint, views: Views) -> bool:
        """Return whether the second slot lost sight of the walk within the angle at the first of their triangle with a point.

        Past a corner the second slot relies on the first for what is behind it. So the first does not rely on the second.
        """
        slot, other = pair
        start, width = arc_between(views[slot][other], point.seen[slot])
        if width <= 2.0 * HIDDEN_MIN_RAD:
            return False
        lost = self._lost_by(slot, other, stretch)
        first = (start + HIDDEN_MIN_RAD) % math.tau
        last = first + width - 2.0 * HIDDEN_MIN_RAD
        if bisect_right(lost, first) < bisect_left(lost, last):
            return True
        return last > math.tau and bool(lost) and lost[0] < last - math.tau

    def _lost_by(self, slot: int, other: int, stretch: int) -> Sequence[float]:
        """Return the directions [rad] of the points of a stretch that a slot saw and another one did not, ascending."""
        key = slot, other, stretch
        points = self._of_stretch[slot, stretch]
        count, known = self._lost.get(key, (0, ()))
        if count != len(points):
            known = sorted(each.seen[slot] % math.tau for each in points if other not in each.seen)
            self._lost[key] = len(points), known
        return known
