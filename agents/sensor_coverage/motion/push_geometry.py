"""Geometry of a push that the coordinator and the decentralised robots share. Section III-B of Ramaithitima et al. 2015."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.messages.commands import Landmark
from zwerm.agents.sensor_coverage.messages.pushes import SlotMemory

# Bearings [rad] that the first robot of a station tries, in its own frame.
FIRST_BEARINGS_RAD: Final = (0.0, math.pi / 2.0, -math.pi / 2.0, math.pi)
# A robot that leaves a station does without the station as a landmark if it has more static landmarks than this.
STATIC_LANDMARKS_MIN: Final = 2


class SlotReference(NamedTuple):
    """A slot that is visible from the goal of a move, its occupant before the push, and its direction [rad]."""

    slot: int
    node: int
    direction_rad: float


def future_occupants(path: Sequence[int], robots: Sequence[int]) -> dict[int, int]:
    """Return the next occupant of each slot that changes hands.

    `path` are the slots of a push, rear to front. `robots` start at these slots, in the same order; the last robot, if
    it is given, drives into unknown space.
    """
    return dict(zip(path[1:], robots, strict=False))


def direction_to(memory: SlotMemory | None, slot: int) -> float | None:
    """Return the direction [rad] of another slot in a slot's memory, or None if it is not remembered."""
    references = memory.references if memory is not None else ()
    return next((each.direction_rad for each in references if each.slot == slot), None)


def landmarks_for_move(
    references: Iterable[SlotReference],
    future: Mapping[int, int],
    mover: int,
    heading_rad: float,
    vacated: Collection[int] = (),
    station: int | None = None,
) -> tuple[Landmark, ...]:
    """Return the landmarks of a move: the future occupants of the slots around the goal, in the mover's frame.

    The mover itself and slots in `vacated` are no landmarks. `station` is the slot of the base station that the mover
    leaves: bearings to it are poor so close to it.
    """
    found = []
    for slot, before, direction_rad in references:
        node = future.get(slot, before)
        if node != mover and slot not in vacated:
            bearing_rad = math.remainder(direction_rad - heading_rad, math.tau)
            found.append((slot, Landmark(node, bearing_rad, slot not in future)))
    if station is not None and sum(each.still for _, each in found) > STATIC_LANDMARKS_MIN:
        found = [each for each in found if each[0] != station]
    return tuple(each for _, each in found)
