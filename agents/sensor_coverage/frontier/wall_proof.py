"""The local proof of coverage: the directions from a robot in which visible robots or followed walls close the space.

Every triangle of the proof has a standing robot i as a corner. Robot i sees the two other corners. One of these may be
a point of a walk along a wall. Its sides are free lines of sight, or a step of the walk. So i sees the whole triangle.
A robot is closed if such triangles fill the full turn around it. The robots at the ends of a triangle's side are
responsible for the space beyond it. Beyond a step of a walk is a wall. An open arc is frontier until a robot went
there.

An obstacle that lies within one triangle is not found. The triangle's sides are at most r_v long.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.fence import Views
from zwerm.agents.sensor_coverage.frontier.walks import Walk, WalkPoint
from zwerm.maths.simplicial import FlagComplex, edge

# An open arc narrower than this [rad] counts as closed: a body at r_v is 8 degrees wide.
GAP_RAD: Final = math.radians(6.0)
# A wall in touch with a standing robot closes this angle [rad] on both sides of its direction.
TOUCH_RAD: Final = math.radians(45.0)
# A walking robot that touches a wall and a standing robot at once closes this angle [rad] between the two.
POCKET_RAD: Final = math.radians(55.0)


class Arc(NamedTuple):
    """Directions from `start_rad` to the left, over `width_rad`."""

    start_rad: float
    width_rad: float


def open_arcs(
    views: Views, complex_: FlagComplex, walks: Iterable[Walk], touched: Mapping[int, Sequence[float]]
) -> dict[int, list[Arc]]:
    """Return the arcs in which each slot is open; `touched` has the directions of walls in touch with a slot."""
    closed: dict[int, list[Arc]] = {slot: [] for slot in complex_.vertices}
    for i, j, k in complex_.triangles:
        for a, b, c in ((i, j, k), (j, i, k), (k, i, j)):
            _close(closed[a], views[a][b], views[a][c])
    for slot, directions in touched.items():
        if slot in closed:
            closed[slot] += [Arc(each - TOUCH_RAD, 2.0 * TOUCH_RAD) for each in directions]
    for walk in walks:
        _close_along(walk, views, complex_, closed)
    found = {slot: _complement(arcs) for slot, arcs in closed.items()}
    return {slot: arcs for slot, arcs in found.items() if arcs}


def _close_along(walk: Walk, views: Views, complex_: FlagComplex, closed: Mapping[int, list[Arc]]) -> None:
    """Close the arcs of the triangles of a walk."""
    before: WalkPoint | None = None
    for point in walk.points:
        seen = [slot for slot in point.seen if slot in closed]
        for slot in seen:
            there = point.seen[slot]
            if before is not None and slot in before.seen and (point.in_touch or before.in_touch):
                step = math.remainder(there - before.seen[slot], math.tau)
                if step * walk.hand < 0.0:  # the slot and the wall are on different sides of the step
                    _close(closed[slot], before.seen[slot], there)
            for other in seen:
                if other != slot and edge(slot, other) in complex_:
                    _close(closed[slot], views[slot][other], there)
            if slot in point.robots and point.walls:
                off = min((math.remainder(each - there, math.tau) for each in point.walls), key=abs)
                _close(closed[slot], there, there + math.copysign(min(abs(off), POCKET_RAD), off))
        before = point


def _close(arcs: list[Arc], a_rad: float, b_rad: float) -> None:
    """Add the smaller arc between two directions."""
    off = math.remainder(b_rad - a_rad, math.tau)
    arcs.append(Arc(a_rad, off) if off >= 0.0 else Arc(b_rad, -off))


def _complement(arcs: Iterable[Arc]) -> list[Arc]:
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
