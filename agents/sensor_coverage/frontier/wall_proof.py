"""The local proof of coverage: the directions from a robot in which visible robots or followed walls close the space.

Every triangle of the proof has a standing robot i as a corner. Robot i sees the two other corners. One of these may be
a point of a walk along a wall. Its sides are free lines of sight, or a step of the walk. So i sees the whole triangle.
A robot is closed if such triangles fill the full turn around it. The robots at the ends of a triangle's side are
responsible for the space beyond it. Beyond a step of a walk is a wall. An open arc is frontier until a robot went
there.

An obstacle that lies within one triangle is not found. The triangle's sides are at most r_v long.

Walks are remembered in directions from the slots that saw them.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from zwerm.maths.simplicial import FlagComplex

# An open arc narrower than this [rad] counts as closed: a body at r_v is 8 degrees wide.
GAP_RAD: Final = math.radians(6.0)
# A wall in touch with a standing robot closes this angle [rad] on both sides of its direction.
TOUCH_RAD: Final = math.radians(45.0)
# A walking robot that touches a wall and a standing robot at once closes this angle [rad] between the two.
POCKET_RAD: Final = math.radians(55.0)
# Successive points without a contact at which a walking robot still follows the wall: it turns round a corner.
BLIND_MAX: Final = 3
# Largest arc [rad] behind a corner in which a slot may lose sight of a walking robot that stays in touch with the wall.
HIDDEN_RAD: Final = math.radians(30.0)
# A point of a walk is news for the walking robot if the open arcs become smaller by this [rad].
NEWS_RAD: Final = 0.02
# Stands for the slot at the third corner of a triangle whose third corner is another point of the walk.
NO_SLOT: Final = -1
# Arcs apart by less than this [rad] are stored as one.
HAIR_RAD: Final = 1e-9


class Arc(NamedTuple):
    """Directions from `start_rad` to the left, over `width_rad`."""

    start_rad: float
    width_rad: float


class WalkPoint(NamedTuple):
    """A point of a walk: the direction [rad] to it from each slot that it sees, the directions of walls that it touches.

    `robots` are the slots that the walking robot touches.
    """

    seen: Mapping[int, float]
    walls: tuple[float, ...]
    robots: tuple[int, ...]

    @property
    def in_touch(self) -> bool:
        """True if the walking robot touched anything."""
        return bool(self.walls or self.robots)

    @property
    def passes_robots(self) -> bool:
        """True if the walking robot touched robots, and no wall. Behind these may be free space."""
        return bool(self.robots) and not self.walls

    def turned(self, by: float) -> "WalkPoint":
        """Return the same point with all directions turned by an angle [rad]."""
        return WalkPoint(
            {slot: each + by for slot, each in self.seen.items()}, tuple(each + by for each in self.walls), self.robots
        )


class Walk(NamedTuple):
    """A stretch of wall that a robot followed, in the frame of one robot; `hand` is +1 if the wall was on the left."""

    frame: int
    hand: int
    points: tuple[WalkPoint, ...]

    def turned(self, frame: int, by: float) -> "Walk":
        """Return the walk in another frame."""
        return Walk(frame, self.hand, tuple(each.turned(by) for each in self.points))


class TouchCounter:
    """Counts since which point of a walk the robot follows the wall. It may be out of touch for a few points at corners.

    It turns towards the wall meanwhile, and so enters each opening that its body fits through.
    """

    def __init__(self) -> None:
        self.since = 0
        self._blind = BLIND_MAX + 1

    def take(self, number: int, in_touch: bool) -> None:
        """Take in whether the robot touches anything at the point with this number."""
        if in_touch and self._blind > BLIND_MAX:
            self.since = number
        self._blind = 0 if in_touch else self._blind + 1
        if self._blind > BLIND_MAX:
            self.since = number + 1


class SeenPoint(NamedTuple):
    """A point of a walk that a slot saw, and its number in the walk."""

    number: int
    point: WalkPoint


def point_before(slot: int, last: SeenPoint | None, now: SeenPoint, touch_since: int) -> WalkPoint | None:
    """Return the point with which a point of a walk closes an arc at a slot, or None.

    `last` is the latest point that the slot saw before. The robot must have followed the wall since that point: it does
    since the point with the number `touch_since`. The slot may have lost it meanwhile, behind a corner. Then other robots
    saw the way between, and are responsible for the space beside it.
    """
    if last is None:
        return None
    if last.number == now.number - 1:
        return last.point if last.number >= touch_since - 1 else None
    apart = abs(math.remainder(now.point.seen[slot] - last.point.seen[slot], math.tau))
    return last.point if last.number >= touch_since and apart <= HIDDEN_RAD else None


def arcs_of_walls(directions: Iterable[float]) -> list[Arc]:
    """Return the arcs that walls in touch close, by their directions [rad]."""
    return [Arc(each - TOUCH_RAD, 2.0 * TOUCH_RAD) for each in directions]


def arcs_of_step(
    slot: int, before: WalkPoint | None, point: WalkPoint, hand: int, beside: Mapping[int, float]
) -> Iterator[tuple[int | None, Arc]]:
    """Yield the arcs that a point of a walk closes at a slot that it sees, each with the other robot of the triangle, if any.

    `before` is the point before it. `beside` has the directions [rad] of the slots that share an edge with the slot.
    """
    there = point.seen[slot]
    if before is not None and slot in before.seen and not (before.passes_robots or point.passes_robots):
        step = math.remainder(there - before.seen[slot], math.tau)
        if step * hand < 0.0:  # the slot and the wall are on different sides of the step
            yield None, arc_between(before.seen[slot], there)
    for other in point.seen:
        if other != slot and other in beside:
            yield other, arc_between(beside[other], there)
    if slot in point.robots and point.walls:
        off = min((math.remainder(each - there, math.tau) for each in point.walls), key=abs)
        yield None, arc_between(there, there + math.copysign(min(abs(off), POCKET_RAD), off))


def arc_between(a_rad: float, b_rad: float) -> Arc:
    """Return the smaller arc between two directions [rad]."""
    off = math.remainder(b_rad - a_rad, math.tau)
    return Arc(a_rad, off) if off >= 0.0 else Arc(b_rad, -off)


def united(arcs: Iterable[Arc]) -> list[Arc]:
    """Return disjoint arcs that contain the same directions. Arcs that are apart by less than a hair become one."""
    found: list[Arc] = []
    for start, width in sorted((each.start_rad % math.tau, each.width_rad) for each in arcs):
        if found and start <= found[-1].start_rad + found[-1].width_rad + HAIR_RAD:
            first = found[-1].start_rad
            found[-1] = Arc(first, min(math.tau, max(found[-1].width_rad, start + width - first)))
        else:
            found.append(Arc(start, width))
    return found


def complement(arcs: Iterable[Arc]) -> list[Arc]:
    """Return the arcs that no given arc contains, without those that are narrower than GAP_RAD."""
    spans = sorted((each.start_rad % math.tau, each.width_rad) for each in arcs)
    if not spans:
        return [Arc(0.0, math.tau)]
    found = []
    # Arcs that pass through zero reach this far beyond it.
    first = spans[0][0]
    reached = max(first, *(start + width - math.tau for start, width in spans))
    for start, width in spans:
        if start > reached + GAP_RAD:
            found.append(Arc(reached, start - reached))
        reached = max(reached, start + width)
    if first + math.tau > reached + GAP_RAD:
        found.append(Arc(reached % math.tau, first + math.tau - reached))
    return found


class SlotProof:
    """The closed arcs of one slot, as the robot at the slot keeps them without a coordinator. It keeps no walks.

    `around` are the slots that share an edge with it, and their directions [rad]. An arc that another standing robot closed
    together with a walk counts while that robot is a neighbour.
    """

    def __init__(self) -> None:
        self.around: Mapping[int, float] = {}
        self._by_view: list[Arc] = []
        self._by_walks: dict[int, list[Arc]] = {}  # by the slot at the third corner, or NO_SLOT for a wall

    def update(self, slot: int, view: Mapping[int, float], complex_: FlagComplex, touched: Iterable[float]) -> None:
        """Take in the slot's view [rad] and the complex around it, and the directions [rad] of walls in touch."""
        self.around = {each: view[each] for each in complex_.neighbours[slot]}
        self._by_view = arcs_of_walls(touched)
        for triangle in complex_.triangles:
            if slot in triangle:
                a, b = (each for each in triangle if each != slot)
                self._by_view.append(arc_between(view[a], view[b]))

    def open_arcs(self) -> list[Arc]:
        """Return the arcs that nothing closes."""
        walks = [arc for slot, arcs in self._by_walks.items() if slot == NO_SLOT or slot in self.around for arc in arcs]
        return complement([*self._by_view, *walks])

    def pass_point(self, slot: int, before: WalkPoint | None, point: WalkPoint, hand: int) -> bool:
        """Take in a point of a walk that this slot sees, and the point before it; return whether the open arcs are smaller."""
        old = sum(each.width_rad for each in self.open_arcs())
        for other, arc in arcs_of_step(slot, before, point, hand, self.around):
            key = NO_SLOT if other is None else other
            self._by_walks[key] = united([*self._by_walks.get(key, ()), arc])
        return sum(each.width_rad for each in self.open_arcs()) < old - NEWS_RAD

    def add_near(self, arcs: Iterable[tuple[float, float]]) -> None:
        """Add arcs (start, width) [rad] in which a wall close to the slot was followed."""
        self._by_walks[NO_SLOT] = united([*self._by_walks.get(NO_SLOT, ()), *(Arc(*each) for each in arcs)])

    def memory(self) -> tuple[tuple[int, float, float], ...]:
        """Return the arcs that walks closed, for the slot's next occupant."""
        return tuple((slot, *arc) for slot, arcs in self._by_walks.items() for arc in arcs)

    def inherit(self, memory: Iterable[tuple[int, float, float]]) -> None:
        """Take over the arcs that walks closed from the slot's former occupant."""
        self._by_walks = {}
        for slot, start, width in memory:
            self._by_walks.setdefault(slot, []).append(Arc(start, width))
