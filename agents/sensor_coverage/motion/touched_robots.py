"""Which of several robots in the direction of a contact a walking robot touches.

A touch switch does not say what it touches. Along a wall robots stand one behind the other, so the walking robot sees several
in the sector of a switch. The next steps show which of them is in touch: a robot in touch is one diameter away, and its
bearing changes as the walking robot passes it. The point of the walk is held back until then.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

import msgspec

from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.motion.homing import unit

# Points after which a contact that is still uncertain counts as none.
POINTS_MAX: Final = 5
# One robot is in touch if the bearings of the others are off by this [rad] (root mean square) and by this factor more.
OFF_RAD: Final = math.radians(9.0)
OFF_FACTOR: Final = 2.0


class _Contact(msgspec.Struct):
    """A contact with one of several robots: the one that was supposed, and by robot the sum of squared errors [rad²]."""

    supposed: int
    errors: dict[int, float]
    points: int = 0

    def touched(self) -> int | None:
        """Return the robot in touch, if that is certain."""
        (best, node), (second, _) = sorted((error, node) for node, error in self.errors.items())[:2]
        certain = second > self.points * OFF_RAD**2 and second > OFF_FACTOR**2 * best
        return node if self.points and certain else None


class TouchedRobots:
    """Holds back the points of a walk at which the robot touches one of several, and reports all points in their order."""

    def __init__(self, radius_m: float, report: Callable[[Waypoint], None]) -> None:
        self._diameter_m = 2.0 * radius_m
        self._report = report
        self._uncertain: dict[tuple[float, float], Sequence[Sequence[int]]] = {}
        self._held: deque[tuple[Waypoint, list[_Contact]]] = deque()

    def note(self, x_m: float, y_m: float, groups: Sequence[Sequence[int]]) -> None:
        """Note for the point at (x, y) [m] which robots each contact may be with, the supposed one first."""
        groups = [each for each in groups if len(each) > 1]
        if groups:
            self._uncertain[x_m, y_m] = groups

    def take(self, point: Waypoint) -> None:
        """Take in the next point."""
        seen = {each.node: each.bearing_rad for each in point.sightings}
        for at, contacts in self._held:
            self._compare(at, contacts, point, seen)
        groups = self._uncertain.pop((point.x_m, point.y_m), ())
        contacts = [
            _Contact(each[0], dict.fromkeys(each, 0.0))
            for each in groups
            if each[0] in point.robots and all(node in seen for node in each)
        ]
        self._held.append((point, contacts))
        while self._held and (
            len(self._held) > POINTS_MAX or all(each.touched() is not None for each in self._held[0][1])
        ):
            self._release()

    def end(self) -> None:
        """Report the points that are held back."""
        while self._held:
            self._release()

    def _compare(self, at: Waypoint, contacts: Sequence[_Contact], point: Waypoint, seen: dict[int, float]) -> None:
        """Compare the bearings of robots at a later point with those that they would have in touch with the first."""
        then = {each.node: each.bearing_rad for each in at.sightings} if contacts else {}
        for contact in contacts:
            if contact.touched() is not None or any(node not in seen for node in contact.errors):
                continue
            contact.points += 1
            for node in contact.errors:
                ux, uy = unit(then[node])
                x_m, y_m = at.x_m + self._diameter_m * ux - point.x_m, at.y_m + self._diameter_m * uy - point.y_m
                contact.errors[node] += math.remainder(seen[node] - math.atan2(y_m, x_m), math.tau) ** 2

    def _release(self) -> None:
        """Report the first point, without contacts that are still uncertain."""
        point, contacts = self._held.popleft()
        for contact in contacts:
            node = contact.touched()
            others = tuple(each for each in point.robots if each != contact.supposed)
            point = msgspec.structs.replace(point, robots=others if node is None else (*others, node))
        self._report(point)
