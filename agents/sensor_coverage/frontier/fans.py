"""Triangles of two slots and a point of a walk, in which the two slots see the point and each other."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Final

from zwerm.agents.sensor_coverage.frontier.wall_proof import WalkPoint

# A triangle is flat from an angle of 180 degrees less this [rad] on: three times the noise of a bearing, 2.5 degrees.
FLAT_RAD: Final = math.radians(8.0)
# A point is inside a triangle of robots if it is this far [rad] from its sides: twice the noise of a bearing.
INSIDE_RAD: Final = math.radians(5.0)

Pair = tuple[int, int]
# By slot and side of a point (+1 left, -1 right): whether the directions beyond the line of sight to the point are closed.
Beyond = Mapping[tuple[int, int], bool]


def pair_of(slot: int, other: int) -> Pair:
    """Return the two slots, the lower number first."""
    return (slot, other) if slot < other else (other, slot)


def fan_of(
    point: WalkPoint,
    views: Mapping[int, Mapping[int, float]],
    neighbours: Mapping[int, Collection[int]],
    at_walls: Beyond,
    without: Collection[Pair] = (),
    is_hidden: Callable[[Pair], bool] | None = None,
) -> tuple[Pair, ...]:
    """Return (slot, other slot) for each triangle with a point that counts at the slot: the space beyond it is proved at both.

    Beyond the line of sight from a slot to the point there must be a wall that was followed (`at_walls`), or another such
    triangle with the same point, or a triangle of robots that contains the point. A wall in touch with a slot counts here
    in the direction of the contact only: two robots may touch the ends of walls on both sides of a door. A triangle in
    `without` does not count at its first slot, nor does one that `is_hidden`. Without these all count at both. A flat
    triangle that may lie on either side of its middle slot does not count there. Where bearings have noise, the two slots may
    see a triangle on different sides of its side between them. Then the space beyond must be proved on both sides at the slot
    with the flatter angle.
    """
    seen = [slot for slot in point.seen if slot in neighbours]
    pairs = [(a, b) for a in seen for b in seen if b in neighbours[a] and (a, b) not in without]
    if not pairs:
        return ()
    closed = {(slot, side): at_walls.get((slot, side), False) for slot in seen for side in (1, -1)}
    for slot in seen:
        if not (closed[slot, 1] and closed[slot, -1]) and _is_inside(slot, point, seen, views, neighbours):
            closed[slot, 1] = closed[slot, -1] = True
    sides = {(a, b): side_of(point, a, views[a][b]) for pair in pairs for a, b in (pair, pair[::-1])}
    unsure = {
        min((a, b), (b, a), key=lambda each: _sine(point, each[0], views[each[0]][each[1]]))
        for a, b in pairs
        if sides[a, b] == sides[b, a]
    }
    wanted = {pair: (1, -1) if pair in unsure else (-side,) for pair, side in sides.items()}
    while True:
        beyond = {(a, sides[a, b]) for a, b in pairs if (a, b) not in unsure}
        kept = [
            pair
            for pair in pairs
            if all(closed[a, side] or (a, side) in beyond for a, b in (pair, pair[::-1]) for side in wanted[a, b])
        ]
        if len(kept) == len(pairs):
            # A triangle that is flat at a slot may by noise be on the other side of it. And the other slot looks along its
            # sides into the space beyond, and may not see an opening there.
            found = tuple((a, b) for a, b in kept if not _is_flat(point, a, views[a][b]))
            hidden = () if is_hidden is None else dict.fromkeys(each for each in found if is_hidden(each))
            if not hidden:
                return found
            kept, is_hidden = [each for each in kept if each not in hidden], None  # the others were judged
        pairs = kept


def side_of(point: WalkPoint, slot: int, direction: float) -> int:
    """Return +1 if a direction [rad] from a slot is to the left of a point, else -1."""
    return 1 if math.remainder(direction - point.seen[slot], math.tau) > 0.0 else -1


def _sine(point: WalkPoint, slot: int, direction: float) -> float:
    """Return the sine of the angle at a slot between a point and a direction [rad]."""
    return abs(math.sin(direction - point.seen[slot]))


def _is_flat(point: WalkPoint, slot: int, direction: float) -> bool:
    """Return whether a point and a direction [rad] are nearly opposite from a slot."""
    return abs(math.remainder(direction - point.seen[slot], math.tau)) > math.pi - FLAT_RAD


def _is_inside(
    slot: int,
    point: WalkPoint,
    seen: Iterable[int],
    views: Mapping[int, Mapping[int, float]],
    neighbours: Mapping[int, Collection[int]],
) -> bool:
    """Return whether a triangle of this slot and two others contains a point. One of these sees the point."""
    return any(
        is_between(point.seen[slot], views[slot][a], views[slot][b], INSIDE_RAD)
        and is_between(point.seen[a], views[a][slot], views[a][b], INSIDE_RAD)
        for a in seen
        if a in neighbours[slot]
        for b in neighbours[slot]
        if b in neighbours[a]
    )


def is_between(there: float, a: float, b: float, margin_rad: float = 0.0) -> bool:
    """Return whether a direction [rad] lies within the smaller angle between two others, farther from both than a margin."""
    left = math.remainder(a - there, math.tau)
    if abs(left) <= margin_rad:
        return False
    right = math.remainder(b - there, math.tau)
    return left * right < 0.0 and abs(left) + abs(right) < math.pi and abs(right) > margin_rad
