"""What the coordinator knows: places, who stands on them, and in which directions they see each other.

A place (slot) outlives its robots: pushing moves robots, not places. Directions are told in one frame, that of the base,
into which every robot's bearings are turned by its heading; headings come from reciprocal bearings alone, since the bearing
from a to b and that from b to a are opposite. There are no positions and no distances.
"""

import cmath
import math
from collections.abc import Iterable, Mapping

from zwerm.orders import Sighting

# How much of a new reading goes into a place's reference directions, once there are some.
REFERENCE_WEIGHT = 0.1
# A reference that is further off than this is no longer true: something was knocked over [rad].
REFERENCE_OFF_RAD = 0.35


class Places:
    """Places by number, and what is remembered of each. Place 0 is the base."""

    def __init__(self) -> None:
        self.occupant: dict[int, int] = {}
        self.heading: dict[int, float] = {}
        self.view: dict[int, dict[int, float]] = {}  # robot: robot: bearing in the first one's frame
        self.touched: dict[int, dict[int, None]] = {}
        self.walls: dict[int, list[float]] = {}  # place: directions of walls
        self._headings_known: dict[int, int] = {}
        self._reference: dict[tuple[int, int], tuple[complex, int]] = {}
        self._next = 0

    def found(self, robot: int, heading: float) -> int:
        """Make a place for a robot whose heading in the base's frame is known, and return it."""
        place = self._next
        self._next += 1
        self.occupant[place] = robot
        self.heading.setdefault(robot, heading)
        return place

    def place_of(self) -> dict[int, int]:
        """Return the place of every robot."""
        return {robot: place for place, robot in self.occupant.items()}

    def drop(self, place: int) -> None:
        """Forget a place: nobody is there."""
        robot = self.occupant.pop(place, None)
        if robot is not None:
            self.view.pop(robot, None)
        self.walls.pop(place, None)

    def take(self, robot: int, sightings: Iterable[Sighting]) -> None:
        """Take what a robot says it sees, in its own frame."""
        self.view[robot] = {each.node: each.bearing_rad for each in sightings}

    def views(self) -> dict[int, dict[int, float]]:
        """Return what every place sees of the others, as directions in the base's frame."""
        place_of = self.place_of()
        return {
            place: {
                place_of[node]: bearing + self.heading[robot]
                for node, bearing in sorted(self.view.get(robot, {}).items())
                if node in place_of
            }
            for place, robot in sorted(self.occupant.items())
        }

    def learn_headings(self, fresh: Iterable[int]) -> None:
        """Refine the headings of the robots that have new readings, by their reciprocal bearings."""
        for robot in fresh:
            if robot == self.occupant.get(0):
                continue
            mine = self.view.get(robot, {})
            off = 0j
            for node, bearing in mine.items():
                back = self.view.get(node, {}).get(robot)
                if back is not None and node in self.heading:
                    off += cmath.exp(1j * (self.heading[node] + back + math.pi - self.heading[robot] - bearing))
            if off:
                known = self._headings_known.get(robot, 0)
                self.heading[robot] += cmath.phase(off) / min(known + 1, 20)
                self._headings_known[robot] = known + 1

    def direction(self, a: int, b: int) -> float | None:
        """Return the remembered direction from one place to another, if there is one."""
        known = self._reference.get((a, b))
        return None if known is None else cmath.phase(known[0])

    def learn_references(self, views: Mapping[int, Mapping[int, float]]) -> None:
        """Let the remembered directions follow what is seen, slowly: else errors would walk at random."""
        for a, seen in views.items():
            for b, there in seen.items():
                back = views.get(b, {}).get(a)
                if back is None or b < a:
                    continue
                now = cmath.exp(1j * there) + cmath.exp(1j * (back + math.pi))
                now /= abs(now) or 1.0
                mean, count = self._reference.get((a, b), (now, 0))
                if abs(cmath.phase(now / mean)) > REFERENCE_OFF_RAD:
                    mean, count = now, 0
                weight = max(1.0 / (count + 1), REFERENCE_WEIGHT)
                mean += weight * (now - mean)
                mean /= abs(mean) or 1.0
                self._reference[a, b] = mean, count + 1
                self._reference[b, a] = -mean, count + 1

    def known_from(self, place: int) -> list[tuple[int, float]]:
        """Return (place, direction) of every place that was ever seen from this one and still is one."""
        return [
            (b, cmath.phase(mean))
            for (a, b), (mean, _) in sorted(self._reference.items())
            if a == place and b in self.occupant
        ]
