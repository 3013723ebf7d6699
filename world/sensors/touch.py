"""A ring of touch switches: which of them are closed, and so roughly in which directions the robot is touched.

As in Ramaithitima et al. 2015: `switches` of them, evenly spaced from straight ahead, each closed by contacts within
half its sector to either side. A wall or a robot within `reach_m` of the body's surface closes the switch that faces
its nearest point. So a wall closes one switch for each of its straight pieces, not every switch whose sector it
touches. Each tick a closed switch reads open with probability `false_negative`, an open one closed with
`false_positive`. The reading contains no force, and does not say whether a wall or a robot is touched.
"""

import math
from collections.abc import Callable, Collection
from typing import Annotated, ClassVar, Final

import numpy as np
from pydantic import Field

from zwerm.maths.angles import wrap
from zwerm.scenario.types import Fraction, Positive, Table
from zwerm.wire.messages import Contact
from zwerm.world.scene import Floats, Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings, chosen, portions

# Walls are measured this far beyond the switches, so that a robot without a wall there is not measured again at once [m].
_AHEAD_M: Final = 0.3

# What rounding may add to a distance [m].
_ROUNDING_M: Final = 1e-9

_NO_WALLS: Final = (np.zeros(0, dtype=np.int64), np.zeros((0, 2)))


class TouchTable(Table):
    """The ring, and how it errs."""

    switches: Annotated[int, Field(ge=1, le=360)] = 8
    reach_m: Positive = 0.005
    false_negative: Fraction = 0.0
    false_positive: Fraction = 0.0


class Touch(Sensor):
    """The closed switches, counter-clockwise from straight ahead."""

    field: ClassVar[str] = "touch"
    Parameters: ClassVar[type[Table]] = TouchTable
    wake_event: ClassVar[str] = "on_contact"
    has_items: ClassVar[bool] = True
    has_floats: ClassVar[bool] = False

    def __init__(self, parameters: TouchTable, surroundings: Surroundings) -> None:
        self._reach_m = parameters.reach_m
        self._false_negative, self._false_positive = parameters.false_negative, parameters.false_positive
        self.steady = not (self._false_negative or self._false_positive)
        self._sector_rad = 2.0 * math.pi / parameters.switches
        self._switch = np.arange(parameters.switches)
        bearings = wrap(self._switch * self._sector_rad).tolist()
        self._contacts = [Contact(bearing, self._sector_rad / 2.0) for bearing in bearings]
        self._number = {bearing: number for number, bearing in enumerate(bearings)}
        self._visibility = surroundings.visibility
        # No wall comes into reach of a robot until it is this far from the place where its walls were measured [m²].
        self._measured = np.zeros((surroundings.count, 2))
        self._free2 = np.full(surroundings.count, -1.0)

    def read(self, scene: Scene, robots: Ints) -> list[tuple[Contact, ...]]:
        """Return the closed switches of each of `robots`."""
        here = scene.position[robots]
        walls = self._walls(scene, robots, here)
        # A wall between two bodies in reach is in reach of both, so no line between bodies has to be tested.
        others = self._visibility.sightings(scene, robots, 2.0 * scene.radius_m + self._reach_m, through_walls=True)
        if self.steady and not (len(walls[0]) or len(others.observer)):
            return [()] * len(robots)
        row = np.concatenate([walls[0], np.searchsorted(robots, others.observer)])
        place = np.concatenate([walls[1], scene.position[others.seen]])
        closed = np.zeros((len(robots), len(self._switch)), dtype=np.bool_)
        dx, dy = (place - here[row]).T
        bearing = np.arctan2(dy, dx) - scene.heading[robots[row]]
        closed[row, np.rint(bearing / self._sector_rad).astype(np.int64) % len(self._switch)] = True
        if not self.steady:
            draw = scene.draws.uniform("sensor.touch", scene.tick, robots[:, None], self._switch)
            closed ^= draw < np.where(closed, self._false_negative, self._false_positive)
        row, switch = closed.nonzero()
        ends = np.searchsorted(row, np.arange(len(robots)), side="right")
        return portions([self._contacts[each] for each in switch.tolist()], ends)

    def _walls(self, scene: Scene, robots: Ints, here: Floats) -> tuple[Ints, Floats]:
        """Return the row (k,) of a robot and the nearest place (k, 2) of each wall in reach.

        Only robots that may have come to a wall since their walls were measured are measured again.
        """
        moved = here - self._measured[robots]
        moved *= moved
        rows = (moved[:, 0] + moved[:, 1] > self._free2[robots]).nonzero()[0]
        if not len(rows):
            return _NO_WALLS
        reach_m = scene.radius_m + self._reach_m
        near, places = robots[rows], here[rows]
        walls = scene.arena.walls_within(places, reach_m + _AHEAD_M)
        distance_m = np.full(len(rows), reach_m + _AHEAD_M)
        np.minimum.at(distance_m, walls.point, walls.distance_m)
        self._measured[near] = places
        free_m = distance_m - reach_m - _ROUNDING_M
        self._free2[near] = np.copysign(free_m * free_m, free_m)
        touched = np.flatnonzero(walls.distance_m <= reach_m)
        return rows[walls.point[touched]], walls.nearest[touched]

    @staticmethod
    def signature(reading: tuple[Contact, ...]) -> tuple[float, ...]:
        """Return the bearings of the closed switches."""
        return tuple(contact.bearing_rad for contact in reading)

    def reach_at_rest_m(self, scene: Scene) -> float | None:
        """Return the distance [m] between two robots that touch, if the switches do not err."""
        return 2.0 * scene.radius_m + self._reach_m + _ROUNDING_M if self.steady else None

    def item_id(self, item: Contact) -> int:
        """Return the number of the switch, counter-clockwise from straight ahead."""
        return self._number[item.bearing_rad]

    def with_switch(self, reading: tuple[Contact, ...], switch: int, closed: bool) -> tuple[Contact, ...]:
        """Return `reading` with the switch of this number closed, or open."""
        others = {self.item_id(contact) for contact in reading} - {switch}
        numbers = sorted(others | {switch}) if closed else sorted(others)
        return tuple([self._contacts[number] for number in numbers])

    def phantom(self, robot: int, known: Collection[int], uniform: Callable[[str], float]) -> Contact | None:
        """Return the contact of another switch."""
        number = chosen(range(len(self._contacts)), known, uniform)
        return None if number is None else self._contacts[number]

    @classmethod
    def rest(cls) -> tuple[Contact, ...]:
        """Return no contact."""
        return ()

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> tuple[Contact, ...]:
        """Return at most eight contacts, counter-clockwise."""
        bearings = random.uniform(-math.pi, math.pi, count).tolist()
        return tuple(Contact(bearing, math.pi / 8) for bearing in sorted(bearings)[:8])

    @classmethod
    def extremes(cls) -> tuple[Contact, ...]:
        """Return contacts all around."""
        return (Contact(math.pi, math.pi), Contact(0.0, math.pi))
