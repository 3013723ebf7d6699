"""The local proof of coverage: the directions from a robot in which visible robots or followed walls close the space.

Every triangle of the proof has a standing robot i as a corner. Robot i sees the two other corners. One of these may be
a point of a walk along a wall. Its sides are free lines of sight, or a step of the walk. So i sees the whole triangle.
A robot is closed if such triangles fill the full turn around it. The robots at the ends of a triangle's side are
responsible for the space beyond it. Beyond a step of a walk is a wall. An open arc is frontier until a robot went there.
An obstacle that lies within one triangle, whose sides are at most r_v long, is not found.

A triangle of two slots and a point of a walk counts only if the space beyond its sides is proved, too: two such triangles
with different points may cross, and each slot would rely on the other's (`frontier.fans`).

Walks are remembered in directions from the slots that saw them. What a slot closed with others counts while these stand.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from zwerm.maths.sums import added

# An open arc narrower than this [rad] counts as closed: ends of arcs that join differ by less. An opening that a robot sees
# along the wall may be 2 degrees wide, as a door of 0.25 m is at 0.6 m from a robot in touch with its wall.
GAP_RAD: Final = math.radians(1.5)
# A wall in touch with a standing robot closes this angle [rad] on both sides of its direction.
TOUCH_RAD: Final = math.radians(45.0)
# The touched wall lies within this angle [rad] of the direction: half a switch.
CONTACT_RAD: Final = math.radians(15.0)
# A walking robot that touches a wall and a standing robot at once closes this angle [rad] between the two.
POCKET_RAD: Final = math.radians(55.0)
# Successive points without a contact at which a walking robot still follows the wall: it turns round a corner.
BLIND_MAX: Final = 3
# Contacts at two points that differ by less than this [rad] are with the same wall: a switch is 30 degrees wide.
SAME_WALL_RAD: Final = math.radians(35.0)
# A robot with a hand on a wall has it on that side, and behind while it turns round a corner. It leaves the wall if it drives
# farther than the first angle [rad] from its direction with the wall at the other side, or than the second with it at that one.
LEAVING_RAD: Final = math.radians(110.0)
ROUNDING_RAD: Final = math.radians(150.0)
# Between two steps the direction of a contact with the same wall, or with its end, changes by less than this [rad].
OPPOSITE_RAD: Final = math.radians(149.0)
# A way [m] shorter than the first has no direction. One longer than the second is not a single step.
LEAVING_M_MIN: Final = 0.015
LEAVING_M_MAX: Final = 0.07
# Largest arc [rad] behind a corner in which a slot may lose sight of a walking robot that stays in touch with the wall.
HIDDEN_RAD: Final = math.radians(30.0)
# A point of a walk is news for the walking robot if the open arcs become smaller by this [rad].
NEWS_RAD: Final = 0.02
# A followed wall lies beyond a line of sight if it closes the direction this far [rad] beside it.
BESIDE_RAD: Final = 0.02
# Directions [rad] beside a loose edge of sight, or the end of a wall, that the wall does not close.
BESIDE_EDGE_RAD: Final = math.radians(5.0)
ANYONE: Final = -1  # any robot at a slot
# Arcs apart by less than this [rad] are stored as one.
HAIR_RAD: Final = 1e-9


class Arc(NamedTuple):
    """Directions from `start_rad` to the left, over `width_rad`."""

    start_rad: float
    width_rad: float


class Crossing(NamedTuple):
    """Directions of a slot that cross a piece of the way of a walking robot: into the strip beside the wall (+1), or out of it.

    The strip lies between the way and the wall.
    """

    arc: Arc
    into: int


class NearArc(NamedTuple):
    """An arc around a slot in which its robot followed a wall close to it, with the wall at its `hand`, +1 left, -1 right.

    The arc counts for the `robot`, or for ANYONE. Past an end a wall may end. The last `begin_rad` of the arc, at the edge
    where the robot's way along the wall begins, are beyond the touched point, and at the other edge the wall may end by
    `end_rad` before it. `stay` is the number of the stay at the slot in which it was found.
    """

    arc: Arc
    hand: int
    robot: int = ANYONE
    is_past_end: bool = False
    begin_rad: float = 0.0
    end_rad: float = 0.0
    stay: int = -1

    @property
    def kind(self) -> tuple[int, int, bool, int]:
        """The hand, the robot, whether the arc is past an end, and the stay."""
        return self.hand, self.robot, self.is_past_end, self.stay


class WalkPoint(NamedTuple):
    """A point of a walk: the direction [rad] to it from each slot that it sees, the directions of walls that it touches.

    `robots` are the slots that the walking robot touches. `at_body` is true if it touches a robot that stands at no slot,
    `left_walls` if it does not follow the wall of the point before any more (`leaves_wall`). `unplaced` are the marks
    (`mark_of`) of robots without a known slot that see it. `at` is the robot's place [m] by odometry, in this frame.
    `was_seen` is true if a slot saw it that counts as if it had not, `is_bridged` if the wall goes on behind the robots there.
    """

    seen: Mapping[int, float]
    walls: tuple[float, ...]
    robots: tuple[int, ...]
    at_body: bool = False
    left_walls: bool = False
    unplaced: tuple[int, ...] = ()
    at: tuple[float, float] = (0.0, 0.0)
    was_seen: bool = False
    is_bridged: bool = False

    @property
    def is_blind(self) -> bool:
        """True if the walking robot touched nothing. It turns round a corner, or has lost the wall."""
        return not (self.walls or self.robots)

    @property
    def passes_robots(self) -> bool:
        """True if the walking robot touched robots, and no wall. Behind these may be free space."""
        return bool(self.robots) and not self.walls

    def turned(self, by: float) -> "WalkPoint":
        """Return the same point with all directions turned by an angle [rad]."""
        seen = {slot: each + by for slot, each in self.seen.items()}
        return self._replace(seen=seen, walls=tuple(each + by for each in self.walls), at=turned_vector(self.at, by))

    def unseen_by(self, slots: Collection[int]) -> "WalkPoint":
        """Return the same point as if these slots had not seen it: itself if they have not."""
        seen = {slot: there for slot, there in self.seen.items() if slot not in slots}
        return self if len(seen) == len(self.seen) else self._replace(seen=seen, was_seen=True)


class WallStep(NamedTuple):
    """A point of a walk, the point before it if the wall was followed since, and the hand at the wall.

    `witnesses` are the slots that saw the way between, where this slot did not. `number` counts the points of the walk.
    """

    before: WalkPoint | None
    point: WalkPoint
    hand: int
    witnesses: tuple[int, ...] = ()
    number: int = 0


class Origin(NamedTuple):
    """The slot that a walking robot left, and its place [m] by the robot's odometry, in the frame of the directions.

    It was its stay of this number. Another robot at the slot stands elsewhere, as far as is known, and so does this one later.
    """

    slot: int
    at: tuple[float, float]
    stay: int = -1


class Walk(NamedTuple):
    """A stretch of wall that a robot followed, in the frame of one robot; `hand` is +1 if the wall was on the left.

    `radius_m` is the radius of its body. `end` is the slot of the walking robot if it stands at the end of the walk. `origin`
    is the slot that it left, if all points are close to that. `stays` has the stays of the robots that it touched, by slot.
    """

    frame: int
    hand: int
    points: tuple[WalkPoint, ...]
    radius_m: float = 0.0
    end: int | None = None
    origin: Origin | None = None
    stays: Mapping[int, int] = MappingProxyType({})

    def turned(self, frame: int, by: float) -> "Walk":
        """Return the walk in another frame."""
        origin = None if self.origin is None else self.origin._replace(at=turned_vector(self.origin.at, by))
        return self._replace(frame=frame, points=tuple(each.turned(by) for each in self.points), origin=origin)

    def way_from_origin(self) -> Iterator[tuple[float, WalkPoint]]:
        """Yield the direction [rad] of each point from the origin by odometry, and the point."""
        if self.origin is not None:
            x_m, y_m = self.origin.at
            yield from ((math.atan2(each.at[1] - y_m, each.at[0] - x_m), each) for each in self.points)

    def unseen_by(self, slots: Collection[int]) -> "Walk":
        """Return the walk as if these slots had not seen it."""
        return self._replace(points=tuple(each.unseen_by(slots) for each in self.points))


def turned_vector(vector: tuple[float, float], by: float) -> tuple[float, float]:
    """Return a vector turned by an angle [rad]."""
    cos, sin = math.cos(by), math.sin(by)
    return cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]


def mark_of(node: int) -> int:
    """Return the number that stands for a robot among slots. It is no slot, and not NOWHERE."""
    return -2 - node


def tail(points: Sequence[WalkPoint], length_m: float) -> tuple[WalkPoint, ...]:
    """Return the last points of a walk, over a length [m]."""
    left, first = length_m, len(points)
    while first > 0 and left > 0.0:
        first -= 1
        left -= math.dist(points[first].at, points[first - 1].at) if first else 0.0
    return tuple(points[first:])


class TouchCounter:
    """Counts since which point of a walk the robot follows the wall. It may be out of touch for a few points at corners.

    It turns towards the wall meanwhile, and so enters each opening that its body fits through. A robot in touch is no wall:
    a walk around a robot in an opening leads past the opening. A dead body may fill an opening that nobody keeps. So where a
    body is in touch, the robot follows the wall only as long as the same wall stays in touch, too. A robot that drives away
    from the wall, because it has turned round in front of a robot, does not follow it any more: the next wall that it touches
    may be on the other side of a passage. Nor does one that turns into a passage, and touches its opposite wall first.
    """

    def __init__(self) -> None:
        self.since = 0
        self._blind = BLIND_MAX + 1
        self._walls: Collection[float] = ()
        self._at_body = False  # whether a body was in touch at the latest point with a wall, or after it

    def take(self, number: int, walls: Collection[float], at_body: bool = False, left_walls: bool = False) -> None:
        """Take in the directions [rad] of walls in touch at the point with this number.

        `at_body` and `left_walls` have the meaning of `WalkPoint`.
        """
        if left_walls:
            self._blind, self._walls = BLIND_MAX + 1, ()
        if not walls:
            self._at_body = self._at_body or at_body
            self._blind += 1
            if self._blind > BLIND_MAX:
                self.since = number + 1
            return
        stays = not self._blind and any(
            abs(math.remainder(a - b, math.tau)) < SAME_WALL_RAD for a in walls for b in self._walls
        )
        if self._blind > BLIND_MAX or ((self._at_body or at_body) and not stays):
            self.since = number
        self._blind, self._walls, self._at_body = 0, walls, at_body


def leaves_wall(hand: int, before: Collection[float], now: Collection[float], x_m: float, y_m: float) -> bool:
    """Return whether a robot with the wall at its `hand`, +1 left, -1 right, does not follow it any more on a step (x, y) [m].

    `before` and `now` are the directions [rad] of walls in touch before and after the step. The robot leaves the wall if it
    drives away from all walls before it, if it comes to the opposite wall in a single step, or if it turns round a corner and
    comes to a wall at its other side alone: the opposite one of a passage that begins at the corner.
    """
    if not LEAVING_M_MIN < math.hypot(x_m, y_m) < LEAVING_M_MAX:
        return False
    heading = math.atan2(y_m, x_m)
    if not before:
        return bool(now) and all(hand * math.remainder(each - heading, math.tau) < 0.0 for each in now)
    turns = [abs(math.remainder(a - b, math.tau)) for a in before for b in now]
    if turns and not SAME_WALL_RAD <= min(turns) <= OPPOSITE_RAD:
        return min(turns) > OPPOSITE_RAD
    sides = [hand * math.remainder(each - heading, math.tau) for each in before]
    return not any(-LEAVING_RAD < each < ROUNDING_RAD for each in sides)


def is_backward(before: WalkPoint, point: WalkPoint, hand: int) -> bool:
    """Return whether a step leads back along the wall in touch: a robot that has turned round has it at its other hand."""
    dx, dy = point.at[0] - before.at[0], point.at[1] - before.at[1]
    walls = (*before.walls, *point.walls)
    if not walls or math.hypot(dx, dy) < LEAVING_M_MIN:
        return False
    heading = math.atan2(dy, dx)
    sides = [-hand * math.remainder(each - heading, math.tau) for each in walls]
    return all(CONTACT_RAD < each < math.pi - CONTACT_RAD for each in sides)


class SeenPoint(NamedTuple):
    """A point of a walk that a slot saw, and its number in the walk."""

    number: int
    point: WalkPoint


def point_before(slot: int, last: SeenPoint | None, now: SeenPoint, touch_since: int, hidden: bool) -> WalkPoint | None:
    """Return the point with which a point of a walk closes an arc at a slot, or None.

    `last` is the latest point with a contact that the slot saw before. The robot must have followed the wall since that
    point: it does since the point with the number `touch_since`. With `hidden` the slot has lost it meanwhile, behind a
    corner. Then other robots saw the way between, and are responsible for the space beside it.
    """
    if last is None or last.number < touch_since:
        return None
    apart = abs(math.remainder(now.point.seen[slot] - last.point.seen[slot], math.tau))
    return last.point if not hidden or apart <= HIDDEN_RAD else None


def arcs_of_walls(directions: Iterable[float], half_rad: float = TOUCH_RAD) -> list[Arc]:
    """Return the arcs that walls in touch close, `half_rad` on both sides of their directions [rad]."""
    return [Arc(each - half_rad, 2.0 * half_rad) for each in directions]


def arcs_of_step(slot: int, before: WalkPoint | None, point: WalkPoint, hand: int) -> Iterator[Arc]:
    """Yield the arcs at a slot that end at the walls in touch at a point of a walk and since `before`, the point before it."""
    there = point.seen[slot]
    if before is not None and slot in before.seen and not (before.passes_robots or point.passes_robots):
        step = math.remainder(there - before.seen[slot], math.tau)
        # The slot and the wall are on different sides of the step, by the odometry, too: a bearing has more noise than a step.
        if step * hand < 0.0 and _passes_by(before, point, there) * hand <= 0.0:
            yield arc_between(before.seen[slot], there)
    if slot in point.robots and point.walls:
        off = min((math.remainder(each - there, math.tau) for each in point.walls), key=abs)
        yield arc_between(there, there + math.copysign(min(abs(off), POCKET_RAD), off))


def _passes_by(before: WalkPoint, point: WalkPoint, there: float) -> float:
    """Return the sign, times a length, of the left turn by which a step is seen in a direction [rad], by the odometry."""
    x_m, y_m = point.at[0] - before.at[0], point.at[1] - before.at[1]
    return y_m * math.cos(there) - x_m * math.sin(there)


def arc_between(a_rad: float, b_rad: float) -> Arc:
    """Return the smaller arc between two directions [rad]."""
    off = math.remainder(b_rad - a_rad, math.tau)
    return Arc(a_rad, off) if off >= 0.0 else Arc(b_rad, -off)


def united(arcs: Iterable[Arc]) -> list[Arc]:
    """Return disjoint arcs that contain the same directions. Arcs that are apart by less than a hair become one."""
    found: list[Arc] = []
    for start, width in sorted((each.start_rad % math.tau, each.width_rad) for each in arcs):
        if found and start <= found[-1].start_rad + found[-1].width_rad + HAIR_RAD:
            first = found[-1].start_rad
            found[-1] = Arc(first, min(math.tau, max(found[-1].width_rad, start + width - first)))
        else:
            found.append(Arc(start, width))
    return found


def arcs_into(crossings: Collection[Crossing]) -> list[Arc]:
    """Return the arcs of directions that cross the way into the strip more often than out of it: they end at the wall."""
    bounds: dict[float, int] = {}
    wrapped = 0
    for (start, width), into in crossings:
        first = start % math.tau
        last = first + width
        bounds[first] = bounds.get(first, 0) + into
        if last >= math.tau:
            last -= math.tau
            wrapped += into
        bounds[last] = bounds.get(last, 0) - into
    found = list[Arc]()
    order = sorted(bounds)
    for first, last in zip(order, [*order[1:], *(each + math.tau for each in order[:1])], strict=True):
        wrapped += bounds[first]
        if wrapped > 0:
            found.append(Arc(first, last - first))
    return found


def contains(arcs: Iterable[Arc], arc: Arc) -> bool:
    """Return whether one of these arcs contains an arc."""
    return any((arc.start_rad - each.start_rad) % math.tau + arc.width_rad <= each.width_rad for each in arcs)


def shared_arcs(a: Arc, b: Arc) -> list[Arc]:
    """Return the arcs of the directions that two arcs share."""
    off = (b.start_rad - a.start_rad) % math.tau
    first, again = min(a.width_rad - off, b.width_rad), min(off + b.width_rad - math.tau, a.width_rad)
    return [Arc(start, width) for start, width in ((b.start_rad, first), (a.start_rad, again)) if width > 0.0]


def overlap(a: Arc, b: Arc) -> float:
    """Return the size [rad] of the directions that two arcs share."""
    return added(each.width_rad for each in shared_arcs(a, b))


def complement(arcs: Iterable[Arc]) -> list[Arc]:
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


def ends_at(arcs: Iterable[Arc], there: float, side: int) -> bool:
    """Return whether one of these arcs contains the directions on one side of a direction [rad]."""
    return any((there + side * BESIDE_RAD - start) % math.tau < width for start, width in arcs)
