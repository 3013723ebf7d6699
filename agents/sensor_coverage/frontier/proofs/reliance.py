"""Whether slots that rely on each other for the space beyond their triangles with points of walks do so in a circle.

In a triangle of two slots and a point, each slot relies on the other for what lies beyond the line from that one to the point.
There the other may have a gap between its walls, which it closes by a triangle with a third slot, and so on. Where such a
chain comes back to where it began, nobody has seen the space.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.wall_proof import GAP_RAD, Arc, complement, contains, overlap, shared_arcs
from zwerm.maths.sums import added

# A slot relies on another one for a gap only if it looks further into it than this [rad]: bearings have noise.
SHARED_RAD: Final = math.radians(2.0)
# Sums of gaps that differ by less than this [rad] are equal.
EQUAL_RAD: Final = 1e-6


class Fan(NamedTuple):
    """A triangle of a slot, the `other` slot and a point, which the slot sees in these directions [rad].

    `from_other` is the direction of the point from the other slot. `more` are directions beyond the point that end at a wall
    in touch there. `beyond` are directions that the other slot closes only by triangles of robots before this slot: it sees
    the slot and the point between two robots, and leaves what is behind these to them.
    """

    other: int
    to_other: float
    to_point: float
    from_other: float
    more: Sequence[Arc]
    beyond: Sequence[Arc] = ()

    def arcs(self, gaps: Iterable[Arc]) -> list[Arc]:
        """Return the arcs that the triangle closes at the slot if the other slot has these gaps.

        A ray from the slot crosses the line to the point. The other slot sees the rest of it from the point on to the direction
        of the ray. A gap there leaves the rays open that come to it.
        """
        off = math.remainder(self.to_point - self.to_other, math.tau)
        side = math.copysign(1.0, off)
        turned = side * math.remainder(self.from_other - self.to_point, math.tau)
        free = min((self._begin(each, side) for each in (*gaps, *self.beyond)), default=math.pi) + SHARED_RAD - turned
        width = min(abs(off), max(free, 0.0))
        start = self.to_point - width if side > 0.0 else self.to_point
        return [Arc(start, width), *self.more]

    def _begin(self, gap: Arc, side: float) -> float:
        """Return the angle [rad] from the point to a gap of the other slot, in the direction in which rays come to it."""
        if contains((gap,), Arc(self.from_other, 0.0)):
            return 0.0
        edges = gap.start_rad, gap.start_rad + gap.width_rad
        return min(side * (self.from_other - each) % math.tau for each in edges)


class Answered(NamedTuple):
    """A gap for which other slots answer, each with an arc of its own: the gap is closed if one of them has no gap there."""

    gap: Arc
    others: Sequence[tuple[int, Arc]]

    def within(self, closed: Iterable[Arc]) -> Iterator["Answered"]:
        """Yield the parts of the gap that lie in arcs which are closed but for it: the others answer for no more."""
        yield from (self._replace(gap=part) for each in closed for part in shared_arcs(self.gap, each))

    def arcs(self, gaps: Mapping[int, Sequence[Arc]]) -> list[Arc]:
        """Return the gap if the slots with these gaps close it."""
        closed = any(all(overlap(arc, gap) <= GAP_RAD for gap in gaps.get(slot, ())) for slot, arc in self.others)
        return [self.gap] if closed else []


def circular_gaps(
    gaps: Mapping[int, Sequence[Arc]],
    fans: Mapping[int, Iterable[Fan]],
    answered: Mapping[int, Sequence[Answered]] = MappingProxyType({}),
) -> dict[int, list[Arc]]:
    """Return what is left of the gaps of each slot without triangles that rely on gaps which are left themselves.

    So it is with gaps for which other slots answer.
    """
    left = {slot: list(each) for slot, each in gaps.items() if each}
    while True:
        before, left = left, {}
        for slot, opened in before.items():
            closed = [arc for fan in fans.get(slot, ()) for arc in fan.arcs(before.get(fan.other, ()))]
            closed += [arc for each in answered.get(slot, ()) for arc in each.arcs(before)]
            free = complement(closed)
            parts = (part for gap in opened for each in free for part in shared_arcs(gap, each))
            if rest := [each for each in parts if each.width_rad > GAP_RAD]:
                left[slot] = rest
        if _width(left) > _width(before) - EQUAL_RAD:
            return left


def _width(gaps: Mapping[int, Iterable[Arc]]) -> float:
    return added(each.width_rad for arcs in gaps.values() for each in arcs)
