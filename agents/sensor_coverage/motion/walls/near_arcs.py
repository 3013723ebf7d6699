"""The arcs around a slot that its robot closes when it leaves the slot along a wall close to it, by odometry."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, combinations, dropwhile, pairwise
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.directions import BESIDE_M, angle_between
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import (
    StretchEnd,
    direction_of,
    ends_of_stretch,
    kept_part,
    touched_point,
)
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    CONTACT_RAD,
    SAME_WALL_RAD,
    Arc,
    Crossing,
    arc_between,
    arcs_into,
    leaves_wall,
    shared_arcs,
    united,
)
from zwerm.agents.sensor_coverage.messages.commands import NearArcs, NearWalls, Waypoint
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit

# Points closer [m] to the start have no direction from there.
NEAR_M_MIN: Final = 0.02
# Two contacts at the same point that differ by less than this [rad] are the walls of a corner. The walls of a passage as wide
# as a body differ by 150 degrees or more, as two switches show them. So do those of a wedge, but there the robot turns back.
CORNER_RAD: Final = math.radians(125.0)
WEDGE_RAD: Final = math.radians(175.0)
# The arcs of so many places are compared at which another robot may stand (`BESIDE_M`).
PLACES: Final = 8
# A way shorter than this [m] leads nowhere: the robot is wedged.
WEDGED_M: Final = 0.005
# The place of a touched point is known within this part of a body's radius, by the width of a switch. So far a wall goes on
# beyond it: two walks from the same slot that begin at the same point leave no gap.
OVERHANG: Final = math.sin(CONTACT_RAD)
# A line of sight back to the start may leave the way on the side away from the wall by this part of a body's radius: a whole
# radius, less the error of the place of a touched point.
FREE: Final = 1.0 - OVERHANG
# A line of sight from the start counts as free up to this part of a body's radius beside the way. The body sweeps a radius.
# With the rest the walls that a probe follows near a slot count, which are at most a diameter away.
SWEPT: Final = 2.0


class NearPoint(NamedTuple):
    """A point [m] of the way along a wall close to the start, and the directions of touched walls [rad].

    `at_robot` is true if a robot is in touch, dead or not, but for the one that stands at the start.
    """

    at: Vector
    walls: tuple[float, ...]
    at_robot: bool = False


class FollowedWay(NamedTuple):
    """The points of a way along a wall at a `hand` (+1 left, -1 right), of a body with a radius [m].

    With `swept_only` a wall counts only where no corner may hide it from the start.
    """

    points: Sequence[NearPoint]
    hand: int
    radius_m: float
    swept_only: bool = False


class NearWay:
    """The way of a robot along a wall from a `start` [m], with the wall at its hand: what it touched, and what it saw there.

    `waypoints` are its points. With `swept_only` a wall counts only where no corner may hide it from the start: where the way
    there led close to the line of sight, or the robot drove straight back in the end (`close`).
    """

    def __init__(self, start: Vector, hand: int, radius_m: float, swept_only: bool = False) -> None:
        self.hand = hand
        self.waypoints: list[Waypoint] = []
        self._start, self._radius_m = start, radius_m
        self._points: list[NearPoint] = []
        self._swept_only = swept_only

    def close(self, way_back: Iterable[Vector]) -> None:
        """Note how the robot drove back to the start. If it did so straight, no corner is between that and the way out."""
        *_, end = driven = [self._points[-1].at, *way_back]
        arrived = math.dist(end, self._start) < self._radius_m
        if arrived and is_swept(self._start, driven[::-1], FREE * self._radius_m):
            self._swept_only = False

    def take(self, point: NearPoint) -> None:
        """Take in the next point."""
        self._points.append(point)

    def walls(self) -> NearWalls:
        """Return the arcs (start, width) [rad] around the start that the way closes."""
        return walls_around(self._start, self._followed())

    def arcs_beside(self) -> NearArcs:
        """Return the arcs (start, width) [rad] that the way closes around each place where another robot may stand."""
        places = places_beside(self._start, self._points, self._radius_m)
        return arcs_around_all(places, self._followed())

    def _followed(self) -> FollowedWay:
        return FollowedWay(self._points, self.hand, self._radius_m, self._swept_only)

    def seen_from_start(self) -> list[Waypoint]:
        """Return the waypoints from the first one that has a direction from the start."""
        return list(
            dropwhile(lambda each: math.dist((each.x_m, each.y_m), self._start) < self._radius_m, self.waypoints)
        )


class NearPoints:
    """The points of a way, passed on to it in their order as soon as it is known what they are in touch with.

    Whether a body of a dead robot counts as wall is known only when walls alone are in touch again (`dead_bodies`). So a
    point at a body waits until then, as the waypoint at the same place does.
    """

    def __init__(self, way: NearWay, report: Callable[[Waypoint], None]) -> None:
        self.way = way
        self._report = report
        self._waiting: deque[tuple[NearPoint, Waypoint, bool]] = deque()

    def expect(self, near: NearPoint, point: Waypoint, at_other: bool) -> None:
        """Note a point, and the waypoint at which it is; `at_other` if a robot that is no body is in touch there."""
        self._waiting.append((near, point, at_other))

    def take(self, point: Waypoint) -> None:
        """Take in the next waypoint, and report it. Where it is not the same as before, the bodies count as wall."""
        near, before, at_other = self._waiting.popleft()
        if (point.touched, point.robots) != (before.touched, before.robots):
            near = near._replace(walls=point.touched, at_robot=at_other)
        self.way.take(near)
        self._report(point)


class _Stretch(NamedTuple):
    """A stretch of wall along a way: the numbers of its `first` and `last` points in touch with the wall, and its two ends.

    An end `is_clear` if no robot was in touch there.
    """

    first: int
    last: int
    ends: tuple[StretchEnd, StretchEnd]
    is_clear: tuple[bool, bool]


def walls_around(start: Vector, way: FollowedWay) -> NearWalls:
    """Return the walls around a start that were followed in touch, by odometry.

    Two successive points close the arc between them, if the wall is beyond, up to the touched points at the ends of a stretch
    (`frontier.strips.loose_ends`), and a part of a body beyond, but not where the way leads back round a corner in sight of
    the start (`frontier.strips.crossings`). What is beyond is past an end, except where the way begins: the robot meets the
    same wall there with its other hand. Two successive contacts with the same wall close the arc
    between the touched points of the wall. So do two contacts at the same point, because a body does not pass between them:
    those of a corner, or of a wedge from which the robot turned back. A robot may fill an opening: from there on only
    the same wall closes an arc, up to the next wall. A step from one wall to the opposite one closes nothing.
    """
    stretches = list(_stretches(way))
    past_ends = (
        _arc_past(start, stretch.ends[number], way.hand if number == 0 else -way.hand, way.radius_m)
        for stretch in stretches
        for number, is_clear in enumerate(stretch.is_clear)
        if is_clear and not _begins_way(stretch, number)
    )
    begins = _positive(_begins(start, way, stretches))
    followed = _positive(_arcs_followed(start, way, stretches))
    return NearWalls((*followed, *begins), _positive(past_ends), begins)


def _stretches(way: FollowedWay) -> Iterator[_Stretch]:
    """Yield the stretches of wall along a way that have two points in touch with the wall at least."""
    points, hand, radius_m, _ = way

    def stretch(first: int, last: int, is_clear: tuple[bool, bool]) -> Iterator[_Stretch]:
        touching = [number for number in range(first, last + 1) if points[number].walls]
        if len(touching) >= 2:
            contacts = [(points[number].at, points[number].walls) for number in touching]
            yield _Stretch(touching[0], touching[-1], ends_of_stretch(contacts, hand, radius_m), is_clear)

    past_robot, begins_clear = False, False
    first: int | None = None
    for number, (before, point) in enumerate(pairwise(points)):
        past_robot = before.at_robot or (past_robot and not before.walls)
        leaves = leaves_wall(hand, before.walls, point.walls, point.at[0] - before.at[0], point.at[1] - before.at[1])
        is_beside = (before.walls or point.walls) and not (past_robot or point.at_robot)
        if not leaves and (is_beside or any(_same_walls(before, point))):
            if first is None:
                first, begins_clear = number, not before.at_robot
        elif first is not None:
            yield from stretch(first, number, (begins_clear, not (before.at_robot or point.at_robot)))
            first = None
    if first is not None:
        yield from stretch(first, len(points) - 1, (begins_clear, not points[-1].at_robot))


def _begins_way(stretch: _Stretch, end: int) -> bool:
    """Return whether an end of a stretch, 0 or 1, is where the way begins."""
    return end == 0 and stretch.first == 0


def _same_walls(before: NearPoint, point: NearPoint) -> Iterator[tuple[float, float]]:
    """Yield the directions of contacts [rad] at two successive points that are with the same wall."""
    return ((a, b) for a in before.walls for b in point.walls if angle_between(a, b) < SAME_WALL_RAD)


def _begins(start: Vector, way: FollowedWay, stretches: Iterable[_Stretch]) -> Iterator[tuple[float, float]]:
    """Yield the arc (start, width) [rad] beyond the touched point where a way begins, if no robot was in touch there."""
    for stretch in stretches:
        if stretch.is_clear[0] and _begins_way(stretch, 0):
            yield _arc_past(start, stretch.ends[0], way.hand, way.radius_m)


def _arcs_followed(start: Vector, way: FollowedWay, stretches: Sequence[_Stretch]) -> Iterator[tuple[float, float]]:
    """Yield the arcs (start, width) [rad] around a start in which walls were followed, up to their ends; see `walls_around`."""
    points, hand, radius_m, swept_only = way
    places = [each.at for each in points]
    upto = [places[: number + 1] for number in range(len(places))]
    swept = [not swept_only or is_swept(start, each, SWEPT * radius_m) for each in upto]
    for number, each in enumerate(points):
        limit_rad = WEDGE_RAD if _turns_back(start, points, number) else CORNER_RAD
        for a, b in combinations(each.walls, 2) if swept[number] else ():
            if angle_between(a, b) < limit_rad:
                yield _between(start, *(touched_point(each.at, wall, radius_m) for wall in (a, b)))
    for number, (before, point) in enumerate(pairwise(points), 1):
        for a, b in _same_walls(before, point) if swept[number] else ():
            yield _between(start, touched_point(before.at, a, radius_m), touched_point(point.at, b, radius_m))
    in_sight = [start_in_sight(start, each, hand, radius_m) is not None for each in upto]
    for stretch in stretches:
        part = slice(stretch.first, stretch.last + 1)
        seen = list(zip(points[part], in_sight[part], swept[part], strict=True))
        yield from _arcs_of_stretch(start, seen, stretch.ends, hand)


def _positive(arcs: Iterable[tuple[float, float]]) -> NearArcs:
    """Return arcs (start, width) [rad] with widths to the left."""
    return tuple((start, width) if width >= 0.0 else (start + width, -width) for start, width in arcs)


def places_beside(start: Vector, points: Iterable[NearPoint], radius_m: float) -> list[Vector]:
    """Return the places [m] around a start where another robot may stand: those that bodies can get to, between walls."""
    touched = [touched_point(each.at, wall, radius_m) for each in points for wall in each.walls]
    around = (unit(math.tau * number / PLACES) for number in range(PLACES))
    places = ((start[0] + BESIDE_M * x, start[1] + BESIDE_M * y) for x, y in around)
    return [start, *(place for place in places if all(math.dist(place, each) > FREE * radius_m for each in touched))]


def arcs_around_all(places: Iterable[Vector], way: FollowedWay) -> NearArcs:
    """Return the arcs (start, width) [rad] in which a wall was followed around each of some places; see `walls_around`."""
    stretches = list(_stretches(way))
    shared = [Arc(0.0, math.tau)]
    for place in places:
        found = chain(_arcs_followed(place, way, stretches), _begins(place, way, stretches))
        closed = united(Arc(*each) for each in _positive(found))
        shared = [part for each in shared for other in closed for part in shared_arcs(each, other)]
    return tuple(shared)


def _turns_back(start: Vector, points: Sequence[NearPoint], number: int) -> bool:
    """Return whether walls alone made the robot turn back at a point of its way, or wedged it."""
    if number + 1 == len(points) or points[number].at_robot:
        return False
    before, at, after = (start if number == 0 else points[number - 1].at), points[number].at, points[number + 1].at
    on = after[0] - at[0], after[1] - at[1]
    return math.hypot(*on) < WEDGED_M or (at[0] - before[0]) * on[0] + (at[1] - before[1]) * on[1] < 0.0


def _arcs_of_stretch(
    start: Vector, points: Sequence[tuple[NearPoint, bool, bool]], ends: Iterable[StretchEnd], hand: int
) -> Iterator[tuple[float, float]]:
    """Yield the arcs (start, width) [rad] around a start that the steps along one stretch of wall close.

    Each point states whether it is in sight of the start, as far as the wall at the hand is concerned, and whether the line
    of sight was swept.
    """
    crossings = list[Crossing]()
    for (before, was_in_sight, _), (point, is_in_sight, swept) in pairwise(points):
        first, width = _between(start, before.at, point.at)
        if min(math.dist(start, each.at) for each in (before, point)) <= NEAR_M_MIN:
            continue
        if width * hand < 0.0:  # the start and the wall are on different sides of the step
            if not swept:
                continue
            low, high = kept_part(before.at, point.at, first, width, ends)
            if low < high:
                crossings.append(Crossing(arc_between(first + low * width, first + high * width), 1))
        elif was_in_sight or is_in_sight:  # round a corner, out of the strip beside the wall
            crossings.append(Crossing(arc_between(first, first + width), -1))
    yield from arcs_into(crossings)


def _arc_past(start: Vector, end: StretchEnd, hand: int, radius_m: float) -> tuple[float, float]:
    """Return the arc (start, width) [rad] around a start past an end of a stretch, a part of a body long.

    The stretch leads on from this end with the wall at the `hand`.
    """
    ux, uy = unit(direction_of(end.at, end.touched) + hand * math.pi / 2.0)
    return _between(
        start, end.touched, (end.touched[0] + OVERHANG * radius_m * ux, end.touched[1] + OVERHANG * radius_m * uy)
    )


def start_in_sight(start: Vector, way: Sequence[Vector], hand: int, radius_m: float) -> float | None:
    """Return the direction [rad] from the end of a way back to its start, or None if the wall at the hand is in between.

    The wall is a radius away from the way, on the side of the `hand`. So the line of sight is free where the way lies on that
    side of it, or beside it. At less than a radius from the start there is no direction.
    """
    ux, uy = way[-1][0] - start[0], way[-1][1] - start[1]
    length_m = math.hypot(ux, uy)
    if length_m < radius_m:
        return None
    ux, uy = ux / length_m, uy / length_m
    for x, y in way:
        dx, dy = x - start[0], y - start[1]
        if 0.0 < ux * dx + uy * dy < length_m and hand * (ux * dy - uy * dx) < -FREE * radius_m:
            return None
    return math.atan2(-uy, -ux)


def is_swept(start: Vector, way: Sequence[Vector], aside_m: float) -> bool:
    """Return whether the line from a start to the end of a way is close to the way: no corner hides the end from there.

    The robot drove straight from the start to the first point.
    """
    x_m, y_m = way[-1][0] - start[0], way[-1][1] - start[1]
    limit = aside_m * math.hypot(x_m, y_m)
    return all(abs(x_m * (y - start[1]) - y_m * (x - start[0])) <= limit for x, y in way)


def _between(start: Vector, a: Vector, b: Vector) -> tuple[float, float]:
    """Return the direction [rad] of a point from the start, and the angle from there to another point."""
    first = direction_of(start, a)
    return first, math.remainder(direction_of(start, b) - first, math.tau)
