"""Which of several robots in the direction of a contact a walking robot touches.

A touch switch does not say what it touches. Along a wall robots stand one behind the other, so the walking robot sees several
in the sector of a switch. The next steps show which of them is in touch: a robot in touch is one diameter away, and its
bearing changes as the walking robot passes it. The point of the walk is held back until then. If a larger distance fits the
bearings much better, or the robot goes out of sight at once, the contact is not with it: beside a corner a robot may stand
far behind the wall's end. If so it is with all of them, the contact is with a wall.
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
# A robot may be so many diameters away if it is not in touch.
FAR_DIAMETERS: Final = 2.0, 3.0, 4.5, 7.0, 14.0
# It is not if its bearings at so many points are off by this [rad] (root mean square), and at such a distance by this part of
# it. When no more points come, less is enough, but not of fewer points.
FAR_POINTS: Final = 3
FAR_RAD: Final = math.radians(8.0)
FAR_FACTOR: Final = 0.33
LAST_FAR_RAD: Final = math.radians(6.0)
LAST_FAR_FACTOR: Final = 0.5
FEW_FAR_RAD: Final = math.radians(12.0)
# It is in touch if at these distances they are off by this [rad] and by this factor more.
NEAR_RAD: Final = math.radians(4.0)
NEAR_FACTOR: Final = 1.2
# A robot that is out of sight at so many next points is not in touch.
LOST_POINTS: Final = 2
# A bearing shows a distance only if the walking robot moved by this distance [m] across its line of sight: its noise would
# decide.
ACROSS_M_MIN: Final = 0.03
# A robot in sight is not in touch if its bearing shows a distance of more than this many radii of a body.
TOUCHING_RADII_MAX: Final = 4.0
# Latest steps with whose bearings those of robots in the direction of a contact are compared, and steps for which such a robot
# counts as beyond a wall.
STEPS_MAX: Final = 3


class _Candidate(msgspec.Struct):
    """A robot that may be in touch, in a direction [rad], by its bearings at the next points.

    `errors` are the sums of squared errors [rad²] of these bearings, if it is in touch and if it is farther away
    (FAR_DIAMETERS). The robot was out of sight at `lost` points before it was seen again.
    """

    node: int
    direction_rad: float
    errors: list[float] = msgspec.field(default_factory=lambda: [0.0] * (1 + len(FAR_DIAMETERS)))
    seen: int = 0
    lost: int = 0

    def take(self, moved_m: Vector, bearing_rad: float | None, diameter_m: float) -> None:
        """Take in its bearing at the next point, if it is in sight there; `moved_m` is the way to that point."""
        if bearing_rad is None:
            self.lost += not self.seen
            return
        ux, uy = unit(self.direction_rad)
        self.seen += 1
        for number, diameters in enumerate((1.0, *FAR_DIAMETERS)):
            distance_m = diameters * diameter_m
            expected = math.atan2(distance_m * uy - moved_m[1], distance_m * ux - moved_m[0])
            self.errors[number] += math.remainder(bearing_rad - expected, math.tau) ** 2

    def is_far(self, is_last: bool) -> bool:
        """Return whether it is not in touch, by all points, or by those until now."""
        if not self.seen:
            return self.lost >= (1 if is_last else LOST_POINTS)
        is_few = self.seen < FAR_POINTS
        if is_few and not is_last:
            return False
        off, factor = (LAST_FAR_RAD, LAST_FAR_FACTOR) if is_last else (FAR_RAD, FAR_FACTOR)
        near, far = self.errors[0], min(self.errors[1:])
        return near > self.seen * (FEW_FAR_RAD if is_few else off) ** 2 and far < factor**2 * near

    def is_near(self) -> bool:
        """Return whether it is certainly in touch, or a robot as close."""
        near, far = self.errors[0], min(self.errors[1:])
        return self.seen >= FAR_POINTS and far > self.seen * NEAR_RAD**2 and far > NEAR_FACTOR**2 * near


class _Contact(msgspec.Struct):
    """A contact with one of several robots, or with a wall in the direction `bearing_rad`.

    `supposed` is the robot that seemed to be in touch.
    """

    bearing_rad: float
    supposed: int
    candidates: list[_Candidate]

    def left(self, is_last: bool) -> list[_Candidate]:
        """Return the robots that may be in touch, by all points, or by those until now."""
        return [each for each in self.candidates if not each.is_far(is_last)]

    def touched(self, is_last: bool) -> int | None:
        """Return the robot in touch, if that is certain, or if it is the only one that is left at the last point."""
        left = self.left(is_last)
        if len(left) == 1:
            return left[0].node if is_last or left[0].is_near() else None
        if not left or any(not each.seen for each in left):
            return None
        best, second = sorted(left, key=lambda each: (each.errors[0] / each.seen, each.node))[:2]
        off, least = second.errors[0] / second.seen, best.errors[0] / best.seen
        return best.node if off > OFF_RAD**2 and off > OFF_FACTOR**2 * least else None

    def is_wall(self, is_last: bool) -> bool:
        """Return whether none of the robots is in touch."""
        return not self.left(is_last)

    def is_certain(self) -> bool:
        """Return whether it is certain what is in touch."""
        return self.is_wall(False) or self.touched(False) is not None


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
            for contact in contacts:
                if not contact.is_certain():
                    for each in contact.candidates:
                        each.take((point.x_m - at.x_m, point.y_m - at.y_m), seen.get(each.node), self._diameter_m)
        groups = self._uncertain.pop((point.x_m, point.y_m), ())
        contacts = [
            _Contact(bearing, nodes[0], [_Candidate(node, seen[node]) for node in nodes])
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

    def _release(self) -> None:
        """Report the first point, without contacts that are still uncertain."""
        point, contacts = self._held.popleft()
        for contact in contacts:
            is_last = not contact.is_certain()
            node = contact.touched(is_last)
            others = tuple(each for each in point.robots if each != contact.supposed)
            point = msgspec.structs.replace(point, robots=others if node is None else (*others, node))
            if contact.is_wall(is_last):
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
