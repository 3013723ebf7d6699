"""Walls that go on behind standing robots: a robot that follows one goes round the robots that stand at it.

Between two touched points of walls that are close to each other no body passes. So it is from the point that the walking
robot touched last before it came to a standing one, to the point that this one touches itself, and from there to the next one
that the walking robot touches. The way round the standing robot is a step along the wall then: it ends no stretch, and nobody
else answers for what is behind that robot. The robot itself sees the wall on both sides (`crossings.crossings_of_pocket`).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import Vector, is_shut, place_of_robot, touched_point
from zwerm.agents.sensor_coverage.frontier.wall_proof import Walk, WalkPoint

# The directions [rad] of walls that robots touch, by slot and number of the stay.
TouchedBy = Mapping[tuple[int, int], Sequence[float]]


class Bridged(NamedTuple):
    """A walk with marks at the points beside a wall that goes on there, and the slots of the robots in front of it."""

    walk: Walk
    robots: tuple[int, ...]


def bridged(walk: Walk, touched_by: TouchedBy) -> Bridged:
    """Mark the points at which the robot of a walk went round robots in front of one wall; `touched_by` has what these touch.

    Dead bodies may fill an opening, and are pushed on: where the robot touched one, nothing is marked.
    """
    marked, robots = dict[int, WalkPoint](), dict[int, None]()
    for first, last in _round_robots(walk.points):
        if _is_one_wall(walk, first, last, touched_by):
            marked |= {number: walk.points[number]._replace(is_bridged=True) for number in range(first + 1, last)}
            marked[last] = walk.points[last]._replace(left_walls=False)
            robots |= dict.fromkeys(slot for each in walk.points[first : last + 1] for slot in each.robots)
    if not marked:
        return Bridged(walk, ())
    points = tuple(marked.get(number, each) for number, each in enumerate(walk.points))
    return Bridged(walk._replace(points=points), tuple(robots))


def _round_robots(points: Sequence[WalkPoint]) -> Iterator[tuple[int, int]]:
    """Yield the numbers of two successive points with walls in touch, if the robot went round living robots in between."""
    first: int | None = None
    for last, each in enumerate(points):
        if each.walls:
            if first is not None and last > first + 1:
                way = points[first : last + 1]
                if any(one.robots for one in way) and not any(one.at_body for one in way):
                    yield first, last
            first = last


def _is_one_wall(walk: Walk, first: int, last: int, touched_by: TouchedBy) -> bool:
    """Return whether no opening fits between the walls in touch at two points, or beside those that the robots touch."""
    reached, ends = (_touched(walk.points[number], walk.radius_m) for number in (first, last))
    left = [
        touched_point(place, each, walk.radius_m)
        for slot, place in _places(walk.points[first : last + 1], walk.radius_m)
        for each in touched_by.get((slot, walk.stays.get(slot, -1)), ())
    ]
    while reached:
        if any(is_shut(a, b, walk.radius_m) for a in reached for b in ends):
            return True
        reached = [each for each in left if any(is_shut(each, one, walk.radius_m) for one in reached)]
        left = [each for each in left if each not in reached]
    return False


def _places(way: Iterable[WalkPoint], radius_m: float) -> Iterator[tuple[int, Vector]]:
    """Yield the slots whose robots were touched on a way, and the places [m] of these, by the first contact with each."""
    known: dict[int, None] = {}
    for point in way:
        for slot in point.robots:
            if slot in point.seen and slot not in known:
                known[slot] = None
                yield slot, place_of_robot(point.at, point.seen[slot], radius_m)


def _touched(point: WalkPoint, radius_m: float) -> list[Vector]:
    """Return the touched points [m] of walls."""
    return [touched_point(point.at, each, radius_m) for each in point.walls]
