"""The local proof of coverage (`zwerm.agents.sensor_coverage.frontier.wall_proof`) of all slots, by a node that knows them.

Most of it does not change from scan to scan. It is computed again for the slots around which something has changed.

A walk ends where no standing robot sees it, and the deployment goes on from there. So what a walk leaves out is the part of
the robots that saw it. When one of them is gone, nothing is known of its part: the points that it saw close nothing.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from zwerm.agents.sensor_coverage.frontier.fans import Pair, pair_of, side_of
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.passed_points import Passed, all_passes, still_counting
from zwerm.agents.sensor_coverage.frontier.proofs.point_triangles import PointTriangles
from zwerm.agents.sensor_coverage.frontier.proofs.reliance import Fan, circular_gaps
from zwerm.agents.sensor_coverage.frontier.proofs.robot_arcs import RobotArcs
from zwerm.agents.sensor_coverage.frontier.proofs.walk_origins import WalkOrigins
from zwerm.agents.sensor_coverage.frontier.proofs.wall_arcs import ArcBasis, StepCrossings, WallArcs, find_wall_arcs
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import with_islands
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    Arc,
    NearArc,
    Walk,
    WalkPoint,
    arc_between,
    arcs_of_walls,
    complement,
    contains,
    ends_at,
    overlap,
    shared_arcs,
    united,
)
from zwerm.maths.sums import added

# A triangle closes more than another one only if the difference is larger than this [rad].
EQUAL_RAD: Final = 1e-6


class SwarmProof:
    """The closed arcs of all slots of one scan."""

    def __init__(self) -> None:
        self._walks: Sequence[Walk] = ()
        self._count = 0  # walks that `_points` contains
        self._points: list[WalkPoint] = []
        self._origins = WalkOrigins()
        self._passed: dict[int, list[Passed]] = {}
        self._crossings: dict[int, StepCrossings] = {}
        self._witnessed: dict[int, dict[int, None]] = {}  # slots that rely on points which this slot saw
        self._gone: dict[int, None] = {}  # slots that stood in an earlier scan
        self._views: dict[int, Mapping[int, float]] = {}  # the directions [rad] of the neighbours, by slot
        self._versions: dict[int, int] = {}  # changes of what a slot sees
        self._triangles = PointTriangles(self._is_proved, self._is_witness)
        self._touched_by: Mapping[tuple[int, int], Sequence[float]] = {}
        self._forget()

    def _forget(self) -> None:
        self._bases: Collection[int] = ()
        self._stays: dict[int, int] = {}  # at slots at which walks have begun
        self._neighbours: dict[int, frozenset[int]] = {}
        self._around: dict[int, ArcBasis] = {}
        self._wall_arcs: dict[int, WallArcs] = {}
        self._chosen: dict[Pair, dict[int, int]] = {}  # the numbers of the points of triangles beside an edge, by side
        self._open_arcs: dict[int, list[Arc]] = {}
        self._alone: dict[Pair, list[Arc]] = {}  # what is closed at the first slot without the second
        self._by_robots = RobotArcs({}, {}, {}, {})
        self._settled: dict[int, None] = {}  # open slots that no other choice of points closes better

    def update(
        self,
        scan: ScanResult,
        walks: Sequence[Walk],
        touched: Mapping[int, Sequence[float]],
        near: Mapping[int, Sequence[NearArc]],
        in_touch: Mapping[int, Collection[int]],
        stays: Mapping[int, int] = MappingProxyType({}),
        touched_by: Mapping[tuple[int, int], Sequence[float]] = MappingProxyType({}),
    ) -> tuple[int, ...]:
        """Take in a scan, all walks, and by slot the directions [rad] of walls in touch and the arcs of walls close to it.

        `in_touch` has the slots whose robots are in touch, and `stays` the numbers of the robots' stays by slot.
        `touched_by` has the directions of walls in touch of all stays, by slot and number.

        Return the slots around which points of walks count no more, because a slot that saw them is gone.
        """
        before = self._neighbours
        self._touched_by = touched_by
        self._index(walks)
        self._bases, self._stays = scan.bases, self._origins.stays_at(stays)
        complex_ = scan.complex_
        gone = [slot for slot in before if slot not in complex_.neighbours]
        back = [slot for slot in self._gone if slot in complex_.neighbours]
        self._gone = {slot: None for slot in (*self._gone, *gone) if slot not in back}
        self._neighbours = {slot: frozenset(each) for slot, each in complex_.neighbours.items()}
        changed: dict[int, None] = {}
        seen, self._views = self._views, {}
        for slot in complex_.vertices:
            view = scan.views[slot]
            beside = self._views[slot] = {each: view[each] for each in complex_.neighbours[slot]}
            if seen.get(slot) != beside:
                self._versions[slot] = self._versions.get(slot, 0) + 1
            robots = [each for each in in_touch.get(slot, ()) if each in beside]
            passed, stay = len(self._passed.get(slot, ())), self._stays.get(slot)
            now = ArcBasis(passed, beside, touched.get(slot, ()), tuple(near.get(slot, ())), robots, stay)
            if self._around.get(slot) != now:
                self._around[slot] = now
                changed[slot] = None
        left = dict.fromkeys(
            slot for each in (*gone, *back) for passed in self._passed.get(each, ()) for slot in passed.point.seen
        )
        self._by_robots = RobotArcs(self._neighbours, self._views, self._around, self._wall_arcs)
        self._refresh(changed | left, gone)
        return tuple(slot for slot in left if slot in self._around)

    def open_arcs(self) -> dict[int, list[Arc]]:
        """Return the arcs in which each slot is open, without the slots that are open in none."""
        self._choose_again()
        return {slot: arcs for slot in self._around if (arcs := self._open(slot))} or self._circular()

    def _circular(self) -> dict[int, list[Arc]]:
        """Return the gaps that slots close by relying on each other in a circle."""
        closed = {slot: self._closed_without_fans(slot) for slot in self._around}
        gaps = {slot: complement(each) for slot, each in closed.items()}
        answered = {
            slot: [part for each in self._wall_arcs[slot].answered for part in each.within(arcs)]
            for slot, arcs in closed.items()
        }
        for slot, each in ((slot, each) for slot, parts in answered.items() for each in parts):
            for other, arc in ((slot, each.gap), *each.others):
                gaps[other] = united([*gaps[other], *self._beside_edges(other, arc)])
        return circular_gaps(gaps, {slot: list(self._fans(slot)) for slot, each in gaps.items() if each}, answered)

    def _beside_edges(self, slot: int, arc: Arc) -> Iterator[Arc]:
        """Yield the parts of an arc of a slot that walls do not close, if no other slot answers for edges of sight."""
        contacts = arcs_of_walls(self._around[slot].touched) if slot in self._bases else ()
        for each in complement([*self._wall_arcs[slot].strict, *contacts, *self._by_robots.all(slot)]):
            yield from shared_arcs(each, arc)

    def _fans(self, slot: int) -> Iterator[Fan]:
        """Yield the triangles with points that count at a slot."""
        for other, number in self._counting(slot):
            point = self._points[number]
            _, *more = self._origins.arcs_of_triangle((slot, other), number, point, self._views)
            beyond = self._beyond_robots(slot, other)
            yield Fan(other, self._views[slot][other], point.seen[slot], point.seen[other], more, beyond)

    def _beyond_robots(self, slot: int, other: int) -> list[Arc]:
        """Return the arcs that the other slot closes only by triangles of robots before this slot."""
        kept = self._by_robots.not_before(slot, other)
        if kept is None:
            return []
        walls = *self._wall_arcs[other].followed, *arcs_of_walls(self._around[other].touched)
        return complement([*kept, *walls, *self._arcs_of_fans(other)])

    # --- what has changed -------------------------------------------------------------------------------------------

    def _index(self, walks: Sequence[Walk]) -> None:
        """Find the slots that saw each point of the new walks. In another list some points are not the same as before."""
        if walks is not self._walks:
            points = [each for walk in walks for each in walk.points]
            same = {number for number, (a, b) in enumerate(zip(self._points, points, strict=False)) if a is b}
            self._walks, self._count = walks, 0
            self._points, self._passed, self._witnessed, self._origins = [], {}, {}, WalkOrigins()
            self._crossings = {}
            self._triangles.begin_again(same)
            self._forget()
        for walk in walks[self._count :]:
            for slot, passed in all_passes(walk, len(self._points), self._touched_by):
                self._passed.setdefault(slot, []).append(passed)
                self._triangles.add(slot, passed.number, passed.stretch, len(self._points), passed.point)
                self._triangles.add_tied(slot, passed.point, passed.ties)
                ends = (*passed.ends, *(pocket.other for _, pocket in passed.pockets))
                answering = (each.answering for each in (*passed.sight_ends, *passed.dark_ends))
                relied = (*passed.between, *(each.ties for each in ends), *answering)
                for each in dict.fromkeys(each for witnesses in relied for each in witnesses):
                    self._witnessed.setdefault(each, {})[slot] = None
            self._origins.add(len(self._points), walk)
            if walk.origin is not None:
                self._triangles.add_way(walk.origin.slot, len(self._points), walk.way_from_origin())
            self._points += walk.points
        self._count = len(walks)

    def _refresh(self, changed: dict[int, None], gone: Iterable[int]) -> None:
        """Find the arcs again of slots around which something has changed, and of those that rely on slots that are gone."""
        points, stale = dict[int, None](), dict(changed)
        for slot in gone:
            points |= dict.fromkeys(each.number for each in self._passed.get(slot, ()))
            stale |= self._witnessed.get(slot, {})
            self._spoil(slot)
            for known in (self._around, self._wall_arcs):
                known.pop(slot, None)
        for slot in stale:
            if slot in self._around:
                points |= dict.fromkeys(each.number for each in self._passed.get(slot, ()))
                self._wall_arcs[slot] = self._find_walls(slot)
                self._spoil(slot)
        self._alone.clear()
        self._triangles.forget_proved()
        for number in points:
            old, new = self._triangles.pairs(number), self._valid(number)
            if old != new:
                for slot in dict.fromkeys(slot for pair in (*old, *new) for slot in pair):
                    self._spoil(slot)

    def _spoil(self, slot: int) -> None:
        """Forget what depends on the arcs of a slot."""
        self._reopen(slot)
        for pair in [pair for pair in self._chosen if slot in pair]:
            del self._chosen[pair]
            for each in pair:
                self._reopen(each)

    def _reopen(self, slot: int) -> None:
        """Forget the open arcs of a slot: other points may be better for it and its neighbours now."""
        self._open_arcs.pop(slot, None)
        for each in (slot, *self._neighbours.get(slot, ())):
            self._settled.pop(each, None)

    # --- arcs -------------------------------------------------------------------------------------------------------

    def _open(self, slot: int) -> list[Arc]:
        """Return the open arcs of a slot."""
        known = self._open_arcs.get(slot)
        if known is None:
            known = self._open_arcs[slot] = self._open_without(slot, None, 0)
        return known

    def _open_without(self, slot: int, pair: Pair | None, side: int) -> list[Arc]:
        """Return the arcs of a slot that are open without the triangle on one side of an edge."""
        fans = list(self._arcs_of_fans(slot, pair, side))
        touched, beside = arcs_of_walls(self._around[slot].touched), self._by_robots.all(slot)
        opened = complement([*self._wall_arcs[slot].followed, *touched, *beside, *fans])
        contacts = touched if slot in self._bases else ()  # a station cannot look behind what it touches
        return with_islands(opened, [*self._wall_arcs[slot].edged, *contacts, *beside, *fans])

    def _arcs_of_fans(self, slot: int, pair: Pair | None = None, side: int = 0) -> Iterator[Arc]:
        """Yield the arcs of a slot that triangles with points close, without the triangle on one side of an edge."""
        for other, number in self._counting(slot, pair, side):
            yield from self._origins.arcs_of_triangle((slot, other), number, self._points[number], self._views)

    def _counting(self, slot: int, pair: Pair | None = None, side: int = 0) -> Iterator[tuple[int, int]]:
        """Yield the other slot and the number of the point of each triangle that counts at a slot, but that beside an edge."""
        for other in self._neighbours[slot]:
            its_pair = pair_of(slot, other)
            for its_side, number in self._choose(its_pair).items():
                if (slot, other) in self._triangles.pairs(number) and (its_pair != pair or its_side != side):
                    yield other, number

    def _closed_without_fans(self, slot: int) -> list[Arc]:
        """Return the arcs of a slot that walls and triangles of robots close."""
        walls, robots = self._wall_arcs[slot].followed, self._by_robots.all(slot)
        return [*walls, *arcs_of_walls(self._around[slot].touched), *robots]

    def _choose(self, pair: Pair) -> dict[int, int]:
        """Return the number of the point of the triangle on each side of an edge: the one that closes most at both ends.

        With different points at the two ends, the triangles would cross, and each end would rely on the other.
        """
        known = self._chosen.get(pair)
        if known is None:
            numbers = self._candidates(pair)
            opened = {each: complement(self._closed_without_fans(each)) for each in (pair if numbers else ())}
            known = self._chosen[pair] = {side: self._best(pair, each, opened) for side, each in numbers.items()}
        return known

    def _candidates(self, pair: Pair) -> dict[int, list[int]]:
        """Return the numbers of the points of the triangles with an edge that count at one of its ends, by side."""
        found: dict[int, list[int]] = {}
        there = self._views[pair[0]][pair[1]]
        for number in self._triangles.numbers(*pair):
            found.setdefault(side_of(self._points[number], pair[0], there), []).append(number)
        return found

    def _best(self, pair: Pair, numbers: Sequence[int], opened: Mapping[int, Sequence[Arc]]) -> int:
        """Return the point whose triangle closes most of the open arcs where it counts: the first of those that are equal."""
        best, most = numbers[0], -1.0
        for number in numbers:
            counting, seen = self._triangles.pairs(number), self._points[number].seen
            arcs = [
                (slot, arc_between(self._views[slot][other], seen[slot]))
                for slot, other in (pair, pair[::-1])
                if (slot, other) in counting
            ]
            gain = added(overlap(arc, each) for slot, arc in arcs for each in opened[slot])
            if gain > most + EQUAL_RAD:
                best, most = number, gain
        return best

    def _choose_again(self) -> None:
        """Choose other points around the open slots, where these close more together with those of other edges."""
        waiting = [slot for slot in self._around if slot not in self._settled and self._open(slot)]
        while waiting:
            slot = waiting.pop()
            if slot in self._settled or not self._open(slot):
                continue
            self._settled[slot] = None
            for other in sorted(self._neighbours[slot]):
                pair = pair_of(slot, other)
                for side, numbers in self._candidates(pair).items():
                    opened = {each: self._open_without(each, pair, side) for each in pair}
                    chosen = self._choose(pair)
                    best = self._best(pair, (chosen[side], *numbers), opened)
                    if best != chosen[side]:
                        chosen[side] = best
                        for each in pair:
                            self._reopen(each)
                        waiting += [slot, *sorted(self._neighbours[slot] | self._neighbours[other])]

    def _find_walls(self, slot: int) -> WallArcs:
        """Return the arcs of a slot that end at followed walls or at contacts."""
        passed = still_counting(slot, self._passed.get(slot, ()), self._gone.keys(), self._neighbours)

        def touched_by(stay: int) -> Sequence[float]:
            return self._touched_by.get((slot, stay), ())

        crossings = self._crossings.setdefault(slot, StepCrossings(slot))
        return find_wall_arcs(passed, self._around[slot], self._neighbours, touched_by, crossings)

    def _counts(self, point: WalkPoint) -> bool:
        """Return whether all slots that saw a point of a walk still stand."""
        return self._gone.keys().isdisjoint(point.seen)

    def _valid(self, number: int) -> tuple[Pair, ...]:
        """Return (slot, other slot) for each triangle with the point of this number that counts at the slot."""
        point = self._origins.standing(number, self._points[number], self._stays)
        if not self._counts(point):
            self._triangles.drop(number)
            return ()
        standing = [slot for slot in point.seen if slot in self._neighbours]
        paired = [slot for slot in standing if not self._neighbours[slot].isdisjoint(standing)]
        if not paired:
            self._triangles.drop(number)
            return ()
        at_walls = {(slot, side): self._ends_beyond(slot, number, side) for slot in paired for side in (1, -1)}
        views = self._views
        beside = (pair for pair in self._origins.beside(number, views) if not self._closes_beyond(*pair, point))
        without = *beside, *self._behind_bodies(point, standing)
        return self._triangles.find(number, point, views, self._neighbours, self._versions, at_walls, without)

    def _closes_beyond(self, slot: int, other: int, point: WalkPoint) -> bool:
        """Return whether the other slot closes by walls what is beyond its triangle with a slot and a point beside it."""
        walls = self._wall_arcs.get(other)
        return (
            walls is not None
            and other in point.seen
            and walls.close_beyond(self._views[other][slot], point.seen[other])
        )

    def _behind_bodies(self, point: WalkPoint, standing: Iterable[int]) -> Iterator[Pair]:
        """Yield (slot, other) if the other slot sees a point where it relies on the slot's robot in touch."""
        for other in standing:
            there = Arc(point.seen[other], 0.0)
            for slot in self._around[other].in_touch:
                if slot in point.seen and contains(self._by_robots.of_body(other, slot), there):
                    yield slot, other

    def _is_proved(self, slot: int, there: float, other: int) -> bool:
        """Return whether a slot stands, and walls or triangles of robots without another slot close its direction [rad].

        Beside a loose edge of sight they do not: the slots that ask may rely on each other there.
        """
        if slot not in self._neighbours:
            return False
        known = self._alone.get((slot, other))
        if known is None:
            walls = self._wall_arcs[slot].strict if slot in self._wall_arcs else ()
            closed = *walls, *arcs_of_walls(self._around[slot].touched), *self._by_robots.between(slot, (other,))
            known = self._alone[slot, other] = united(closed)
        return contains(known, Arc(there, 0.0))

    def _is_witness(self, slot: int, there: float, pair: Pair, stretch: int) -> bool:
        """Return whether a slot stands that saw a point of one slot's own way, and answers for it without both slots of a pair.

        The slot sees the point in the direction `there` [rad], maybe through a gap far from it. So only walls close to the
        slot and the `stretch` of wall on which the point lies close the direction: another one is before the point only as
        seen by a robot that stood at another place. A triangle of robots does so if neither slot is beyond it.
        """
        if slot not in self._neighbours:
            return False
        near = (each.arc for each in self._around[slot].near)
        walls, robots = self._wall_arcs[slot], self._by_robots.between(slot, pair, pair)
        return contains(robots, Arc(there, 0.0)) or walls.lies_at(there, stretch, near)

    def _ends_beyond(self, slot: int, number: int, side: int) -> bool:
        """Return whether the wall that was followed at a point lies beyond the line of sight to it, on one side.

        Another wall may end at a corner before the point, and nobody sees the space behind the corner. Beside a robot in
        touch with the walking robot all walls count, and so they do beyond the wall that a robot touched close to its slot.
        """
        point, walls = self._points[number], self._wall_arcs[slot]
        if slot in point.robots:
            return ends_at(walls.followed, point.seen[slot], side)
        if any(ends_at(walls.followed, each, side) for each in self._origins.touched(slot, number, side)):
            return True
        return ends_at(walls.by_stretch.get(self._triangles.stretch_of(slot, number), ()), point.seen[slot], side)
