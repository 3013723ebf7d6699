"""The directions around a slot beyond the point of a wall that a robot touched first, where its way along the wall begins.

The place of a touched point is not known well, so the way closes a part of a body beyond it. When the robot has followed the
same wall with its other hand too, it knows more: nothing beyond the two points is left out, and only what is between them
counts, or what comes before the end of the other way. Otherwise the part beyond a corner would hide what lies behind it.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Final

from zwerm.agents.sensor_coverage.frontier.wall_proof import ANYONE, BESIDE_EDGE_RAD, Arc, NearArc

# Directions that differ by less than this [rad] are the same, after the way through a message.
SAME_RAD: Final = 1e-3


def begin_width(arc: Arc, hand: int, begins: Iterable[Arc]) -> float:
    """Return the width [rad] of the part of an arc beyond the point where a way with the wall at the `hand` begins, or 0."""
    for each in begins:
        if abs(math.remainder(_edge_of(each, hand) - _edge_of(arc, hand), math.tau)) < SAME_RAD:
            return each.width_rad
    return 0.0


def end_width(arc: Arc, hand: int, past_ends: Iterable[Arc]) -> float:
    """Return the width [rad] of the arc past the end of a way that follows an arc with the wall at the `hand`, or 0."""
    for each in past_ends:
        if abs(math.remainder(_edge_of(each, hand) - _edge_of(arc, -hand), math.tau)) < SAME_RAD:
            return each.width_rad
    return 0.0


def between_begins(near: Sequence[NearArc]) -> list[NearArc]:
    """Return arcs of walls close to a slot without what is beyond the begins of two ways, with one hand and the other."""
    return [_shortened(each, near) if each.begin_rad > 0.0 else each for each in near]


def certain_arcs(near: Sequence[NearArc]) -> list[Arc]:
    """Return the arcs in which walls close to a slot certainly go on, each along one wall without a break.

    A wall was touched somewhere within a part of a body: at its begin, and at its end, where nobody saw how it goes on. Where
    ways with both hands begin at one point, it goes on there.
    """
    found = list[Arc]()
    for each, short in zip(near, between_begins(near), strict=True):
        if not each.is_past_end:
            joined = [other for other in near if _is_joined(each, other)]
            is_certain = bool(joined) or each.begin_rad == 0.0
            found.append(_before_end(short if is_certain else _cut(each, 2.0 * each.begin_rad)))
            found += [_of_both(each, other) for other in joined if each.hand > 0]
    return [each for each in found if each.width_rad > 0.0]


def _before_end(near: NearArc) -> Arc:
    """Return the directions of an arc that are not beside the end of its way."""
    (start, width), cut = near.arc, max(BESIDE_EDGE_RAD, near.end_rad)
    return near.arc if width >= math.tau else Arc(start + (cut if near.hand > 0 else 0.0), max(0.0, width - cut))


def _of_both(left: NearArc, right: NearArc) -> Arc:
    """Return the arc of one wall that a robot followed from one point, with the left hand and with the right one."""
    first, second = _before_end(left), _before_end(right)
    between = math.remainder(_begin_of(right) - _begin_of(left), math.tau)
    width = first.width_rad - left.begin_rad + between + second.width_rad - right.begin_rad
    return Arc(first.start_rad, min(width, math.tau))


def _is_joined(one: NearArc, other: NearArc) -> bool:
    """Return whether ways with the two hands begin at the same point."""
    off = abs(math.remainder(_begin_of(other) - _begin_of(one), math.tau))
    same = other.hand == -one.hand and other.robot == one.robot != ANYONE and not other.is_past_end
    return same and min(one.begin_rad, other.begin_rad) > 0.0 and off <= one.begin_rad + other.begin_rad


def _cut(arc: NearArc, by_rad: float) -> NearArc:
    """Return an arc without an angle [rad] at the edge where its way begins."""
    start, width = arc.arc
    by_rad = min(by_rad, width)
    return arc._replace(arc=Arc(start if arc.hand > 0 else start + by_rad, width - by_rad))


def _shortened(arc: NearArc, near: Iterable[NearArc]) -> NearArc:
    """Return an arc up to where a way with the other hand begins, if that one is close enough to be the same point, or ends.

    A way that comes along the wall and ends beyond the point has found no more of it.
    """
    left = arc.begin_rad
    begin = _begin_of(arc)
    for each in near:
        if each.hand == -arc.hand and each.robot == arc.robot != ANYONE and not each.is_past_end:
            beyond = arc.hand * math.remainder(_begin_of(each) - begin, math.tau)
            if each.begin_rad > 0.0 and abs(beyond) <= arc.begin_rad + each.begin_rad:
                left = min(left, max(beyond, 0.0))
            beyond = arc.hand * math.remainder(_edge_of(each.arc, arc.hand) - begin, math.tau)
            if beyond > 0.0:
                left = min(left, beyond)
    return _cut(arc, arc.begin_rad - left)


def _begin_of(arc: NearArc) -> float:
    """Return the direction [rad] of the touched point where a way begins."""
    return _edge_of(arc.arc, arc.hand) - arc.hand * arc.begin_rad


def _edge_of(arc: Arc, hand: int) -> float:
    """Return the direction [rad] of the edge of an arc at which a way with the wall at the `hand` begins."""
    return arc.start_rad + arc.width_rad if hand > 0 else arc.start_rad
