"""Which points of a walk along a wall a robot reports: as many as a message holds."""

import math
from collections.abc import Collection, Iterable, Sequence
from itertools import accumulate
from typing import Final

from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.motion.homing import Vector
from zwerm.agents.sensor_coverage.motion.odometry_frame import Touched

# Distance [m] between waypoints while nothing else changes.
SPACING_M: Final = 0.1
# Greatest length of the waypoints of a leg in a message, of a waypoint without its sightings, and of a sighting. Among many
# robots a leg is shorter, because a command has a greatest length.
LEG_BYTES_MAX: Final = 40_000
WAYPOINT_BYTES: Final = 60
SIGHTING_BYTES: Final = 16


class WaypointChoice:
    """Chooses points of a leg as waypoints: those beside which what is seen or touched changes, and one every SPACING_M.

    `chosen` are their numbers. The first point, at the place `at` [m], is one of them.
    """

    def __init__(self, at: Vector, seen: Collection[int], contacts: Iterable[Touched]) -> None:
        self.chosen = [0]
        self._number = 0
        self._here = self._last = at
        self._state = _state(seen, contacts)
        self._seen = self._sightings = len(seen)

    @property
    def is_full(self) -> bool:
        """True if a message holds no more waypoints."""
        return len(self.chosen) * WAYPOINT_BYTES + self._sightings * SIGHTING_BYTES >= LEG_BYTES_MAX

    def take(self, at: Vector, seen: Collection[int], contacts: Iterable[Touched]) -> None:
        """Take in the next point: its place [m], the robots in sight, and the contacts."""
        before, self._here = self._here, at
        self._number += 1
        state = _state(seen, contacts)
        if state != self._state:
            if before != self._last:
                self._choose(self._number - 1, self._seen)
            self._choose(self._number, len(seen))
        elif math.dist(self._last, at) >= SPACING_M:
            self._choose(self._number, len(seen))
        self._state, self._seen = state, len(seen)

    def _choose(self, number: int, sightings: int) -> None:
        self.chosen.append(number)
        self._sightings += sightings
        self._last = self._here


def first_of_message(points: Sequence[Waypoint]) -> Sequence[Waypoint]:
    """Return the first of these points, as many as a message holds."""
    sizes = accumulate(WAYPOINT_BYTES + len(each.sightings) * SIGHTING_BYTES for each in points)
    return points[: sum(size < LEG_BYTES_MAX for size in sizes)]


def _state(seen: Collection[int], contacts: Iterable[Touched]) -> tuple[object, ...]:
    """Return what decides whether a point is a waypoint: the robots in sight and in touch, and whether there is a wall."""
    contacts = tuple(contacts)
    touched = (each.node for each in contacts if each.node is not None)
    return tuple(sorted(seen)), any(each.node is None for each in contacts), *touched
