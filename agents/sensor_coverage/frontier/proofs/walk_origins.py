"""The walls that a robot touched close to the slot that it left: the slot's distance from there is known, by odometry.

No body passes between a robot and the wall that it touches. So a triangle of the slot, another slot and a point of such a
walk goes on to the touched point of the wall.
"""

from collections.abc import Iterator
from typing import NamedTuple

from zwerm.agents.sensor_coverage.frontier.fans import side_of
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import direction_of, touched_point
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, Walk, WalkPoint, arc_between


class _Touched(NamedTuple):
    """The slot, the point that it saw, and the directions [rad] in which it sees the walls that were touched there."""

    slot: int
    point: WalkPoint
    directions: tuple[float, ...]


class WalkOrigins:
    """The touched walls of points of walks, by the numbers of the points."""

    def __init__(self) -> None:
        self._touched: dict[int, _Touched] = {}

    def add(self, first: int, walk: Walk) -> None:
        """Take in a walk; `first` is the number of its first point."""
        if walk.origin is None:
            return
        slot, place = walk.origin
        for number, point in enumerate(walk.points, first):
            if slot in point.seen and point.walls:
                walls = (touched_point(point.at, wall, walk.radius_m) for wall in point.walls)
                self._touched[number] = _Touched(slot, point, tuple(direction_of(place, each) for each in walls))

    def touched(self, slot: int, number: int, side: int) -> Iterator[float]:
        """Yield the directions [rad] from a slot of the walls touched at a point, on one side of the point (+1 left, -1 right).

        There are none unless the walk began at the slot.
        """
        known = self._touched.get(number)
        if known is not None and known.slot == slot:
            yield from (each for each in known.directions if side_of(known.point, slot, each) == side)

    def arcs_beyond(self, slot: int, number: int, other_rad: float) -> Iterator[Arc]:
        """Yield the arcs at a slot from a point to the walls touched there, on the side away from another slot.

        They are closed where the triangle of the two slots and the point counts. The other slot is in the direction [rad].
        """
        known = self._touched.get(number)
        if known is not None and known.slot == slot:
            for each in self.touched(slot, number, -side_of(known.point, slot, other_rad)):
                yield arc_between(known.point.seen[slot], each)
