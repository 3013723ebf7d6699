"""Directions of slots that end at followed walls: they cross the way of the walking robot into the strip beside the wall.

The strip lies between the way and the wall. A direction ends at the wall if its ray goes into the strip once more often
than out of it. It goes in across a step of the walk with the wall beyond, and out across a step that the slot sees from
the side of the wall: behind a corner, or where the noise of bearings makes a step seem to lead back. So a stretch that a
slot sees from end to end closes what lies between its ends, and noise in between adds nothing. At an end of the stretch the
strip is open: see `loose_ends`. A slot whose robot the walking robot touched there also sees into the strip across this
end: the pocket.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Final

from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import (
    Pocket,
    StretchEnd,
    Vector,
    direction_of,
    is_shut,
    kept_part,
    touched_point,
)
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    CONTACT_RAD,
    Arc,
    Crossing,
    WalkPoint,
    arc_between,
    is_backward,
    shared_arcs,
)
from zwerm.agents.sensor_coverage.motion.homing import unit

# A pocket closes this part of a body's radius beyond the touched point: two of them on both sides of a robot, with an error
# of a quarter of a radius each by the width of a switch, are narrower than an opening of 1.3 bodies.
OVERHANG: Final = 1.0
# A bearing's error [rad]: twice its noise.
BEARING_RAD: Final = math.radians(5.0)


def crossings_of_step(
    slot: int, before: WalkPoint | None, point: WalkPoint, hand: int, ends: Iterable[StretchEnd] = ()
) -> Iterator[Crossing]:
    """Yield the directions of a slot that cross a step of a walk, without those that leave the strip at an end of it."""
    if before is None or slot not in before.seen or before.passes_robots or point.passes_robots:
        return
    start = before.seen[slot]
    step = math.remainder(point.seen[slot] - start, math.tau)
    beyond = step * hand < 0.0  # the slot and the wall are on different sides of the step
    if is_backward(before, point, hand):
        if beyond:  # they are on the same side
            yield Crossing(arc_between(start, start + step), -1)
    elif beyond:
        low, high = kept_part(before.at, point.at, start, step, ends)
        if low < high:
            yield Crossing(arc_between(start + low * step, start + high * step), 1)
    else:
        yield Crossing(arc_between(start, start + step), -1)


def crossings_of_pocket(hand: int, pocket: Pocket, other_is_loose: bool) -> Iterator[Crossing]:
    """Yield the directions of a slot that cross the line from a walking robot beside it to the wall that it touched.

    Where the slot looks into the strip there, some directions leave it at the other end of the stretch, if that is loose.
    The line begins in the direction in which the first or last step does: with another one, of odometry, noise between the
    two would count as wall.
    """
    place, end, other = pocket.place, pocket.end, pocket.other
    there = direction_of(place, end.at) if pocket.end_rad is None else pocket.end_rad
    to_wall = math.remainder(direction_of(place, end.touched) - there, math.tau)
    step = to_wall if pocket.is_last else -to_wall
    arc = arc_between(there, there + to_wall)
    yield Crossing(arc, 1 if step * hand < 0.0 else -1)
    if step * hand < 0.0 and other_is_loose:
        past = arc_between(direction_of(place, other.at), direction_of(place, other.touched))
        for shared in shared_arcs(arc, past):
            yield Crossing(shared, -1)


def arcs_beside_pocket(hand: int, pocket: Pocket, contacts: Iterable[float]) -> Iterator[Arc]:
    """Yield the arcs at a slot that are closed beside a pocket; its robot touches walls in the directions `contacts` [rad].

    No opening fits between a wall that the walking robot touched and a robot in touch with it, in front of the wall, nor
    between touched points that are close to each other.
    """
    place, touched, radius_m = pocket.place, pocket.end.touched, pocket.radius_m
    if pocket.in_touch and next(crossings_of_pocket(hand, pocket, False)).into > 0:
        wall = direction_of(pocket.end.at, touched)
        side = math.remainder(direction_of(pocket.end.at, place) - wall, math.tau)
        ux, uy = unit(wall + math.copysign(math.pi / 2.0, side))
        beyond = touched[0] + OVERHANG * radius_m * ux, touched[1] + OVERHANG * radius_m * uy
        if _is_in_front(pocket):
            yield arc_between(direction_of(place, touched), direction_of(place, beyond))
        for each in contacts:
            if not _are_at_corners(pocket, wall, each):
                yield from _arc_between_walls(pocket, touched_point(place, each, radius_m))
    if pocket.before is not None:
        yield from _arc_between_walls(pocket, pocket.before.touched)


def _is_in_front(pocket: Pocket) -> bool:
    """Return whether the slot's robot stands in front of the touched wall, as the walking robot does, and not past its end.

    A robot beside the end of a wall, in a bend for example, sees nothing of the wall: it looks past the end into the space
    from which the walking robot came.
    """
    (x, y), (at_x, at_y), (wall_x, wall_y) = pocket.place, pocket.end.at, pocket.end.touched
    return (x - wall_x) * (at_x - wall_x) + (y - wall_y) * (at_y - wall_y) > 0.0


def _are_at_corners(pocket: Pocket, wall_rad: float, contact_rad: float) -> bool:
    """Return whether the two robots touch walls in one direction [rad], but not one wall: they stand before two corners.

    Robots in touch with one wall and each other stand along it. A switch is 30 degrees wide.
    """
    if abs(math.remainder(wall_rad - contact_rad, math.tau)) > CONTACT_RAD:
        return False
    along_rad = direction_of(pocket.place, pocket.end.at)
    return abs(math.cos(along_rad - wall_rad)) > math.sin(CONTACT_RAD + BEARING_RAD)


def _arc_between_walls(pocket: Pocket, other: Vector) -> Iterator[Arc]:
    """Yield the arc from the touched wall of a pocket to another touched point [m], if no opening fits in between.

    The slot's robot does not stand between the two.
    """
    arc = arc_between(direction_of(pocket.place, pocket.end.touched), direction_of(pocket.place, other))
    if is_shut(pocket.end.touched, other, pocket.radius_m) and arc.width_rad <= math.pi / 2.0:
        yield arc
