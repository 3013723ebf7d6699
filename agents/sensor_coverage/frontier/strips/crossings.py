"""Directions of slots that end at followed walls: they cross the way of the walking robot into the strip beside the wall.

The strip lies between the way and the wall. A direction ends at the wall if its ray goes into the strip once more often
than out of it. It goes in across a step of the walk with the wall beyond, and out across a step that the slot sees from
the side of the wall: behind a corner, or where the noise of bearings makes a step seem to lead back. So a stretch that a
slot sees from end to end closes what lies between its ends, and noise in between adds nothing. At an end of the stretch the
strip is open: see `loose_ends`. A slot whose robot the walking robot touched there also sees into the strip across this
end: the pocket.
"""

import math
from collections.abc import Collection, Iterable, Iterator
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import StretchEnd, direction_of, kept_part
from zwerm.agents.sensor_coverage.frontier.strips.stretches import Pocket
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, WalkPoint, arc_between
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit

# A pocket closes this part of a body's radius beyond the touched point: two of them on both sides of a robot, with an error
# of a quarter of a radius each by the width of a switch, are narrower than an opening of 1.3 bodies.
OVERHANG: Final = 1.0


class Crossing(NamedTuple):
    """Directions of a slot that cross a piece of the way of a walking robot: into the strip beside the wall (+1), or out of it.

    The strip lies between the way and the wall.
    """

    arc: Arc
    into: int


def crossings_of_step(
    slot: int, before: WalkPoint | None, point: WalkPoint, hand: int, ends: Iterable[StretchEnd] = ()
) -> Iterator[Crossing]:
    """Yield the directions of a slot that cross a step of a walk, without those that leave the strip at an end of it."""
    if before is None or slot not in before.seen or before.passes_robots or point.passes_robots:
        return
    start = before.seen[slot]
    step = math.remainder(point.seen[slot] - start, math.tau)
    if step * hand < 0.0:  # the slot and the wall are on different sides of the step
        low, high = kept_part(before.at, point.at, start, step, ends)
        if low < high:
            yield Crossing(arc_between(start + low * step, start + high * step), 1)
    else:
        yield Crossing(arc_between(start, start + step), -1)


def crossing_of_pocket(slot: int, point: WalkPoint, hand: int, pocket: Pocket) -> Crossing:
    """Return the directions of a slot that cross the line from a walking robot in touch with it to the wall that it touches."""
    there = point.seen[slot]
    to_wall = math.remainder(direction_of(_beside(point, slot, pocket), pocket.end.touched) - there, math.tau)
    step = to_wall if pocket.is_last else -to_wall
    return Crossing(arc_between(there, there + to_wall), 1 if step * hand < 0.0 else -1)


def _beside(point: WalkPoint, slot: int, pocket: Pocket) -> Vector:
    """Return the place of a robot in touch with the walking robot."""
    ux, uy = unit(point.seen[slot])
    return point.at[0] - 2.0 * pocket.radius_m * ux, point.at[1] - 2.0 * pocket.radius_m * uy


def arc_beyond_pocket(slot: int, point: WalkPoint, pocket: Pocket) -> Arc:
    """Return the arc at a slot beyond a wall that a robot in touch with the slot touches, towards the slot."""
    at, touched = _beside(point, slot, pocket), pocket.end.touched
    wall = direction_of(point.at, touched)
    along = wall + math.copysign(math.pi / 2.0, math.remainder(point.seen[slot] + math.pi - wall, math.tau))
    ux, uy = unit(along)
    beyond = touched[0] + OVERHANG * pocket.radius_m * ux, touched[1] + OVERHANG * pocket.radius_m * uy
    return arc_between(direction_of(at, touched), direction_of(at, beyond))


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
