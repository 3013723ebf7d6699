"""The holes of a swarm's complex, by bearings: which way is in, and whether anything was ever met there.

Homology finds a hole but does not tell a pillar from a gap that was left by chance. Robots can: whoever touched a wall, or was
stopped by one, knows in which direction. A hole into which no such direction leads is no obstacle's.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from zwerm.agents.sensor_coverage.frontier.fence import SIXTY_RAD, Side, Views
from zwerm.maths.simplicial import FlagComplex, hole_cycles


class Corner(NamedTuple):
    """A place on the way around a hole, which is on the left: from the direction of the next place so far to the left."""

    place: int
    following: int
    first_rad: float
    width_rad: float

    def faces(self, direction_rad: float) -> bool:
        """Tell whether a direction from here leads into the hole."""
        return (direction_rad - self.first_rad) % math.tau < self.width_rad


Hole = tuple[Corner, ...]


def holes(views: Views, complex_: FlagComplex) -> list[Hole]:
    """Return the holes of the complex, each as a shortest way around it; `views` are directions in one frame."""
    found = []
    for cycle in hole_cycles(complex_):
        for way in (cycle, cycle[::-1]):
            corners = _corners(views, way)
            # The turns of the way around what is on the left come to one to the left.
            if math.pi < sum(math.pi - each.width_rad for each in corners) < 3.0 * math.pi:
                found.append(corners)
    return found


def _corners(views: Views, way: Sequence[int]) -> Hole:
    return tuple(
        Corner(i, after, views[i][after], (views[i][before] - views[i][after]) % math.tau)
        for before, i, after in zip((way[-1], *way[:-1]), way, (*way[1:], way[0]), strict=True)
    )


def _tightened(hole: Hole, views: Views, complex_: FlagComplex) -> Hole:
    """Return a way as long around the same hole, with no place inside that three of its corners in a row see.

    What such a place met need not be in the hole: it may be in the triangles that it makes with those.
    """
    left = {place: None for place in complex_.vertices if all(place != each.place for each in hole)}
    at = 0
    while at < len(hole):
        before, middle, after = hole[at - 1].place, hole[at], hole[at].following
        inside = [
            each
            for each in complex_.neighbours[middle.place]
            if each in left
            and before in complex_.neighbours[each]
            and after in complex_.neighbours[each]
            and middle.faces(views[middle.place][each])
        ]
        if inside:
            del left[inside[0]]
            way = [each.place for each in hole]
            way[at] = inside[0]
            hole, at = _corners(views, way), 0
        else:
            at += 1
    return hole


def is_bare(hole: Hole, views: Views, complex_: FlagComplex, met: Callable[[int], Iterable[float]]) -> bool:
    """Tell whether nothing was ever met in a hole; `met` are the directions from a place in which something was.

    A robot within the hole, whom at least two around it see there and none elsewhere, may have met it in any direction.
    """
    tight = _tightened(hole, views, complex_)
    if any(corner.faces(each) for corner in (*hole, *tight) for each in met(corner.place)):
        return False
    hole = tight
    inside: dict[int, list[bool]] = {}
    for corner in hole:
        for each in complex_.neighbours[corner.place]:
            inside.setdefault(each, []).append(corner.faces(views[corner.place][each]))
    around = {corner.place for corner in hole}
    return not any(
        len(seen) > 1 and all(seen) and any(True for _ in met(place))
        for place, seen in sorted(inside.items())
        if place not in around
    )


def sides(hole: Hole) -> list[Side]:
    """Return the sides of a hole's edges from which a robot could go into it, with the angles of algorithm 4."""
    found = []
    for one, other in zip(hole, (*hole[1:], hole[0]), strict=True):
        near, far = min(SIXTY_RAD, one.width_rad / 2.0), min(SIXTY_RAD, other.width_rad / 2.0)
        i, j = one.place, other.place
        found.append(Side(i, j, 1, near, far) if i < j else Side(j, i, -1, far, near))
    return found
