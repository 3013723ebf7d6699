"""Triangles of two slots and a point of a walk that count, for all points of all walks.

They depend on what the slots that saw the point see, and on whether followed walls lie beyond the lines of sight. A point
for which none of this has changed keeps its triangles, without those behind which walks were seen since. Such a triangle
counts again only when a view or a wall has changed, also if a third slot that saw the walk there is occupied again before.
"""

import math
from bisect import bisect_left, bisect_right, insort
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import chain
from operator import itemgetter
from typing import Final

from zwerm.agents.sensor_coverage.frontier.fans import Beyond, Pair, fan_of, is_between
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, WalkPoint, arc_between

# A point of a walk lies within a triangle's angle only if it is this far from its sides: bearings have noise.
HIDDEN_MIN_RAD: Final = math.radians(2.0)
# A point of a wall that a walking robot touches is seen this far [rad] beside the robot at most, at a distance of 0.5 m.
TOUCHED_RAD: Final = math.radians(8.0)
# Directions of an arc are tested this far [rad] apart.
CLOSED_STEP_RAD: Final = math.radians(3.0)

Views = Mapping[int, Mapping[int, float]]
# The direction [rad] of a point from a slot, its number if it is on the slot's own way, and the other slots that saw it, with
# their directions.
_Lost = tuple[float, int | None, tuple[tuple[int, float], ...]]
# The directions [rad] of an end of a stretch from a slot that ties it and from another one, and all slots that tie it.
_Tied = tuple[float, float, tuple[int, ...]]
_DIRECTION: Final = itemgetter(0)


class PointTriangles:
    """The triangles of all points, by the number of the point.

    `is_proved` states for a slot, a direction [rad] and another slot whether the first one stands, and the space in its
    direction is proved without the other. `is_witness` states for a slot, a direction [rad], a pair and a stretch of wall
    whether the slot answers for a point there that the first slot of the pair saw on its own way, without the pair.
    """

    def __init__(
        self,
        is_proved: Callable[[int, float, int], bool],
        is_witness: Callable[[int, float, Pair, int], bool],
    ) -> None:
        self._is_proved = is_proved
        self._is_witness = is_witness
        self._basis: dict[int, tuple[object, object, object]] = {}
        self._pairs: dict[int, tuple[Pair, ...]] = {}
        self._numbers: dict[Pair, dict[int, None]] = {}  # of the points, by pair
        self._forget()

    def _forget(self) -> None:
        # The number of the first point of the stretch, by a slot and the number of a point that it saw.
        self._stretch_of: dict[tuple[int, int], int] = {}
        self._since: dict[int, int] = {}  # the number of the first point of the first walk that a slot saw
        # The points that a slot saw, each with its walk, its directions [rad], and its number if it is on the slot's own way.
        self._seen: dict[int, list[tuple[int, WalkPoint, tuple[float, ...], int | None]]] = {}
        # The points that a slot saw, and another one that stood then did not. They hold for the number of points that the slot
        # saw.
        self._lost: dict[tuple[int, int], tuple[int, list[_Lost]]] = {}
        # The ends of stretches that a slot ties and another one sees, by these two, in the order of their first directions.
        self._tied: dict[Pair, list[_Tied]] = {}
        # Whether the first slot answers alone for what is behind such an end, by its number among them, until a proof changes.
        self._leaks: dict[Pair, dict[int, bool]] = {}
        # Whether no other slot that saw a lost point is proved, by its number among them, until the proof of a slot changes.
        self._bare: dict[Pair, dict[int, bool]] = {}

    def begin_again(self, same: Collection[int]) -> None:
        """Forget all points, which are added again, but for the triangles that count with the points `same`."""
        self._forget()
        self._basis = {number: each for number, each in self._basis.items() if number in same}
        for number in [each for each in self._pairs if each not in same]:
            self._keep(number, ())

    def add(self, slot: int, number: int, stretch: int, walk: int, point: WalkPoint) -> None:
        """Add a point of a walk that a slot saw; `stretch` and `walk` are the numbers of their first points."""
        self._stretch_of[slot, number] = stretch
        self._since.setdefault(slot, walk)
        self._seen.setdefault(slot, []).append((walk, point, (point.seen[slot],), None))

    def add_tied(self, slot: int, point: WalkPoint, ties: tuple[int, ...]) -> None:
        """Add an end of a stretch at a point that a slot saw, and the slots that tie it."""
        there = point.seen[slot]
        for wall in point.walls:  # the slot looks past the end as far as the touched point
            past = there + TOUCHED_RAD * math.sin(wall - there)
            for each in ties:
                if each != slot and each in point.seen:
                    ends = self._tied.setdefault((each, slot), [])
                    insort(ends, (point.seen[each] % math.tau, past, ties), key=_DIRECTION)
                    self._leaks.pop((each, slot), None)

    def add_way(self, slot: int, walk: int, points: Iterable[tuple[float, WalkPoint]]) -> None:
        """Add the points of a walk that began at a slot, and their directions [rad] from there, also those out of its sight.

        Such a way may lead straight away from the slot. So these points count in directions close to their own, too.
        """
        aside = 2.0 * HIDDEN_MIN_RAD
        self._seen.setdefault(slot, []).extend(
            (walk, point, (there - aside, there + aside), number) for number, (there, point) in enumerate(points, walk)
        )

    def stretch_of(self, slot: int, number: int) -> int:
        """Return the number of the first point of the stretch of a point that a slot saw, or -1."""
        return self._stretch_of.get((slot, number), -1)

    def pairs(self, number: int) -> tuple[Pair, ...]:
        """Return (slot, other slot) for each triangle with a point that counts at the slot, as they were found last."""
        return self._pairs.get(number, ())

    def numbers(self, slot: int, other: int) -> list[int]:
        """Return the numbers of the points of triangles with two slots that count at one of them, ascending."""
        return sorted(self._numbers.get((slot, other), {}) | self._numbers.get((other, slot), {}))

    def drop(self, number: int) -> None:
        """Let no triangle with a point count."""
        self._keep(number, ())
        self._basis.pop(number, None)

    def _keep(self, number: int, pairs: tuple[Pair, ...]) -> None:
        """Keep the triangles with a point that count."""
        for each in self._pairs.pop(number, ()):
            del self._numbers[each][number]
        if pairs:
            self._pairs[number] = pairs
            for each in pairs:
                self._numbers.setdefault(each, {})[number] = None

    def forget_proved(self) -> None:
        """Forget what `is_proved` stated: the proof of a slot has changed."""
        self._bare.clear()
        self._leaks.clear()

    def find(
        self,
        number: int,
        point: WalkPoint,
        views: Views,
        neighbours: Mapping[int, Collection[int]],
        versions: Mapping[int, int],
        at_walls: Beyond,
        close: Collection[Pair] = (),
    ) -> tuple[Pair, ...]:
        """Find the triangles with a point that count, each at its first slot; see `fan_of`.

        `versions` count the changes of views. The triangles of the pairs `close` do not count.
        """
        basis = [(slot, versions[slot]) for slot in point.seen if slot in neighbours], at_walls, close
        known = self.pairs(number)
        if self._basis.get(number) == basis and not any(
            self._hides(pair, point, views) or self._ties(pair, point, views) for pair in known
        ):
            return known
        self._basis[number] = basis
        pairs = fan_of(
            point,
            views,
            neighbours,
            at_walls,
            close,
            lambda each: (
                self._hides(each, point, views)
                or self._ties(each, point, views)
                or _crosses(each, point, views, neighbours)
            ),
        )
        self._keep(number, pairs)
        return pairs

    def _hides(self, pair: Pair, point: WalkPoint, views: Views) -> bool:
        """Return whether the second slot lost sight of a walk within the angle at the first of their triangle with a point.

        Past a corner the second slot relies on the first for what is behind it, unless others saw the walk there, too, and do
        not rely on the second in turn. So the first does not rely on the second: the triangle does not count at the first.
        """
        slot, other = pair
        start, width = arc_between(views[slot][other], point.seen[slot])
        if width <= 2.0 * HIDDEN_MIN_RAD:
            return False
        lost = self._lost_by(slot, other)
        bare = self._bare.setdefault(pair, {})
        for each in _within(lost, Arc(start + HIDDEN_MIN_RAD, width - 2.0 * HIDDEN_MIN_RAD)):
            if each not in bare:
                _, number, saw = lost[each]
                bare[each] = not any(
                    self._is_proved(*one, other)
                    if number is None
                    else self._is_witness(*one, pair, self.stretch_of(one[0], number))
                    for one in saw
                )
            if bare[each]:
                return True
        return False

    def _ties(self, pair: Pair, point: WalkPoint, views: Views) -> bool:
        """Return whether the first slot alone ties an end of a stretch beyond the line from the second slot to a point.

        The second slot relies on it for what is behind that end. So the first does not rely on the second, unless walls or
        triangles of robots without the second one close all directions behind the end anyway.
        """
        ends = self._tied.get(pair)
        if not ends:
            return False
        slot, other = pair
        to_other, to_slot, here, there = views[slot][other], views[other][slot], point.seen[slot], point.seen[other]
        leaks = self._leaks.setdefault(pair, {})
        for each in _within(ends, arc_between(to_other, here)):
            here_end, there_end, ties = ends[each]
            if is_between(here_end, to_other, here, HIDDEN_MIN_RAD) and is_between(
                there, to_slot, there_end, HIDDEN_MIN_RAD
            ):
                if each not in leaks:
                    alone = all(one == slot or one not in views for one in ties)
                    leaks[each] = alone and not self._is_closed(slot, here_end, there_end, other)
                if leaks[each]:
                    return True
        return False

    def _is_closed(self, slot: int, a_rad: float, b_rad: float, other: int) -> bool:
        """Return whether all directions of a slot between two others [rad] are proved without another slot."""
        off = math.remainder(b_rad - a_rad, math.tau)
        count = math.ceil(abs(off) / CLOSED_STEP_RAD) or 1
        return all(self._is_proved(slot, a_rad + off * each / count, other) for each in range(count + 1))

    def _lost_by(self, slot: int, other: int) -> list[_Lost]:
        """Return the points that a slot saw, and another one that stood then did not, by their direction [rad].

        The other slot stood then if it saw that walk or an earlier one.
        """
        points = self._seen[slot]
        count, known = self._lost.setdefault((slot, other), (0, []))
        if count != len(points):
            known += (
                (
                    there % math.tau,
                    number,
                    tuple(one for one in each.seen.items() if one[0] != slot),
                )
                for walk, each, directions, number in points[count:]
                if other not in each.seen and self._since.get(other, math.inf) <= walk
                for there in directions
            )
            known.sort(key=_DIRECTION)
            self._bare.pop((slot, other), None)
            self._lost[slot, other] = len(points), known
        return known


def _within(known: Sequence[_Lost] | Sequence[_Tied], arc: Arc) -> Iterable[int]:
    """Return the numbers of those whose direction is inside an arc. They are in the order of their directions in [0, 2 pi)."""
    first = arc.start_rad % math.tau
    last = first + arc.width_rad
    within = range(bisect_right(known, first, key=_DIRECTION), bisect_left(known, last, key=_DIRECTION))
    beyond = range(bisect_left(known, last - math.tau, key=_DIRECTION) if last > math.tau else 0)
    return chain(within, beyond)


def _crosses(pair: Pair, point: WalkPoint, views: Views, neighbours: Mapping[int, Collection[int]]) -> bool:
    """Return whether the line from the second slot to the point crosses a side of a triangle of robots with both slots.

    The second slot relies on that triangle, and on the first slot for what is beyond this side. So the first does not rely on
    the second. Nor does it where the line passes so close to the first slot that it may cross the side there: in such a flat
    triangle nearly a half turn at the first slot is that of the second one. By the noise of bearings the second slot may even
    see the point on the other side of the first. So it is where the third slot is straight behind the second one.
    """
    slot, other = pair
    here, there = views[slot], views[other]
    to_point = math.remainder(point.seen[slot] - here[other], math.tau)
    aside = math.remainder(point.seen[other] - there[slot], math.tau)
    return any(
        _is_before(math.remainder(here[third] - here[other], math.tau), to_point, -HIDDEN_MIN_RAD)
        and _is_before(aside, math.remainder(there[third] - there[slot], math.tau))
        for third in neighbours[slot]
        if third in neighbours[other]
    )


def _is_before(angle: float, limit: float, least: float = -math.pi) -> bool:
    """Return whether an angle [rad] is smaller than a limit, on its side. On the other side it may be as large as `least`."""
    return least < math.copysign(1.0, limit) * angle < abs(limit) - HIDDEN_MIN_RAD
