"""The points of a walk along a wall that each slot saw."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.frontier.strips.bridges import TouchedBy, bridged
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import FollowedStretch, Pocket, StretchEnd, touched_point
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import (
    SightEnd,
    dark_ends_at,
    sight_ends_at,
)
from zwerm.agents.sensor_coverage.frontier.strips.stretches import pockets_beside, stretches_of
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    BESIDE_EDGE_RAD,
    SAME_WALL_RAD,
    Arc,
    SeenPoint,
    TouchCounter,
    Walk,
    WalkPoint,
    arc_between,
    point_before,
)

# A slot sees two walls beside each other if their directions differ by more than this [rad].
ASIDE_RAD: Final = math.radians(15.0)


class LeftWall(NamedTuple):
    """A place at which a walking robot left a wall, and came to another one: the slots of the robots that stood there.

    The slots `aside` saw the two walls beside each other. What is open there lies in their arcs between the two.
    """

    robots: tuple[int, ...]
    aside: tuple[tuple[int, Arc], ...] = ()

    def end_at(self, slot: int, there: float) -> Iterator[SightEnd]:
        """Yield the edge of sight of a slot that saw a wall in a direction [rad], and not the other one beside it."""
        if all(each != slot for each, _ in self.aside):
            yield SightEnd(there, self.robots, aside=self.aside)


class Passed(NamedTuple):
    """A point of a walk that a slot saw, the point before it if that closes an arc, and the hand at the wall.

    `number` counts the points of all walks. The slot did not see the points between these two. Each of them was seen by
    other slots. `stretch` is the number of the first point of the stretch of wall, and `ends` are the ends of the wall from the
    point before to this one. `pockets` are set if the walking robot touched the slot's robot beside an end, each with the
    number of the first point of its stretch. `sight_ends` are set where the slot did not see the next point. `dark_ends` are
    the same with the origin of the walk among the slots that saw it, and those where the robot left the wall at a body.
    `ties` are the slots that tie an end of the stretch at this point.
    """

    number: int
    before: WalkPoint | None
    point: WalkPoint
    hand: int
    between: tuple[Collection[int], ...]
    stretch: int = -1
    ends: tuple[StretchEnd, ...] = ()
    pockets: tuple[tuple[int, Pocket], ...] = ()
    sight_ends: tuple[SightEnd, ...] = ()
    dark_ends: tuple[SightEnd, ...] = ()
    ties: tuple[int, ...] = ()

    def goes_on(self, standing: Collection[int]) -> bool:
        """Return whether the walk went on to a robot at a slot, or out of sight, and one of these slots answers for that."""
        return any(each in standing for each in self.ties) or any(each.is_seen(standing) for each in self.sight_ends)


def all_passes(walk: Walk, first: int, touched_by: TouchedBy) -> Iterator[tuple[int, Passed]]:
    """Yield what `passes` does, where walls go on behind robots that touch them (`bridges`); `touched_by` has their contacts.

    These robots themselves see the wall on both sides.
    """
    whole, robots = bridged(walk, touched_by)
    yield from (each for each in passes(whole, first) if each[0] not in robots)
    if robots:
        yield from (each for each in passes(walk, first) if each[0] in robots)


def passes(walk: Walk, first: int) -> Iterator[tuple[int, Passed]]:
    """Yield each slot that saw a point of a walk with a contact, and that point; `first` is the number of the first point.

    Points without a contact close nothing: whether the robot turns round a corner is known when it is in touch again.
    """
    last: dict[int, SeenPoint] = {}
    touch = TouchCounter()
    stretch_of = stretches_of(walk)
    stretches = list({each.first_number: each for each in stretch_of.values()}.values())
    at_bodies = left_at_bodies(walk.points, stretch_of, walk.radius_m)
    # No other slot relies on what the origin saw: that counts while its robot stands there.
    others = walk.points if walk.origin is None else [each.unseen_by((walk.origin.slot,)) for each in walk.points]
    for number, point in enumerate(walk.points):
        if not point.is_bridged:
            touch.take(number, point.walls, point.at_body, point.left_walls)
        if point.is_blind:
            continue
        now = SeenPoint(number, point)
        here = stretch_of.get(number)
        for slot in point.seen:
            number_of = -1 if here is None else first + here.first_number
            if walk.origin is not None and slot == walk.origin.slot:  # it knows more of its own way: see `near_arcs`
                yield slot, Passed(first + number, None, point, walk.hand, (), number_of)
                continue
            since = last[slot].number if slot in last else number
            between = tuple(each.seen.keys() for each in others[since:number] if slot not in each.seen)
            before_it = None if point.is_bridged else last.get(slot)
            before = point_before(slot, before_it, now, touch.since, bool(between))
            there = stretch_of.get(since) if before is not None else None
            ends = () if here is None or there is None else (there.first, here.last)
            beside = pockets_beside(slot, number, walk.points, stretches, walk.hand) if slot in point.robots else ()
            stay = walk.stays.get(slot, -1)
            pockets = tuple((first + first_number, each._replace(stay=stay)) for first_number, each in beside)
            between = between if before is not None else ()
            edges = tuple(sight_ends_at(slot, number, others, walk.end))
            dark = tuple(dark_ends_at(slot, number, walk.points))
            dark = (*dark, *(end for each in at_bodies.get(number, ()) for end in each.end_at(slot, point.seen[slot])))
            ties = () if here is None else _ties_at(number, here)
            yield (
                slot,
                Passed(first + number, before, point, walk.hand, between, number_of, ends, pockets, edges, dark, ties),
            )
            if not point.is_bridged:
                last[slot] = now


def still_counting(
    slot: int, passed: Sequence[Passed], gone: AbstractSet[int], standing: Collection[int]
) -> Sequence[Passed]:
    """Return the points that a slot saw of walks, without those that slots saw which are `gone`.

    Where a stretch of wall goes on as one of these saw it, nobody knows what is beyond. An edge of sight is there, until
    a later walk went on there in sight of a `standing` slot, or to its robot.
    """
    if not gone:
        return passed
    found, edges = list[Passed](), list[tuple[int, float]]()  # the number in `found`, and the direction
    stretch, lost = -1, False  # of the point before
    begin: float | None = None  # its direction, if it counts, but not what was followed up to it
    for each in passed:
        counts = gone.isdisjoint(each.point.seen)
        goes_on, there = each.stretch == stretch >= 0, each.point.seen[slot]
        if counts and (each.before is None or gone.isdisjoint(each.before.seen)):
            if goes_on and lost:
                edges.append((len(found), there if begin is None else begin))
            found.append(each)
            lost = False
        else:
            if goes_on and not lost:
                edges.append((len(found) - 1, found[-1].point.seen[slot]))
            begin, lost = there if counts else None, True
        stretch = each.stretch
    onward = [number for number, each in enumerate(found) if each.goes_on(standing)] if edges else []
    for number, there in edges:
        later = (found[each].point.seen[slot] for each in onward if found[each].stretch > found[number].stretch)
        if all(angle_between(each, there) > BESIDE_EDGE_RAD for each in later):
            found[number] = _with_end(found[number], there)
    return found


def _with_end(passed: Passed, there: float) -> Passed:
    """Return a point of a walk with an edge of sight in a direction [rad]: nobody is known to have seen what is beyond."""
    end = SightEnd(there, ())
    return passed._replace(sight_ends=(*passed.sight_ends, end), dark_ends=(*passed.dark_ends, end))


def _ties_at(number: int, stretch: FollowedStretch) -> tuple[int, ...]:
    """Return the slots that tie an end of a stretch at the point with this number of its walk."""
    first = stretch.first.ties if number == stretch.first_number else ()
    last = stretch.last.ties if number == stretch.last_number else ()
    return (*first, *last)


def left_at_bodies(
    points: Sequence[WalkPoint], stretch_of: Mapping[int, FollowedStretch], radius_m: float
) -> dict[int, tuple[LeftWall, ...]]:
    """Return the numbers of the points of a walk between which the robot left a wall at a body, and came to another one.

    Between them may be an opening that the body fills. A slot that looks along it sees both walls in one direction. Each
    robot that stood there at a slot answers for it, alone; nobody does so for a body. A body that a robot pushes on fills
    no opening between two points that are closer than its diameter: 2 `radius_m` [m].
    """
    touch, found = TouchCounter(), dict[int, tuple[LeftWall, ...]]()
    latest, at_body, robots = -1, False, dict[int, None]()
    for number, point in enumerate(points):
        if point.is_bridged:
            continue
        touch.take(number, point.walls, point.at_body, point.left_walls)
        at_body, robots = at_body or point.at_body, robots | dict.fromkeys(point.robots)
        if point.walls:
            if latest >= 0 and not (at_body and _is_again(points[latest], point, radius_m)):
                other_wall = stretch_of.get(latest) is None or stretch_of.get(latest) is not stretch_of.get(number)
                answers = ((),) if at_body and touch.since > latest else tuple((each,) for each in robots if other_wall)
                aside = tuple(_seen_aside(points[latest], point))
                for each in (latest, number) if answers else ():
                    found[each] = found.get(each, ()) + tuple(LeftWall(robot, aside) for robot in answers)
            latest, at_body, robots = number, point.at_body, dict.fromkeys(point.robots)
    return found


def _is_again(before: WalkPoint, point: WalkPoint, radius_m: float) -> bool:
    """Return whether a body in touch with a wall at two points touches it at almost the same place."""
    return any(
        angle_between(a, b) < SAME_WALL_RAD
        and math.dist(touched_point(before.at, a, radius_m), touched_point(point.at, b, radius_m)) < 2.0 * radius_m
        for a in before.walls
        for b in point.walls
    )


def _seen_aside(before: WalkPoint, point: WalkPoint) -> Iterator[tuple[int, Arc]]:
    """Yield the slots that saw two points of a walk beside each other, and their arcs between the two."""
    for slot, there in before.seen.items():
        if slot in point.seen and angle_between(there, point.seen[slot]) > ASIDE_RAD:
            yield slot, arc_between(there, point.seen[slot])
