"""Edges of sight: directions in which a slot lost sight of a robot that followed a wall, and the islands that open there.

At a corner the wall before it and a wall far behind it meet in one direction, and the two together leave no arc open. The
space behind the corner is the part of a robot that saw the walk there. When no such robot stands, the edge is loose: the
directions beside it count as closed only where another wall closes them. An edge is dark if no slot stands that saw the
next point of the walk, not even the one at which the walk began. By the noise of bearings two other walls, one from each
side, may reach across it. So one stretch has to close all directions beside it.

An edge is open only if nothing beside it is open: a robot that follows a wall into an open arc sees the edge from close by.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    BESIDE_EDGE_RAD,
    HAIR_RAD,
    Arc,
    WalkPoint,
    complement,
    contains,
    overlap,
    united,
)

# A wall that a robot touches ends up to this angle [rad] beside the direction of the robot: as seen by a robot in touch.
AT_WALL_RAD: Final = math.radians(30.0)
# Edges closer [rad] are one.
SAME_EDGE_RAD: Final = math.radians(1.0)


class SightEnd(NamedTuple):
    """The direction [rad] in which a slot lost sight of a walk, or saw it first, and the slots that saw what is beyond.

    Where each slot keeps its own proof, the other slots `seen` saw the walk in this direction. The slots `aside` saw the two
    sides of what may be open there, one beside the other: it lies in their arcs, and they close these (`reliance`).
    """

    direction_rad: float
    witnesses: tuple[int, ...]
    seen: tuple[int, ...] = ()
    aside: tuple[tuple[int, Arc], ...] = ()

    def without(self, slots: Collection[int]) -> "SightEnd | None":
        """Return the edge when these slots are lost: None if one of them saw the walk there."""
        if any(each in slots for each in self.seen):
            return None
        return self._replace(witnesses=tuple(each for each in self.witnesses if each not in slots))

    @property
    def answering(self) -> tuple[int, ...]:
        """The slots that answer for what is beyond."""
        return (*self.witnesses, *(each for each, _ in self.aside))

    def is_loose(self, standing: Collection[int]) -> bool:
        """Return whether no standing robot saw the walk beyond, or what is open there from the side."""
        return not any(each in standing for each in self.answering)

    def is_seen(self, standing: Collection[int]) -> bool:
        """Return whether a standing robot saw the walk beyond."""
        return any(each in standing for each in self.witnesses)


def sight_ends_at(slot: int, number: int, points: Sequence[WalkPoint], end: int | None = None) -> Iterator[SightEnd]:
    """Yield the ends of what a slot saw of a walk, at its point with this number.

    The robot of the slot `end` stands at the end of the walk, because no other one would see it beyond.
    """
    for step in (1, -1):
        other = _beside(slot, number, points, step)
        if 0 <= other < len(points) and slot not in points[other].seen:
            yield SightEnd(points[number].seen[slot], tuple(points[other].seen))
        elif other == len(points) and end is not None:
            yield SightEnd(points[number].seen[slot], (end,))


def dark_ends_at(slot: int, number: int, points: Sequence[WalkPoint]) -> Iterator[SightEnd]:
    """Yield the ends of what a slot saw of a walk, at its point with this number, with all slots that saw the next point."""
    for step in (1, -1):
        other = _beside(slot, number, points, step)
        if 0 <= other < len(points) and slot not in points[other].seen and not points[other].was_seen:
            yield SightEnd(points[number].seen[slot], tuple(points[other].seen))


def _beside(slot: int, number: int, points: Sequence[WalkPoint], step: int) -> int:
    """Return the number of the next point of a walk, or the one before: without a contact it counts only if hidden."""
    other = number + step
    while 0 <= other < len(points) and points[other].is_blind and slot in points[other].seen:
        other += step
    return other


def without_edges(arcs: Iterable[Arc], edges: Iterable[Arc]) -> list[Arc]:
    """Return arcs without the directions beside loose edges of sight (`beside_edge`)."""
    found = list(arcs)
    for edge in edges:
        found = [part for each in found for part in _outside(each, edge)]
    return found


def beside_edge(end: SightEnd, stretch: Sequence[Arc] = ()) -> Arc:
    """Return the arc of the directions beside an edge of sight of a stretch of wall, which closes the arcs `stretch`.

    Where the stretch ends before the direction of the robot that followed it, its end is the edge, too.
    """
    first = last = 0.0
    if not contains(stretch, Arc(end.direction_rad, 0.0)):
        borders = (border for start, width in stretch for border in (start, start + width))
        off = min((math.remainder(each - end.direction_rad, math.tau) for each in borders), key=abs, default=0.0)
        if abs(off) < AT_WALL_RAD:
            first, last = min(off, 0.0), max(off, 0.0)
    return Arc(end.direction_rad + first - BESIDE_EDGE_RAD, last - first + 2.0 * BESIDE_EDGE_RAD)


def borders_of(end: SightEnd, stretch: Sequence[Arc]) -> Iterator[SightEnd]:
    """Yield an edge of sight, and the end of its stretch of wall as another one if it is elsewhere; see `beside_edge`."""
    start, width = beside_edge(end, stretch)
    yield end
    for off in (BESIDE_EDGE_RAD, width - BESIDE_EDGE_RAD):
        if abs(math.remainder(start + off - end.direction_rad, math.tau)) > SAME_EDGE_RAD:
            yield end._replace(direction_rad=math.remainder(start + off, math.tau))


def is_passed(edge: Arc, followed: Iterable[Arc]) -> bool:
    """Return whether one of these arcs contains all directions beside an edge of sight (`beside_edge`).

    Each arc is of one walk along a wall, without a break: then nothing is hidden behind the edge.
    """
    return contains(followed, edge)


def united_round(arcs: Iterable[Arc]) -> list[Arc]:
    """Return disjoint arcs that contain the same directions, as `united`; an arc that passes through zero is one."""
    found = united(arcs)
    if len(found) > 1 and found[-1].start_rad + found[-1].width_rad >= found[0].start_rad + math.tau - HAIR_RAD:
        last = found.pop()
        reach = max(last.start_rad + last.width_rad, found[0].start_rad + found[0].width_rad + math.tau)
        found[0] = Arc(last.start_rad, min(math.tau, reach - last.start_rad))
    return found


def edged_arcs(
    by_stretch: Mapping[int, Sequence[Arc]],
    edges: Mapping[int, Sequence[SightEnd]],
    contacts: Sequence[Arc],
    near: Sequence[Arc],
    dark: Mapping[int, Sequence[SightEnd]],
) -> list[Arc]:
    """Return what stretches of wall, contacts, and walls close to the slot close beside edges of sight. The arcs are disjoint.

    `by_stretch` has the arcs of each stretch, `edges` its loose edges, and `dark` the dark ones of them.
    """
    whole = {stretch: united(each) for stretch, each in by_stretch.items()}
    beside = {stretch: [beside_edge(each, whole.get(stretch, ())) for each in ends] for stretch, ends in edges.items()}
    found = without_edges(
        [*contacts, *near], [each for ends in beside.values() for each in ends if not is_passed(each, near)]
    )
    lost = (beside_edge(each, whole.get(stretch, ())) for stretch, ends in dark.items() for each in ends)
    left = [each for each in lost if not is_passed(each, near)]
    for stretch, each in by_stretch.items():
        kept = without_edges(each, beside.get(stretch, ()))
        found += kept
        if left:
            # Where nobody saw how this stretch goes on, its wall ends up to that angle beside the robot, on either side.
            ends = (Arc(end.direction_rad - AT_WALL_RAD, 2.0 * AT_WALL_RAD) for end in dark.get(stretch, ()))
            parts = united_round(without_edges(kept, ends))
            left = [edge for edge in left if not is_passed(edge, parts)]
    return united(without_edges(found, left))


def within_ends(arc: Arc) -> Arc:
    """Return the directions of an arc that are not beside its ends."""
    if arc.width_rad >= math.tau:
        return arc
    return Arc(arc.start_rad + BESIDE_EDGE_RAD, max(0.0, arc.width_rad - 2.0 * BESIDE_EDGE_RAD))


def with_islands(opened: list[Arc], closed: Iterable[Arc]) -> list[Arc]:
    """Return the open arcs with the islands: arcs that nothing of `closed` contains, and beside which nothing is open."""
    islands = [each for each in complement(closed) if not any(overlap(each, arc) > 0.0 for arc in opened)]
    return [*opened, *islands]


def _outside(arc: Arc, cut: Arc) -> Iterator[Arc]:
    """Yield the parts of an arc outside another one, which is narrower than a turn."""
    off = (cut.start_rad - arc.start_rad) % math.tau
    back = off + cut.width_rad - math.tau  # the cut passes the start of the arc by this angle
    low = max(back, 0.0)
    if off > low and low < arc.width_rad:
        yield Arc(arc.start_rad + low, min(off, arc.width_rad) - low)
    if off + cut.width_rad < arc.width_rad:
        yield Arc(arc.start_rad + off + cut.width_rad, arc.width_rad - off - cut.width_rad)
