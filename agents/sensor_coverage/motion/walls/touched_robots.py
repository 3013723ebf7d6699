"""Which of several robots in the direction of a contact a walking robot touches.

A touch switch does not say what it touches. Along a wall robots stand one behind the other, so the walking robot sees several
in the sector of a switch. The next steps show which of them is in touch: a robot in touch is one diameter away, and its
bearing changes as the walking robot passes it. The point of the walk is held back until then. If the bearings of all of them
change much less, the contact is with a wall: beside a corner a robot may stand far behind the wall's end.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import msgspec

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit
from zwerm.agents.sensor_coverage.motion.odometry_frame import Touched

# Points after which a contact that is still uncertain counts as none.
POINTS_MAX: Final = 5
# One robot is in touch if the bearings of the others are off by this [rad] (root mean square) and by this factor more.
OFF_RAD: Final = math.radians(9.0)
OFF_FACTOR: Final = 2.0
# None of them is in touch if the bearings at so many points are all off by this [rad] (root mean square).
WALL_RAD: Final = math.radians(20.0)
WALL_POINTS: Final = 3
# A bearing shows a distance only if the walking robot moved by this distance [m] across its line of sight: its noise would
# decide.
ACROSS_M_MIN: Final = 0.03
# A robot in sight is not in touch if its bearing shows a distance of more than this many radii of a body.
TOUCHING_RADII_MAX: Final = 4.0
# Latest steps with whose bearings those of robots in the direction of a contact are compared, and steps for which such a robot
# counts as beyond a wall.
STEPS_MAX: Final = 3


class _Contact(msgspec.Struct):
    """A contact with one of several robots, or with a wall in the direction `bearing_rad`.

    It has the robot that was supposed, and by robot the sum of squared errors [rad²].
    """

    bearing_rad: float
    supposed: int
    errors: dict[int, float]
    points: int = 0

    def touched(self) -> int | None:
        """Return the robot in touch, if that is certain."""
        if len(self.errors) == 1:
            return self.supposed if self.points >= WALL_POINTS and not self.is_wall() else None
        (best, node), (second, _) = sorted((error, node) for node, error in self.errors.items())[:2]
        certain = second > self.points * OFF_RAD**2 and second > OFF_FACTOR**2 * best
        return node if self.points and certain else None

    def is_wall(self) -> bool:
        """Return whether none of the robots is in touch."""
        return self.points >= WALL_POINTS and min(self.errors.values()) > self.points * WALL_RAD**2

    def is_certain(self) -> bool:
        """Return whether it is certain what is in touch."""
        return self.is_wall() or self.touched() is not None


class TouchedRobots:
    """Holds back the points of a walk at which the robot touches one of several, and reports all points in their order."""

    def __init__(self, radius_m: float, report: Callable[[Waypoint], None]) -> None:
        self._diameter_m = 2.0 * radius_m
        self._report = report
        self._uncertain: dict[tuple[float, float], Sequence[tuple[float, Sequence[int]]]] = {}
        self._held: deque[tuple[Waypoint, list[_Contact]]] = deque()

    def note(self, x_m: float, y_m: float, groups: Sequence[tuple[float, Sequence[int]]]) -> None:
        """Note the contacts at the point (x, y) [m]: bearing [rad], and robots that it may be with, the supposed one first."""
        if groups:
            self._uncertain[x_m, y_m] = groups

    def take(self, point: Waypoint) -> None:
        """Take in the next point."""
        seen = {each.node: each.bearing_rad for each in point.sightings}
        for at, contacts in self._held:
            self._compare(at, contacts, point, seen)
        groups = self._uncertain.pop((point.x_m, point.y_m), ())
        contacts = [
            _Contact(bearing, nodes[0], dict.fromkeys(nodes, 0.0))
            for bearing, nodes in groups
            if nodes[0] in point.robots and all(node in seen for node in nodes)
        ]
        self._held.append((point, contacts))
        while self._held and (len(self._held) > POINTS_MAX or all(each.is_certain() for each in self._held[0][1])):
            self._release()

    def end(self) -> None:
        """Report the points that are held back."""
        while self._held:
            self._release()

    def _compare(self, at: Waypoint, contacts: Sequence[_Contact], point: Waypoint, seen: dict[int, float]) -> None:
        """Compare the bearings of robots at a later point with those that they would have in touch with the first."""
        then = {each.node: each.bearing_rad for each in at.sightings} if contacts else {}
        for contact in contacts:
            if contact.is_certain() or any(node not in seen for node in contact.errors):
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
            if node is None and len(contact.errors) == 1 and not contact.is_wall():
                continue  # no other robot is there
            others = tuple(each for each in point.robots if each != contact.supposed)
            point = msgspec.structs.replace(point, robots=others if node is None else (*others, node))
            if contact.is_wall():
                point = msgspec.structs.replace(point, touched=(*point.touched, contact.bearing_rad))
        self._report(point)


class _Touch(NamedTuple):
    """A contact in the direction of a robot: its steps, whether the robot came into sight with it, or is beyond a wall."""

    steps: int
    is_new: bool
    is_beyond: bool


class RobotsInReach:
    """Tells robots in touch from those that only stand in the direction of a contact, by their bearings on the latest steps.

    `out_of_reach` are the robots in the direction of a contact that the latest step showed to be too far away. The point there
    has no contact with them.
    """

    def __init__(self, radius_m: float) -> None:
        self.out_of_reach: frozenset[int] = frozenset()
        self._distance_m = TOUCHING_RADII_MAX * radius_m
        self._before: deque[tuple[Vector, Mapping[int, float]]] = deque(maxlen=STEPS_MAX)
        self._touches: dict[int, _Touch] = {}

    def begin(self) -> None:
        """Begin another drive: robots have moved meanwhile."""
        self.out_of_reach = frozenset()
        self._before.clear()
        self._touches.clear()

    def take(
        self,
        before: Vector,
        seen_before: Mapping[int, float],
        at: Vector,
        seen: Mapping[int, float],
        nodes: Iterable[int],
    ) -> None:
        """Take in a step: the places [m] before and after it, the bearings [rad] of robots, and those in touch after it.

        A robot counts as beyond a wall if one of the steps before the contact shows that it is too far away. So it does if it
        has just come into sight: a robot behind the end of a wall does when the walking robot touches that end. A body that is
        pushed moves as the robot does, and would look far away. So the steps during a contact do not count, but for one after
        a robot has come into sight, and no robot counts as beyond a wall for long.
        """
        self._before.append((before, seen_before))
        out_of_reach, touches = dict[int, None](), dict[int, _Touch]()
        for node in nodes:
            far = [
                is_farther(self._distance_m, (at[0] - place[0], at[1] - place[1]), bearings[node], seen[node])
                for place, bearings in self._before
                if node in bearings and node in seen
            ]
            if node in seen_before and far[-1]:
                out_of_reach[node] = None
            last, is_new = self._touches.get(node), node not in seen_before
            if last is None:
                touches[node] = _Touch(1, is_new, is_new or any(far))
            else:
                is_beyond = any(far) if last.steps == 1 and last.is_new else last.is_beyond
                touches[node] = _Touch(last.steps + 1, last.is_new, is_beyond and last.steps < STEPS_MAX)
        self.out_of_reach, self._touches = frozenset(out_of_reach), touches

    def steered_by(self, contacts: Iterable[Touched]) -> list[Touched]:
        """Return the contacts by which the walking robot steers: those in the direction of a robot beyond are with a wall.

        Else it would drive away from the corner that it touches, in a wide curve without a contact.
        """
        beyond = {node for node, each in self._touches.items() if each.is_beyond}
        return [Touched(each.switch_rad, None, each.switch_rad) if each.node in beyond else each for each in contacts]


def is_farther(distance_m: float, moved_m: Vector, before_rad: float, now_rad: float) -> bool:
    """Return whether a point is farther away than a distance, by its bearings before and after a drive by `moved_m`.

    A drive along the line of sight shows nothing.
    """
    ux, uy = unit(now_rad)
    across_m = abs(moved_m[0] * uy - moved_m[1] * ux)
    return across_m > ACROSS_M_MIN and angle_between(before_rad, now_rad) * distance_m < across_m
