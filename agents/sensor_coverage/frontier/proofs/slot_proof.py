"""The closed arcs of one slot, as the robot at the slot keeps them without a coordinator."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.fans import fan_of, side_of
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.chosen_triangles import ChosenTriangles
from zwerm.agents.sensor_coverage.frontier.proofs.slot_memory import remembered
from zwerm.agents.sensor_coverage.frontier.proofs.unseen_directions import UnseenDirections
from zwerm.agents.sensor_coverage.frontier.proofs.walk_arcs import WalkArcs
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import FollowedStretch
from zwerm.agents.sensor_coverage.frontier.strips.robots_in_touch import BODY_RAD, arcs_of_robot
from zwerm.agents.sensor_coverage.frontier.strips.seen_stretch import SeenStep, SeenStretch, SeenTouch
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import (
    SightEnd,
    beside_edge,
    borders_of,
    is_passed,
    united_round,
    within_ends,
    without_edges,
)
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    BLIND_MAX,
    CONTACT_RAD,
    NEWS_RAD,
    Arc,
    WalkPoint,
    WallStep,
    arc_between,
    arcs_of_step,
    arcs_of_walls,
    complement,
    contains,
    ends_at,
    united,
)
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import NearWalls
from zwerm.agents.sensor_coverage.messages.pushes import LostSight, ProvedArc, WalkTriangle
from zwerm.maths.simplicial import FlagComplex
from zwerm.maths.sums import added

# Edges of sight that a slot's next occupant learns, and the most slots named in each: witnesses, and slots that saw the walk.
EDGES_MAX: Final = 40
EDGE_SLOTS_MAX: Final = 8
# What an arc that the slot's own robot followed close to it depends on: no other slot. It is not the same as a walk that no
# other slot saw.
NEAR: Final[tuple[tuple[int, ...], tuple[int, ...]]] = ((), (NOWHERE,))


class _Sight(NamedTuple):
    """The latest point of a walk that a slot sees: its number, its direction [rad], the slots that saw it, its stretch."""

    number: int
    direction_rad: float
    seen: tuple[int, ...]
    stretch: SeenStretch | None


class SlotProof:
    """The closed arcs of one slot, as the robot at the slot keeps them without a coordinator. It keeps no walks that are over.

    `around` are the slots that share an edge with it, and their directions [rad]. An arc that other standing robots closed
    together with a walk counts while they stand within two hops. `lose` names the neighbours' slots that are lost for good.
    `for_neighbours` has (neighbouring slot, arc there) of triangles that this slot proves and the neighbour cannot: the
    neighbour did not see all points of the walk that they depend on.
    """

    def __init__(self) -> None:
        self.around: Mapping[int, float] = {}
        self.for_neighbours: list[tuple[int, ProvedArc]] = []
        self._slot = NOWHERE
        self._scan = ScanResult({}, FlagComplex({}), ())
        self._by_view: list[Arc] = []
        self._touched: tuple[float, ...] = ()
        self._in_touch: list[int] = []  # the slots of robots in touch
        self._at_walls: list[Arc] = []  # arcs of walls in touch
        self._contacts: list[Arc] = []  # the directions of their contacts
        self._near: list[Arc] = []  # arcs in which a wall close to the slot was followed
        self._by_walks = WalkArcs()
        self._unseen = UnseenDirections()
        self._triangles = ChosenTriangles()
        self._edges: dict[SightEnd, None] = {}
        self._sights: dict[int, _Sight] = {}  # by walk, until the slot loses sight of it
        self._stretches: dict[tuple[int, int], SeenStretch] = {}  # by walk, and the number of their first point
        self._touches: dict[int, list[SeenTouch]] = {}  # by walk: the latest contacts with this slot's robot
        # Arcs that end at the stretch of wall up to the latest point, seen without a break, as if its ends were tied.
        self._stretch: list[Arc] = []
        self._stretch_end: WalkPoint | None = None
        self._open: list[Arc] | None = None  # until something changes
        self._only_edges = False  # whether only edges of sight are open

    @property
    def ready(self) -> bool:
        """True once the proof has a view of its slot: without one, a point of a walk closes too little."""
        return self._slot != NOWHERE

    @property
    def knows_walks(self) -> bool:
        """True once walks have closed an arc of the slot."""
        return any(True for _ in chain(self._stretches, self._near, self._by_walks.all(), self._triangles.all()))

    def update(self, slot: int, scan: ScanResult, touched: Iterable[float], in_touch: Collection[int] = ()) -> None:
        """Take in the slot's view and the complex around it, the directions [rad] of walls in touch, and the slots in touch."""
        view = scan.views[slot]
        self._slot, self._scan, self._open = slot, scan, None
        self.around = {each: view[each] for each in scan.complex_.neighbours[slot]}
        self._touched = touched = tuple(touched)
        self._at_walls, self._contacts = arcs_of_walls(touched), arcs_of_walls(touched, CONTACT_RAD)
        self._in_touch = [each for each in self.around if each in in_touch]
        self._by_view = [arc for each in self._in_touch for arc in arcs_of_robot(self.around[each], touched)]
        for triangle in scan.complex_.triangles_at(slot):
            a, b = (each for each in triangle if each != slot)
            self._by_view.append(arc_between(view[a], view[b]))

    def open_arcs(self) -> list[Arc]:
        """Return the arcs that nothing closes."""
        if self._open is None:
            self._open = self._find_open()
        return self._open

    def _find_open(self) -> list[Arc]:
        standing, touched, stretches = self._scan.complex_.neighbours, self._touched, self._stretches.values()
        counting = [each for each in self._triangles.counting(standing) if self._relies_on_other(each)]
        fans = [Arc(each.start_rad, each.width_rad) for each in counting]
        followed = [arc for each in stretches for arc in each.arcs(standing, touched)]
        walks = self._by_walks.counting((*standing, NOWHERE))
        opened = complement([*self._by_view, *fans, *self._at_walls, *self._near, *walks, *followed])
        self._only_edges = not opened
        if opened:  # edges of sight are left until all else is closed: many of them are seen from close by meanwhile
            return opened
        # A station cannot look behind what it touches. Nobody saw how a wall close to the slot goes on at the ends of its arc.
        contacts = self._at_walls if self._slot == 0 else self._contacts
        near = [within_ends(each) for each in united_round(self._near)]
        ways = [within_ends(each) for each in self._near]
        loose = [edge for each in self._edges if not each.witnesses and not is_passed(edge := beside_edge(each), ways)]
        edged = [arc for each in stretches for arc in each.edged_arcs(standing, touched)]
        edged += without_edges([*contacts, *near], loose)
        return complement([*self._by_view, *fans, *self._by_walks.counting(standing), *edged])

    def _relies_on_other(self, arc: ProvedArc) -> bool:
        """Return whether this slot may rely on the other slot of a triangle for the space beyond.

        It may not where the other slot relies on this one: where that one sees the point behind this robot in touch, or saw
        nothing of a walk in the angle here.
        """
        triangle = arc.triangle
        if triangle is None:
            return True
        if triangle.beside in self._in_touch and triangle.there_rad <= BODY_RAD:
            return False
        return not self._unseen.within(triangle.beside, Arc(arc.start_rad, arc.width_rad))

    def _open_rad(self) -> float:
        """Return the sum of all open arcs [rad], and a turn more unless only edges of sight are open."""
        opened = added(each.width_rad for each in self.open_arcs())
        return opened if self._only_edges else opened + math.tau

    def pass_step(
        self,
        walk: int,
        earlier: WallStep | None,
        step: WallStep,
        stretch: FollowedStretch | None,
        hidden: Sequence[tuple[int, ...]] = (),
    ) -> bool:
        """Take in a step of a walk whose end this slot sees, and the step before; return whether the open arcs are smaller.

        `stretch` is the stretch of wall that the robot follows, if it has met a wall. `hidden` has the slots that saw the walk
        where this slot did not, until now.
        """
        old, self._open = self._open_rad(), None
        slot, (before, point, hand, witnesses, number) = self._slot, step
        if before is None or before is not self._stretch_end or witnesses:
            self._stretch = []
        if _witnesses_of(point) == (slot,):
            for neighbour in self.around:
                self._unseen.note(neighbour, point.seen[slot])
        self._stretch += arcs_of_step(slot, before, point, hand)
        self._stretch_end = point
        if hidden:
            self._lose_sight(walk, hidden[0])
        seen_stretch = None
        if stretch is not None:
            seen_stretch = self._stretch_of(walk, hand, stretch)
            seen_stretch.extend(stretch)
            if before is not None and (earlier is None or earlier.number >= stretch.first_number):
                saw_both = self._others((*witnesses, *_witnesses_of(point), *_witnesses_of(before)))
                seen_stretch.add(SeenStep(before, point, self._others(witnesses), saw_both))
        seen = self._others(_witnesses_of(point))
        self._sights[walk] = _Sight(number, point.seen[slot], seen, seen_stretch)
        if hidden:
            self._add_edge(self._sights[walk], hidden[-1])
        if slot in point.robots:
            touch = SeenTouch(number, point, seen)
            self._touches[walk] = [*self._touches.get(walk, ())[-BLIND_MAX:], touch]
            for (its_walk, _), each in self._stretches.items():
                if its_walk == walk and number <= each.stretch.last_number + BLIND_MAX:
                    each.add_touch(touch)
        first_number = None if stretch is None else stretch.first_number
        self._add_fan(walk, first_number, point, [step])
        if earlier is not None and earlier.point is before:
            self._add_fan(walk, first_number, earlier.point, [earlier, step])
        return self._open_rad() < old - NEWS_RAD

    def _stretch_of(self, walk: int, hand: int, stretch: FollowedStretch) -> SeenStretch:
        """Return what this slot saw of a stretch. The stretch may begin beside a robot that was touched before."""
        key = walk, stretch.first_number
        if key not in self._stretches:
            known = [each.stretch for (its_walk, _), each in self._stretches.items() if its_walk == walk]
            before = max(known, key=lambda each: each.last_number).last if known else None
            self._stretches[key] = SeenStretch(self._slot, hand, stretch, before)
            for each in self._touches.get(walk, ()):
                self._stretches[key].add_touch(each)
        return self._stretches[key]

    def extend(self, walk: int, stretch: FollowedStretch) -> bool:
        """Take in how far a stretch of wall was followed; return whether this slot saw a part of it, and it is news."""
        known = self._stretches.get((walk, stretch.first_number))
        if known is None or not known.extend(stretch):
            return False
        self._open = None
        return True

    def lose_sight(self, walk: int, number: int, witnesses: Iterable[int]) -> None:
        """Record that this slot does not see the point of a walk with this number, and which slots see it."""
        sight = self._sights.get(walk)
        if sight is not None and sight.number < number:
            self._lose_sight(walk, witnesses)

    def _lose_sight(self, walk: int, witnesses: Iterable[int]) -> None:
        sight = self._sights.pop(walk, None)
        if sight is not None:
            self._add_edge(sight, witnesses)

    def _add_edge(self, sight: _Sight, witnesses: Iterable[int]) -> None:
        """Add an edge of sight beside a point that this slot saw."""
        self._open = None
        edge = SightEnd(sight.direction_rad, self._others(witnesses), sight.seen)
        closed = list[Arc]()
        if sight.stretch is not None:
            sight.stretch.add_edge(edge)
            closed = united(sight.stretch.arcs(self._scan.complex_.neighbours, self._touched))
        self._edges |= dict.fromkeys(borders_of(edge, closed))

    def end_walk(self, walk: int, last_number: int = 0, end: int = NOWHERE) -> None:
        """Keep the arcs that a walk has closed, but not its steps: it is over.

        The point with the number `last_number` was its last one at a wall. The walking robot stands at the slot `end`.
        """
        self._open = None
        sight = self._sights.pop(walk, None)
        if sight is not None and (end != NOWHERE or sight.number + BLIND_MAX < last_number):
            self._add_edge(sight, () if end == NOWHERE else (end,))
        self._touches.pop(walk, None)
        for key in [each for each in self._stretches if each[0] == walk]:
            for needed, seen, arc in self._stretches.pop(key).keyed_arcs(self._touched):
                self._add(needed, seen, arc)

    def _add_fan(self, walk: int, stretch: int | None, point: WalkPoint, steps: Sequence[WallStep]) -> None:
        """Add the triangles of this slot, a neighbour and a point, if the space beyond them is proved by these steps.

        The robot follows the `stretch` of wall with this number of its first point.
        """
        slot, number, hand = self._slot, steps[0].number, steps[0].hand
        stretch = -1 if stretch is None or stretch > number else stretch
        views, neighbours = self._scan.views, self._scan.complex_.neighbours
        if slot not in point.seen or not any(each in self.around for each in point.seen):
            return
        at_walls = {}
        for each in point.seen:
            walls = [
                arc
                for step in steps
                if each in step.point.seen and not step.witnesses
                for arc in arcs_of_step(each, step.before, step.point, step.hand)
            ]
            if each == slot:
                walls += [*self._stretch, *self._contacts, *self._near, *self._by_walks.unconditional()]
            for side in (1, -1):
                at_walls[each, side] = ends_at(walls, point.seen[each], side)
        counting = fan_of(point, views, neighbours, at_walls)
        fan = [pair for pair in counting if pair[0] < pair[1] or pair[::-1] not in counting]
        if any(slot in pair for pair in fan):
            needed = dict.fromkeys(each for pair in fan for each in pair)
            points = [each for step in steps for each in (step.before, step.point) if each is not None]
            for pair in fan:
                if slot in pair:
                    other = sum(pair) - slot
                    here, there = (_arc_of_triangle(each, sum(pair) - each, point, views) for each in (slot, other))
                    side = side_of(point, slot, views[slot][other])
                    needed_, seen = self._others(needed), self._others(_witnesses_of(point))
                    way = walk, stretch, number, hand
                    if (slot, other) in counting:
                        triangle = WalkTriangle(other, -side, there.width_rad, *way)
                        self._triangles.add(ProvedArc(needed_, seen, *here, triangle), triangle)
                    sees_all = all(other in each.seen for each in points)
                    if (other, slot) in counting and slot in views[other] and not sees_all:
                        triangle = WalkTriangle(slot, side, here.width_rad, *way)
                        self.for_neighbours.append(
                            (other, ProvedArc(tuple(needed), _witnesses_of(point), *there, triangle))
                        )

    def accept(self, proved: ProvedArc) -> bool:
        """Take in an arc that a neighbour has proved; return whether the open arcs are smaller."""
        old = self._open_rad()
        self._take(proved)
        return self._open_rad() < old - NEWS_RAD

    def _take(self, proved: ProvedArc) -> None:
        """Take in an arc from another robot."""
        needed, seen = self._others(proved.needed), self._others(proved.seen)
        if (needed, seen) == NEAR:
            self.add_near(NearWalls(((proved.start_rad, proved.width_rad),)))
        elif proved.triangle is None:
            self._add(needed, seen, Arc(proved.start_rad, proved.width_rad))
        else:
            self._open = None
            self._triangles.add(proved._replace(needed=needed, seen=seen), proved.triangle)

    def _add(self, needed: Iterable[int], seen: Iterable[int], arc: Arc) -> None:
        """Add an arc that counts while the slots `needed` stand, until one of the slots `seen` is lost, which saw the walk."""
        self._open = None
        self._by_walks.add((self._others(needed), self._others(seen)), arc)

    def _others(self, slots: Iterable[int]) -> tuple[int, ...]:
        """Return slots without this one, each once, ascending. NOWHERE stays: it is no slot, also before this one is known."""
        return tuple(sorted(dict.fromkeys(each for each in slots if each == NOWHERE or each != self._slot)))

    def lose(self, *slots: int) -> None:
        """Forget the arcs of walks that one of these slots saw: its robot has died or left, and no robot takes it over.

        A walk ends where no standing robot sees it. So what it leaves out is the part of the robots that saw it.
        """
        self._open = None
        self._by_walks.lose(slots)
        self._triangles.lose(slots)
        self._edges = {left: None for each in self._edges if (left := each.without(slots)) is not None}
        for stretch in self._stretches.values():
            stretch.lose(slots)
        for walk, touches in self._touches.items():
            self._touches[walk] = [each for each in touches if not any(slot in each.seen for slot in slots)]

    def add_near(self, walls: NearWalls) -> None:
        """Add walls close to the slot that were followed. Their arcs of different walks stay apart."""
        self._open = None
        for each in walls.past_ends:
            self._add((NOWHERE,), (), Arc(*each))
        fresh = [each for each in united_round(Arc(*each) for each in walls.followed) if not contains(self._near, each)]
        self._near = [*(each for each in self._near if not contains(fresh, each)), *fresh]

    def edges(self) -> tuple[LostSight, ...]:
        """Return the edges of sight, for the slot's next occupant: the latest ones, as far as they name few slots."""
        latest = list(self._edges)[-EDGES_MAX:]
        return tuple((there, saw[:EDGE_SLOTS_MAX], seen[:EDGE_SLOTS_MAX]) for there, saw, seen, _ in latest)

    def memory(self) -> tuple[ProvedArc, ...]:
        """Return the arcs that walks closed, for the slot's next occupant: of many those that rely on few slots."""
        near = (ProvedArc(*NEAR, *arc) for arc in self._near)
        kept = (ProvedArc(*key, *arc) for key, arc in self._by_walks.all())
        followed = (arc for each in self._stretches.values() for arc in each.keyed_arcs(self._touched))
        ended = (ProvedArc(self._others(needed), self._others(seen), *arc) for needed, seen, arc in followed)
        triangles = filter(self._relies_on_other, self._triangles.all())
        return remembered((*near, *kept, *triangles, *ended))

    def inherit(self, memory: Iterable[ProvedArc], edges: Iterable[LostSight] = ()) -> None:
        """Take over the arcs that walks closed, and the edges of sight, from the slot's former occupant."""
        self._open = None
        self._near, self._by_walks = [], WalkArcs()
        self._unseen, self._triangles = UnseenDirections(), ChosenTriangles()
        self._stretches, self._touches, self._sights = {}, {}, {}
        self._edges = {SightEnd(*each): None for each in edges}
        for each in memory:
            self._take(each)


def _arc_of_triangle(slot: int, other: int, point: WalkPoint, views: Mapping[int, Mapping[int, float]]) -> Arc:
    """Return the arc at a slot between another one and a point."""
    return arc_between(views[slot][other], point.seen[slot])


def _witnesses_of(point: WalkPoint) -> tuple[int, ...]:
    """Return the slots that saw a point, and the marks of robots that saw it and of which no slot is known."""
    return (*point.seen, *point.unplaced)
