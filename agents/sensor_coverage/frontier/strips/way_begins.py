"""The directions around a slot beyond the point of a wall that a robot touched first, where its way along the wall begins.

The place of a touched point is not known well, so the way closes a part of a body beyond it. When the robot has followed the
same wall with its other hand too, it knows more: nothing beyond the two points is left out, and only what is between them
counts, or what comes before the end of the other way. Otherwise the part beyond a corner would hide what lies behind it.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Final

from zwerm.agents.sensor_coverage.frontier.wall_proof import ANYONE, Arc, NearArc

# Directions that differ by less than this [rad] are the same, after the way through a message.
SAME_RAD: Final = 1e-3


def begin_width(arc: Arc, hand: int, begins: Iterable[Arc]) -> float:
    """Return the width [rad] of the part of an arc beyond the point where a way with the wall at the `hand` begins, or 0."""
    for each in begins if hand else ():
        if abs(math.remainder(_edge_of(each, hand) - _edge_of(arc, hand), math.tau)) < SAME_RAD:
            return each.width_rad
    return 0.0


def between_begins(near: Sequence[NearArc]) -> list[NearArc]:
    """Return arcs of walls close to a slot without what is beyond the begins of two ways, with one hand and the other."""
    return [_shortened(each, near) if each.begin_rad > 0.0 else each for each in near]


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
    (start, width), cut = arc.arc, arc.begin_rad - left
    return arc._replace(arc=Arc(start if arc.hand > 0 else start + cut, width - cut))


def _begin_of(arc: NearArc) -> float:
    """Return the direction [rad] of the touched point where a way begins."""
    return _edge_of(arc.arc, arc.hand) - arc.hand * arc.begin_rad


def _edge_of(arc: Arc, hand: int) -> float:
    """Return the direction [rad] of the edge of an arc at which a way with the wall at the `hand` begins."""
    return arc.start_rad + arc.width_rad if hand > 0 else arc.start_rad
