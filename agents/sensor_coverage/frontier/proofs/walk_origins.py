"""The walls that a robot touched close to the slot that it left: the slot's distance from there is known, by odometry.

No body passes between a robot and the wall that it touches. So a triangle of the slot, another slot and a point of such a
walk goes on to the touched point of the wall.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.fans import Pair, side_of
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import direction_of, touched_point
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, Origin, Walk, WalkPoint, arc_between

Views = Mapping[int, Mapping[int, float]]

# A robot closer to a point than this many diameters of a body is beside it: the directions there are too uncertain.
BESIDE_DIAMETERS: Final = 2.0


class _Touched(NamedTuple):
    """The slot, the point that it saw, and the directions [rad] in which it sees the walls that were touched there.

    It has the distance [m] of the point, and the distance below which a robot is beside the point.
    """

    slot: int
    point: WalkPoint
    directions: tuple[float, ...]
    distance_m: float
    close_m: float


class WalkOrigins:
    """The touched walls of points of walks, by the numbers of the points."""

    def __init__(self) -> None:
        self._touched: dict[int, _Touched] = {}
        self._origins: dict[int, Origin] = {}
        self._slots: dict[int, None] = {}

    def stays_at(self, stays: Mapping[int, int]) -> dict[int, int]:
        """Return the stays at the slots at which walks have begun."""
        return {slot: stays[slot] for slot in self._slots if slot in stays}

    def standing(self, number: int, point: WalkPoint, stays: Mapping[int, int]) -> WalkPoint:
        """Return a point as if its origin had not seen it, if another stay has begun there."""
        origin = self._origins.get(number)
        if origin is None or stays.get(origin.slot) == origin.stay:
            return point
        return point.unseen_by((origin.slot,))

    def add(self, first: int, walk: Walk) -> None:
        """Take in a walk; `first` is the number of its first point."""
        if walk.origin is None:
            return
        slot, place, _ = walk.origin
        self._slots[slot] = None
        for number, point in enumerate(walk.points, first):
            self._origins[number] = walk.origin
            if slot in point.seen and point.walls:
                walls = (touched_point(point.at, wall, walk.radius_m) for wall in point.walls)
                directions = tuple(direction_of(place, each) for each in walls)
                distance_m, close_m = math.dist(place, point.at), 2.0 * BESIDE_DIAMETERS * walk.radius_m
                self._touched[number] = _Touched(slot, point, directions, distance_m, close_m)

    def beside(self, number: int, views: Views) -> tuple[Pair, ...]:
        """Return the pairs of the slot and another one whose robot stands beside a point. The angles tell its distance."""
        known = self._touched.get(number)
        if known is None or known.slot not in views:
            return ()
        slot, point, found = known.slot, known.point, list[Pair]()
        for other, there in views[slot].items():
            if other in point.seen and slot in views.get(other, ()):
                here = abs(math.sin(math.remainder(there - point.seen[slot], math.tau)))
                apart = abs(math.sin(math.remainder(views[other][slot] - point.seen[other], math.tau)))
                if known.distance_m * here < known.close_m * apart:
                    found += [(slot, other), (other, slot)]
        return tuple(found)

    def touched(self, slot: int, number: int, side: int) -> Iterator[float]:
        """Yield the directions [rad] from a slot of the walls touched at a point, on one side of the point (+1 left, -1 right).

        There are none unless the walk began at the slot.
        """
        known = self._touched.get(number)
        if known is not None and known.slot == slot:
            yield from (each for each in known.directions if side_of(known.point, slot, each) == side)

    def arcs_of_triangle(self, pair: Pair, number: int, point: WalkPoint, views: Views) -> Iterator[Arc]:
        """Yield the arcs at the first slot of a pair that its triangle with a point and the other slot closes.

        It goes on to the walls touched at the point, on the side away from the other slot. It does not if the noise of bearings
        shows the two slots the point on different sides of their line: along a wall each may rely on the other past the end of
        its own part.
        """
        slot, other = pair
        to_other, there = views[slot][other], point.seen[slot]
        yield arc_between(to_other, there)
        side = side_of(point, slot, to_other)
        if side != side_of(point, other, views[other][slot]):
            for each in self.touched(slot, number, -side):
                yield arc_between(there, each)
