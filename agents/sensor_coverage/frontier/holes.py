"""Holes of a swarm's complex, by bearings: their corners, and whether a robot found an obstacle in them.

Homology finds a hole but does not distinguish a pillar from an accidental gap. Robots can: a robot that touched a wall,
or was stopped by one, knows its direction. A hole into which no such direction leads does not surround an obstacle.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from zwerm.agents.sensor_coverage.frontier.fence import SIXTY_RAD, Side, Views
from zwerm.maths.simplicial import FlagComplex, hole_cycles
from zwerm.maths.sums import added


class Corner(NamedTuple):
    """A slot on the cycle around a hole, with the hole on the left.

    `first_rad` is the direction to the `following` slot. The hole spans `width_rad` to the left of it.
    """

    slot: int
    following: int
    first_rad: float
    width_rad: float

    def faces(self, direction_rad: float) -> bool:
        """Return whether a direction [rad] from this slot leads into the hole."""
        return (direction_rad - self.first_rad) % math.tau < self.width_rad


Hole = tuple[Corner, ...]


def holes(views: Views, complex_: FlagComplex) -> list[Hole]:
    """Return the holes of the complex, each as a shortest cycle around it; `views` are directions in one frame."""
    found = []
    for cycle in hole_cycles(complex_):
        for oriented in (cycle, cycle[::-1]):
            corners = _corners(views, oriented)
            # With the hole on the left, the turns of the cycle add up to one full turn to the left.
            if math.pi < added(math.pi - each.width_rad for each in corners) < 3.0 * math.pi:
                found.append(corners)
    return found


def _corners(views: Views, cycle: Sequence[int]) -> Hole:
    return tuple(
        Corner(i, after, views[i][after], (views[i][before] - views[i][after]) % math.tau)
        for before, i, after in zip((cycle[-1], *cycle[:-1]), cycle, (*cycle[1:], cycle[0]), strict=True)
    )


def _tightened(hole: Hole, views: Views, complex_: FlagComplex) -> Hole:
    """Return an equally long cycle around the same hole, with no slot inside that three consecutive corners see.

    An obstacle that the robot at such a slot met may be in its triangles with these corners, and not in the hole.
    """
    left = {slot: None for slot in complex_.vertices if all(slot != each.slot for each in hole)}
    at = 0
    while at < len(hole):
        before, middle, after = hole[at - 1].slot, hole[at], hole[at].following
        inside = [
            each
            for each in complex_.neighbours[middle.slot]
            if each in left
            and before in complex_.neighbours[each]
            and after in complex_.neighbours[each]
            and middle.faces(views[middle.slot][each])
        ]
        if inside:
            del left[inside[0]]
            cycle = [each.slot for each in hole]
            cycle[at] = inside[0]
            hole, at = _corners(views, cycle), 0
        else:
            at += 1
    return hole


def is_bare(hole: Hole, views: Views, complex_: FlagComplex, met: Callable[[int], Iterable[float]]) -> bool:
    """Return whether no robot met an obstacle in a hole; `met` gives the directions of obstacles that a slot met.

    A robot inside the hole may have met the obstacle in any direction. It is inside if at least two robots around the
    hole see it there and none sees it elsewhere.
    """
    tight = _tightened(hole, views, complex_)
    if any(corner.faces(each) for corner in (*hole, *tight) for each in met(corner.slot)):
        return False
    hole = tight
    inside: dict[int, list[bool]] = {}
    for corner in hole:
        for each in complex_.neighbours[corner.slot]:
            inside.setdefault(each, []).append(corner.faces(views[corner.slot][each]))
    around = {corner.slot for corner in hole}
    return not any(
        len(seen) > 1 and all(seen) and any(True for _ in met(slot))
        for slot, seen in sorted(inside.items())
        if slot not in around
    )


def sides(hole: Hole) -> list[Side]:
    """Return the sides of a hole's edges from which a robot can drive into it, with the angles of algorithm 4."""
    found = []
    for one, other in zip(hole, (*hole[1:], hole[0]), strict=True):
        near, far = min(SIXTY_RAD, one.width_rad / 2.0), min(SIXTY_RAD, other.width_rad / 2.0)
        i, j = one.slot, other.slot
        found.append(Side(i, j, 1, near, far) if i < j else Side(j, i, -1, far, near))
    return found
