"""The local proof of coverage (`zwerm.agents.sensor_coverage.frontier.wall_proof`) of all slots, by a node that knows them.

Most of it does not change from scan to scan. It is computed again for the slots around which something has changed.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    Arc,
    Pair,
    SeenPoint,
    TouchCounter,
    Walk,
    WalkPoint,
    arc_between,
    arcs_of_step,
    arcs_of_walls,
    complement,
    ends_at,
    fan_of,
    point_before,
    united,
)
from zwerm.maths.simplicial import FlagComplex

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
                found += arcs_of_step(slot, before, point, hand)
        return united(found)

    def _valid(self, point: WalkPoint) -> tuple[Pair, ...]:
        """Return the pairs of slots whose triangle with a point counts."""
        at_walls = {
            (slot, side): ends_at(self._walled[slot], there, side)
            for slot, there in point.seen.items()
            if slot in self._neighbours
            for side in (1, -1)
        }
        return fan_of(point, self._scan.views, self._neighbours, at_walls)


def _passes(walk: Walk, first: int) -> Iterator[tuple[int, Passed]]:
    """Yield each slot that saw a point of a walk, with that point; `first` is the number of the first point."""
    last: dict[int, SeenPoint] = {}
    touch = TouchCounter()
    for number, point in enumerate(walk.points):
        touch.take(number, bool(point.walls))
        now = SeenPoint(number, point)
        for slot in point.seen:
            before = point_before(slot, last.get(slot), now, touch.since)
            since = number if before is None else last[slot].number + 1
            between = tuple(each.seen.keys() for each in walk.points[since:number])
            yield slot, Passed(first + number, before, point, walk.hand, between)
            last[slot] = now


def _connected(slots: Sequence[int], around: Mapping[int, Collection[int]]) -> bool:
    """Return whether slots, one at least, are connected by edges among themselves."""
    reached = list(slots[:1])
    for each in reached:
        reached += [other for other in slots if other in around[each] and other not in reached]
    return bool(slots) and len(reached) == len(slots)


def _sum(arcs: Iterable[Arc]) -> float:
    return sum(each.width_rad for each in arcs)
