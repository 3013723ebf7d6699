"""The local proof of coverage (`zwerm.agents.sensor_coverage.frontier.wall_proof`) of all slots, by a node that knows them.

A triangle of two slots and a point of a walk counts only if the space beyond its sides is proved, too: two such triangles
with different points may cross, and each slot would rely on the other's. So at both slots, beyond the line of sight to
the point, there must be a wall that was followed, another such triangle with the same point, or a triangle of robots that
contains the point.

Most of this does not change from scan to scan. It is computed again for the slots around which something has changed.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    Arc,
    SeenPoint,
    TouchCounter,
    Walk,
    WalkPoint,
    arc_between,
    arcs_of_step,
    arcs_of_walls,
    complement,
    point_before,
    united,
)
from zwerm.maths.simplicial import FlagComplex

# A followed wall lies beyond a line of sight if it closes the direction this far [rad] beside it.
BESIDE_RAD: Final = 0.02
# Angle [rad] to an open arc within which another slot may stand in the opening.
OPENING_RAD: Final = math.radians(15.0)
# Arcs that differ by less than this [rad] in total are equally open.
EQUAL_RAD: Final = 1e-6


class Passed(NamedTuple):
    """A point of a walk that a slot saw, the point before it if that closes an arc, and the hand at the wall.

    `number` counts the points of all walks. The slot did not see the points between these two. Each of them was seen by
    other slots.
    """

    number: int
    before: WalkPoint | None
    point: WalkPoint
    hand: int
    between: tuple[Collection[int], ...]


class Around(NamedTuple):
    """What was known around a slot when its arcs were found."""

    passed: int
    view: Mapping[int, float]
    walls: Sequence[Arc]


Pair = tuple[int, int]


class SwarmProof:
    """The closed arcs of all slots of one scan."""

    def __init__(self) -> None:
        self._walks: Sequence[Walk] = ()
        self._count = 0  # walks that `_points` contains
        self._points: list[WalkPoint] = []
        self._passed: dict[int, list[Passed]] = {}
        self._witnessed: dict[int, dict[int, None]] = {}  # slots that rely on points which this slot saw
        self._forget()

    def _forget(self) -> None:
        self._scan = ScanResult({}, FlagComplex({}), ())
        self._neighbours: dict[int, frozenset[int]] = {}
        self._around: dict[int, Around] = {}
        self._walled: dict[int, list[Arc]] = {}  # arcs that end at walls, by slot
        self._pairs: dict[int, tuple[Pair, ...]] = {}  # the valid triangles, by the number of their point
        self._open_arcs: dict[int, list[Arc]] = {}

    def update(
        self,
        scan: ScanResult,
        walks: Sequence[Walk],
        touched: Mapping[int, Sequence[float]],
        near: Mapping[int, Sequence[Arc]],
    ) -> None:
        """Take in a scan, all walks, and by slot the directions [rad] of walls in touch and the arcs of walls close to it."""
        self._index(walks)
        self._scan = scan
        complex_ = scan.complex_
        gone = [slot for slot in self._around if slot not in complex_.neighbours]
        self._neighbours = {slot: frozenset(each) for slot, each in complex_.neighbours.items()}
        changed: dict[int, None] = {}
        for slot in complex_.vertices:
            view = scan.views[slot]
            walls = [*arcs_of_walls(touched.get(slot, ())), *near.get(slot, ())]
            beside = {each: view[each] for each in complex_.neighbours[slot]}
            now = Around(len(self._passed.get(slot, ())), beside, walls)
            if self._around.get(slot) != now:
                self._around[slot] = now
                changed[slot] = None
        self._refresh(changed, gone)

    def open_arcs(self) -> dict[int, list[Arc]]:
        """Return the arcs in which each slot is open, without the slots that are open in none."""
        return {slot: arcs for slot in self._around if (arcs := self._open(slot))}

    def spare(self, candidates: Iterable[int]) -> list[int]:
        """Return candidates that can all leave together: no other slot becomes more open, and no part is cut off.

        So the proof of the slots that stay is as complete as before, and needs none of those that leave. A slot with open
        arcs may be the first one beyond an opening: it stays unless all that its neighbours see around it is closed.
        """
        now, found = self, list[int]()
        for slot in candidates:
            if not _connected(sorted(now._neighbours[slot]), now._neighbours):
                continue
            without = now._without(slot)
            if now._open(slot) and any(without._is_open(each, slot) for each in now._neighbours[slot]):
                continue
            if all(_sum(without._open(each)) <= _sum(now._open(each)) + EQUAL_RAD for each in without._around):
                now = without
                found.append(slot)
        return found

    def _is_open(self, slot: int, other: int) -> bool:
        """Return whether a slot is open in the direction of another one, or close beside it."""
        there = self._scan.views[slot][other]
        arcs = self._open(slot)
        return any((there - start + OPENING_RAD) % math.tau < width + 2.0 * OPENING_RAD for start, width in arcs)

    # --- what has changed -------------------------------------------------------------------------------------------

    def _index(self, walks: Sequence[Walk]) -> None:
        """Find the slots that saw each point of the walks that are new. Another list: all have other directions."""
        if walks is not self._walks:
            self._walks, self._count = walks, 0
            self._points, self._passed, self._witnessed = [], {}, {}
            self._forget()
        for walk in walks[self._count :]:
            for slot, passed in _passes(walk, len(self._points)):
                self._passed.setdefault(slot, []).append(passed)
                for each in dict.fromkeys(each for witnesses in passed.between for each in witnesses):
                    self._witnessed.setdefault(each, {})[slot] = None
            self._points += walk.points
        self._count = len(walks)

    def _without(self, slot: int) -> "SwarmProof":
        """Return the proof without a slot."""
        other = copy(self)
        other._neighbours = {
            each: seen - {slot} if slot in seen else seen for each, seen in self._neighbours.items() if each != slot
        }
        other._around, other._walled = dict(self._around), dict(self._walled)
        other._pairs, other._open_arcs = dict(self._pairs), dict(self._open_arcs)
        other._refresh(dict.fromkeys(sorted(self._neighbours[slot])), [slot])
        return other

    def _refresh(self, changed: dict[int, None], gone: Iterable[int]) -> None:
        """Find the arcs again of slots around which something has changed, and of those that rely on slots that are gone."""
        points: dict[int, None] = {}
        stale = dict(changed)
        for slot in gone:
            points |= dict.fromkeys(each.number for each in self._passed.get(slot, ()))
            stale |= self._witnessed.get(slot, {})
            for known in (self._around, self._walled, self._open_arcs):
                known.pop(slot, None)
        for slot in stale:
            if slot in self._around:
                points |= dict.fromkeys(each.number for each in self._passed.get(slot, ()))
                self._walled[slot] = self._arcs_to_walls(slot)
                self._open_arcs.pop(slot, None)
        for number in points:
            old, new = self._pairs.get(number, ()), self._valid(self._points[number])
            if old != new:
                self._pairs[number] = new
                for slot in (slot for pair in (*old, *new) for slot in pair):
                    self._open_arcs.pop(slot, None)

    # --- arcs -------------------------------------------------------------------------------------------------------

    def _open(self, slot: int) -> list[Arc]:
        """Return the open arcs of a slot."""
        known = self._open_arcs.get(slot)
        if known is None:
            view, beside = self._scan.views[slot], self._neighbours[slot]
            closed = list(self._walled[slot])
            closed += [arc_between(view[a], view[b]) for a in beside for b in beside & self._neighbours[a] if a < b]
            for each in self._passed.get(slot, ()):
                for pair in self._pairs.get(each.number, ()):
                    if slot in pair:
                        closed.append(arc_between(view[sum(pair) - slot], each.point.seen[slot]))
            known = self._open_arcs[slot] = complement(closed)
        return known

    def _arcs_to_walls(self, slot: int) -> list[Arc]:
        """Return the arcs at a slot that end at walls. They are disjoint."""
        found = list(self._around[slot].walls)
        for _, before, point, hand, between in self._passed.get(slot, ()):
            if all(any(each in self._neighbours for each in witnesses) for witnesses in between):
                found += [arc for _, arc in arcs_of_step(slot, before, point, hand, {})]
        return united(found)

    # --- triangles of two slots and a point of a walk ---------------------------------------------------------------

    def _valid(self, point: WalkPoint) -> tuple[Pair, ...]:
        """Return the pairs of slots whose triangle with a point counts. The space beyond both its sides is proved."""
        known = self._neighbours
        seen = [slot for slot in point.seen if slot in known]
        pairs = [(a, b) for a in seen for b in seen if a < b and b in known[a]]
        closed = {(slot, side): self._ends_at_wall(slot, point, side) for slot in seen for side in (1, -1)}
        for slot in seen:
            if not (closed[slot, 1] and closed[slot, -1]) and self._is_inside(slot, point, seen):
                closed[slot, 1] = closed[slot, -1] = True
        sides = {(a, b): self._side(a, b, point) for pair in pairs for a, b in (pair, pair[::-1])}
        while True:
            kept = [
                pair
                for pair in pairs
                if all(
                    closed[a, -sides[a, b]]
                    or any(sides[a, c] == -sides[a, b] for c in seen if (a, c) in sides and _ordered(a, c) in pairs)
                    for a, b in (pair, pair[::-1])
                )
            ]
            if len(kept) == len(pairs):
                return tuple(kept)
            pairs = kept

    def _side(self, a: int, b: int, point: WalkPoint) -> int:
        """Return +1 if slot b is to the left of a point, seen from slot a, else -1."""
        return 1 if math.remainder(self._scan.views[a][b] - point.seen[a], math.tau) > 0.0 else -1

    def _ends_at_wall(self, slot: int, point: WalkPoint, side: int) -> bool:
        """Return whether the directions on one side of a point end at a wall, seen from a slot."""
        there = point.seen[slot] + side * BESIDE_RAD
        return any((there - start) % math.tau < width for start, width in self._walled[slot])

    def _is_inside(self, slot: int, point: WalkPoint, seen: Iterable[int]) -> bool:
        """Return whether a triangle of this slot and two others contains a point. One of these sees the point."""
        views, known = self._scan.views, self._neighbours
        return any(
            _between(point.seen[slot], views[slot][a], views[slot][b])
            and _between(point.seen[a], views[a][slot], views[a][b])
            for a in seen
            if a in known[slot]
            for b in known[slot] & known[a]
        )


def _passes(walk: Walk, first: int) -> Iterator[tuple[int, Passed]]:
    """Yield each slot that saw a point of a walk, with that point; `first` is the number of the first point."""
    last: dict[int, SeenPoint] = {}
    touch = TouchCounter()
    for number, point in enumerate(walk.points):
        touch.take(number, point.in_touch)
        now = SeenPoint(number, point)
        for slot in point.seen:
            before = point_before(slot, last.get(slot), now, touch.since)
            since = number if before is None else last[slot].number + 1
            between = tuple(each.seen.keys() for each in walk.points[since:number])
            yield slot, Passed(first + number, before, point, walk.hand, between)
            last[slot] = now


def _between(there: float, a: float, b: float) -> bool:
    """Return whether a direction [rad] lies within the smaller angle between two others."""
    left, right = math.remainder(a - there, math.tau), math.remainder(b - there, math.tau)
    return left * right < 0.0 and abs(left) + abs(right) < math.pi


def _ordered(a: int, b: int) -> Pair:
    return (a, b) if a < b else (b, a)


def _connected(slots: Sequence[int], around: Mapping[int, Collection[int]]) -> bool:
    """Return whether slots, one at least, are connected by edges among themselves."""
    reached = list(slots[:1])
    for each in reached:
        reached += [other for other in slots if other in around[each] and other not in reached]
    return bool(slots) and len(reached) == len(slots)


def _sum(arcs: Iterable[Arc]) -> float:
    return sum(each.width_rad for each in arcs)
