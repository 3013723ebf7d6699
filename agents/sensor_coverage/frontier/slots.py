"""What the coordinator knows: places, who stands on them, and in which directions they see each other.

A place (slot) outlives its robots: pushing moves robots, not places. Directions are told in the frame of a base station,
into which every robot's bearings are turned by its heading; headings come from reciprocal bearings alone, since the bearing
from a to b and that from b to a are opposite. There are no positions and no distances.

How the frames of two stations are turned to each other nobody knows until robots of both see each other. So every robot's
heading is in the frame of one robot, its own to begin with; where two frames meet they become one.
"""

import cmath
import math
from collections.abc import Iterable, Mapping

from zwerm.agents.sensor_coverage.messages.commands import Sighting

# How much of a new reading goes into a place's reference directions, once there are some.
REFERENCE_WEIGHT = 0.1
# A reference that is further off than this is no longer true: something was knocked over [rad].
REFERENCE_OFF_RAD = 0.35


class Slots:
    """Places by number, and what is remembered of each. The first are those of the base stations."""

    def __init__(self) -> None:
        self.occupant: dict[int, int] = {}
        self.heading: dict[int, float] = {}
        self.view: dict[int, dict[int, float]] = {}  # robot: robot: bearing in the first one's frame
        self.touched: dict[int, dict[int, None]] = {}
        self.walls: dict[int, list[float]] = {}  # place: directions of walls
        self.blocked: dict[int, list[float]] = {}  # place: directions in which a wall stopped a drive
        self.frame: dict[int, int] = {}  # robot: the robot in whose frame its heading is
        self._headings_known: dict[int, int] = {}
        self._reference: dict[tuple[int, int], tuple[complex, int]] = {}
        self._next = 0

    def found(self, robot: int) -> int:
        """Make a place for a robot, and return it. Of a robot that nothing is known of, its own is its frame."""
        place = self._next
        self._next += 1
        self.occupant[place] = robot
        if robot not in self.heading:
            self.orient(robot, robot, 0.0)
        return place

    def orient(self, robot: int, frame: int, heading: float) -> None:
        """Take a robot's heading in a frame for known, for the first time."""
        self.heading[robot], self.frame[robot] = heading, frame
        self._headings_known[robot] = 0

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
        """Return what every place sees of the others, as directions in its frame."""
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
        fresh = tuple(fresh)
        while any(self._meet(robot) for robot in fresh):
            pass
        for robot in fresh:
            if robot == self.frame[robot]:
                continue
            off = 0j
            for node, (bearing, back) in self._mutual(robot).items():
                off += cmath.exp(1j * (self.heading[node] + back + math.pi - self.heading[robot] - bearing))
            if off:
                known = self._headings_known.get(robot, 0)
                self.heading[robot] += cmath.phase(off) / min(known + 1, 20)
                self._headings_known[robot] = known + 1

    def _meet(self, robot: int) -> bool:
        """Make one frame of a robot's and another's, if it and any robots of that see each other; tell whether it did."""
        mine, others = self.frame[robot], self.frame
        met = min((others[node] for node in self._mutual(robot) if others[node] != mine), default=None)
        if met is None:
            return False
        off = 0j
        for one in [each for each, frame in self.frame.items() if frame == mine]:
            for node, bearing, back in ((n, *each) for n, each in self._mutual(one).items() if others[n] == met):
                off += cmath.exp(1j * (self.heading[node] + back + math.pi - self.heading[one] - bearing))
        old, new, by = (mine, met, cmath.phase(off)) if met < mine else (met, mine, -cmath.phase(off))
        self._turn(old, new, by)
        return True

    def _mutual(self, robot: int) -> dict[int, tuple[float, float]]:
        """Return (bearing there, bearing back) by the robots that this one sees, and that see it."""
        views = self.view
        return {
            node: (bearing, views[node][robot])
            for node, bearing in sorted(views.get(robot, {}).items())
            if node in self.frame and robot in views.get(node, ())
        }

    def _turn(self, old: int, new: int, by: float) -> None:
        """Tell in a new frame what is known in an old one, which is turned by so much against it."""
        turned = [place for place, robot in self.occupant.items() if self.frame[robot] == old]
        for robot, frame in self.frame.items():
            if frame == old:
                self.heading[robot] += by
                self.frame[robot] = new
        for place in turned:
            for known in (self.walls, self.blocked):
                if place in known:
                    known[place] = [each + by for each in known[place]]
        spin = cmath.exp(1j * by)
        for (a, b), (mean, count) in self._reference.items():
            if a in turned:
                self._reference[a, b] = mean * spin, count

    def direction(self, a: int, b: int) -> float | None:
        """Return the remembered direction from one place to another, if there is one."""
        known = self._reference.get((a, b))
        return None if known is None else cmath.phase(known[0])

    def remember(self, a: int, b: int, direction: float) -> None:
        """Take the direction from one place to another from who remembers it."""
        mean = cmath.rect(1.0, direction)
        self._reference[a, b], self._reference[b, a] = (mean, 1), (-mean, 1)

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
