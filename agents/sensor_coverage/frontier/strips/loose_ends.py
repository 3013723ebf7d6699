"""The ends of a stretch of wall that a robot followed: directions in which a slot looks past them, between robot and wall.

A step of a walk closes the directions in which a slot sees it, because the wall is beyond. A slot that looks along the wall
sees past the last step, between the walking robot and the point of the wall that it touched: there the wall may end, and an
opening begin. So a direction counts only if its ray from the step does not leave the strip between the walk and the wall at
an end of the stretch. Nor may it pass the end at the other side of the walking robot, within a radius of its body: then the
step leads along the ray, and only the noise of bearings makes the ray seem to enter the strip.

An end is tied where another robot is responsible for the space beyond: the walking robot touched a standing robot there, or
stands there itself. It is loose when this robot is gone.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from typing import Final, NamedTuple

Vector = tuple[float, float]

# Bisections of a step.
HALVINGS: Final = 12
# Distance from the ends of a step at which it is tested, as a fraction of its length.
INWARD: Final = 1e-3
# Near the slot a step has many directions, and an end may be within them: they are tested this far apart [rad].
WITHIN_RAD: Final = math.radians(5.0)

# An opening narrower than 1.3 diameters of a body need not be found. Two touched points, each known within half a switch, are
# so far apart at least, in diameters, if there is a wider one between them.
SHUT: Final = 1.3 - math.sin(math.radians(15.0))


class StretchEnd(NamedTuple):
    """The walking robot's place [m] at an end of a stretch, the point of the wall that it touched, and the slots of `ties`.

    Any slot of `ties` ties the end as long as it is occupied. `seen` are the slots that saw the walking robot there. Only
    they are responsible for what lies behind the end.
    """

    at: Vector
    touched: Vector
    ties: tuple[int, ...] = ()
    seen: tuple[int, ...] = ()

    def is_tied(self, standing: Collection[int]) -> bool:
        """Return whether a standing robot is responsible for the space beyond."""
        return any(each in standing for each in self.ties)


class Pocket(NamedTuple):
    """An end of a stretch beside a standing robot at a place [m], the other end, and a body's radius [m].

    `is_last` is true for the last point of the stretch. The walking robot touched the standing robot there if it is `in_touch`,
    else a few points away, without a wall in touch. `before` is the last end of the stretch before. `end_rad` is the direction
    [rad] in which the standing robot saw the walking one at the end, if it did. `stay` is the number of the standing robot's
    stay, if it is known: in another one a robot at the slot stands elsewhere, and may touch other walls.
    """

    end: StretchEnd
    other: StretchEnd
    radius_m: float
    is_last: bool
    place: Vector
    in_touch: bool
    before: StretchEnd | None = None
    end_rad: float | None = None
    stay: int = -1


class FollowedStretch(NamedTuple):
    """A stretch of wall: the numbers of its first and last points of a walk, its ends, and the radius of a body [m]."""

    first_number: int
    last_number: int
    first: StretchEnd
    last: StretchEnd
    radius_m: float

    def tied_at_end(self, slot: int) -> "FollowedStretch":
        """Return the same stretch with one more slot that ties its last end."""
        return self._replace(last=self.last._replace(ties=tuple(dict.fromkeys((*self.last.ties, slot)))))


def direction_of(a: Vector, b: Vector) -> float:
    """Return the direction [rad] from a to b."""
    return math.atan2(b[1] - a[1], b[0] - a[0])


def touched_point(at: Vector, bearing_rad: float, radius_m: float) -> Vector:
    """Return the point [m] of a wall that a body at a place touches in a direction."""
    return at[0] + radius_m * math.cos(bearing_rad), at[1] + radius_m * math.sin(bearing_rad)


def place_of_robot(at: Vector, there_rad: float, radius_m: float) -> Vector:
    """Return the place [m] of a robot in touch with one at a place, which it sees in a direction [rad]."""
    return at[0] - 2.0 * radius_m * math.cos(there_rad), at[1] - 2.0 * radius_m * math.sin(there_rad)


def is_shut(a: Vector, b: Vector, radius_m: float) -> bool:
    """Return whether no opening fits between two touched points [m]."""
    return math.dist(a, b) < 2.0 * SHUT * radius_m


# A place [m] of the walking robot, and the directions of walls that it touches there.
Contact = tuple[Vector, Sequence[float]]


def ends_of_stretch(contacts: Sequence[Contact], hand: int, radius_m: float) -> tuple[StretchEnd, StretchEnd]:
    """Return the two ends of a stretch of wall that a robot followed with the wall at its `hand`."""
    return end_of_stretch(contacts, hand, radius_m, False), end_of_stretch(contacts, hand, radius_m, True)


def end_of_stretch(contacts: Sequence[Contact], hand: int, radius_m: float, ahead: bool) -> StretchEnd:
    """Return the end of a stretch: its last place if `ahead`, else its first one. Two contacts beside it are enough."""
    at, walls = contacts[-1 if ahead else 0]
    heading = walls[0] - hand * math.pi / 2.0
    if len(contacts) > 1:
        (ax, ay), (bx, by) = (each for each, _ in (contacts[-2:] if ahead else contacts[:2]))
        heading = math.atan2(by - ay, bx - ax)
    # The robot has the wall at its side, and in a corner comes to the wall ahead after that.
    sides = {each: hand * math.remainder(each - heading, math.tau) for each in walls}
    bearing = (min if ahead else max)(sides, key=lambda each: sides[each])
    return StretchEnd(at, touched_point(at, bearing, radius_m))


def kept_part(
    start: Vector, end: Vector, there_rad: float, step_rad: float, ends: Iterable[StretchEnd]
) -> tuple[float, float]:
    """Return the first and the last fraction of a step in whose directions a slot does not see past an end.

    The step leads from `start` to `end` [m]. The slot sees them in the directions `there_rad` and `there_rad + step_rad`.
    """
    low, high = 0.0, 1.0

    def leaks(part: float, line: tuple[Vector, Vector]) -> bool:
        part = min(max(part, INWARD), 1.0 - INWARD)
        at = start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])
        return _crosses(at, there_rad + part * step_rad, *line)

    def edge_of(inside: float, outside: float, line: tuple[Vector, Vector]) -> float:
        for _ in range(HALVINGS):
            middle = (inside + outside) / 2.0
            inside, outside = (inside, middle) if leaks(middle, line) else (middle, outside)
        return inside

    between = range(1, math.ceil(abs(step_rad) / WITHIN_RAD))
    for each in map(_across, ends):
        first, last = leaks(low, each), leaks(high, each)
        if first and last:
            return 0.0, 0.0
        if first or last:
            low, high = (edge_of(high, low, each), high) if first else (low, edge_of(low, high, each))
            continue
        within = (low + (high - low) * number / (len(between) + 1) for number in between)
        part = next((part for part in within if leaks(part, each)), None)
        if part is not None:  # keep the larger part beside the end
            before, after = edge_of(low, part, each), edge_of(high, part, each)
            low, high = (low, before) if before - low > high - after else (after, high)
    return low, high


def _across(end: StretchEnd) -> tuple[Vector, Vector]:
    """Return the ends of the line across the walking robot's body at an end of a stretch: the last one is the touched point."""
    (x, y), (wall_x, wall_y) = end.at, end.touched
    return (2.0 * x - wall_x, 2.0 * y - wall_y), end.touched


def _crosses(at: Vector, direction_rad: float, a: Vector, b: Vector) -> bool:
    """Return whether a ray from a point crosses the line between two others."""
    direction = math.cos(direction_rad), math.sin(direction_rad)
    ax, ay, bx, by = a[0] - at[0], a[1] - at[1], b[0] - at[0], b[1] - at[1]
    left, right = direction[0] * ay - direction[1] * ax, direction[0] * by - direction[1] * bx
    if left * right >= 0.0:
        return False
    part = left / (left - right)
    return (ax + part * (bx - ax)) * direction[0] + (ay + part * (by - ay)) * direction[1] > 0.0
