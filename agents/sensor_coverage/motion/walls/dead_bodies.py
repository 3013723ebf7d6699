"""Bodies of dead robots in the way of a robot that follows a wall.

A dead robot does not drive: its body yields to a push until something is behind it. So the walking robot drives on where
it touches a body. Where that stops it, it pushes straight at the body. A body that does not yield counts as wall in this
direction. When the direction has turned, the robot pushes again. A robot that pushes back lives, and is no wall.

Beyond a body that does not yield may still be a way: a body that lies in a bend of a passage narrower than two bodies
yields to no push from one end, and the robot turns round in front of it. Around a body in the corner of a room the direction to
the body turns by as much as the angle of the corner. So the points of the walk at bodies are held back until walls alone
are in touch again. The bodies count only if their direction turned by `ROUND_RAD`, or by `ROUND_IN_CORNER_RAD` between the
walls of a corner on which they lean, and if they did not yield meanwhile.
"""

import math
from collections.abc import Callable, Collection, Generator, Sequence
from itertools import pairwise
from typing import Final, Protocol

import msgspec

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit
from zwerm.agents.sensor_coverage.motion.odometry_frame import Touched
from zwerm.wire.messages import BodyVelocity

# A robot with less than this fraction of a full step is stopped. A body that yields half its way, as one body does, is not.
STOPPED_FRACTION: Final = 0.2
# Ticks of a push. In the first one the bodies come into contact, and it does not count.
PUSH_TICKS: Final = 3
# A body does not yield if the robot moves in these ticks by less than this fraction of full steps: 18 free bodies in a row
# yield by more, and so does a body that is free in a direction within 75 degrees of the push.
YIELD_FRACTION: Final = 0.05
# Ticks for which the robot then stands still. Bodies that were pressed against walls spring apart in the first of them, by up
# to 0.3 of a full step in a wedge. A robot that lives and was displaced drives back by more, or goes on in the next one.
REST_TICKS: Final = 2
BACK_FRACTION: Final = 0.4
# A body is pushed again when its direction has turned by this [rad], or after so many ticks without a contact.
AGAIN_RAD: Final = math.radians(25.0)
APART_TICKS: Final = 2
# Bodies count as wall if the direction to them turned by this [rad] at least from one wall to the next. A robot turns round
# by less than 35 degrees in front of a body in a bend that it cannot pass.
ROUND_RAD: Final = math.radians(60.0)
# In an acute corner they turn by less, and the pushes show less than that. There this angle [rad] is enough: the directions of
# the two walls differ by these angles [rad], while those on the two sides of a passage are opposite, as the switches show them,
# and the body leans on both walls, which are at right angles to its direction, within the last angle [rad].
ROUND_IN_CORNER_RAD: Final = math.radians(35.0)
CORNER_RAD_MIN: Final = math.radians(30.0)
CORNER_RAD_MAX: Final = math.radians(140.0)
LEANS_RAD: Final = math.radians(45.0)
# Points at bodies that are held back at most.
HELD_MAX: Final = 200


class _Pushed(msgspec.Struct):
    """A body that did not yield: the direction [rad] of the push, and the ticks since the latest contact."""

    direction_rad: float
    apart_ticks: int = 0


class Touching(Protocol):
    """What the contacts of the walking robot are read from."""

    @property
    def contacts(self) -> Sequence[Touched]:
        """What the robot touches."""


class Pusher(Protocol):
    """The walking robot: the length [m] of a full step, its position [m] by odometry, and its contacts."""

    step_m: float

    @property
    def frame(self) -> Touching:
        """Its latest reading."""

    @property
    def position(self) -> Vector:
        """Its position [m] by odometry."""

    def velocity(self, x_m: float, y_m: float) -> BodyVelocity:
        """Return the velocity that moves it by (x, y) [m] within one tick."""


class DeadBodies:
    """The bodies that one walking robot touches. `dead` are the robots that it knows to be dead, which may change."""

    def __init__(self, motion: Pusher, dead: Collection[int]) -> None:
        self._motion = motion
        self._dead = dead
        self._push: Generator[BodyVelocity, None, None] | None = None
        self._firm: dict[int, _Pushed] = {}  # bodies that did not yield
        self._again: dict[int, None] = {}  # bodies that did not yield in another direction
        self._living: dict[int, None] = {}  # robots that pushed back

    @property
    def step_m(self) -> float:
        """Length of a full step [m]."""
        return self._motion.step_m

    def begin(self) -> None:
        """Begin another drive, and forget the bodies."""
        self._push = None
        self._firm, self._again, self._living = {}, {}, {}

    def is_body(self, node: int | None) -> bool:
        """Return whether a robot in touch is dead, as far as is known."""
        return node in self._dead and node not in self._living

    @property
    def in_touch(self) -> bool:
        """True if a robot in touch is known to be dead, even if it seemed to push back."""
        return any(each.node in self._dead for each in self._motion.frame.contacts)

    def contacts(self) -> list[Touched]:
        """Return the contacts that stop the robot: bodies that do not yield are walls, and others stop nothing."""
        return [
            Touched(each.bearing_rad, None) if each.node in self._firm else each
            for each in self._motion.frame.contacts
            if each.node in self._firm or not self.is_body(each.node)
        ]

    def firm(self) -> tuple[float, ...]:
        """Return the directions [rad] of the bodies in touch that do not yield; none if another robot is in touch."""
        contacts = [each for each in self._motion.frame.contacts if each.node is not None]
        if any(not self.is_body(each.node) for each in contacts):
            return ()
        return tuple(each.bearing_rad for each in contacts if each.node in self._firm)

    def step(self, moved_m: float, heading_rad: float) -> BodyVelocity | None:
        """Return the velocity of a push, or None if there is none now.

        Takes the length [m] and the heading [rad] of the latest step.
        """
        self._watch()
        if self._push is None:
            node = self._in_the_way(moved_m, heading_rad)
            self._push = None if node is None else self._straight(node)
        velocity = None if self._push is None else next(self._push, None)
        if velocity is None:
            self._push = None
        return velocity

    def _touched(self) -> dict[int, float]:
        """Return the bodies in touch, and their bearings [rad]."""
        return {
            each.node: each.bearing_rad
            for each in self._motion.frame.contacts
            if each.node is not None and self.is_body(each.node)
        }

    def _watch(self) -> None:
        """Find the bodies that must be pushed again."""
        touched = self._touched()
        for node, pushed in tuple(self._firm.items()):
            pushed.apart_ticks = 0 if node in touched else pushed.apart_ticks + 1
            if pushed.apart_ticks > APART_TICKS or not self.is_body(node):
                del self._firm[node]
            elif node in touched and angle_between(touched[node], pushed.direction_rad) > AGAIN_RAD:
                del self._firm[node]
                self._again[node] = None

    def _in_the_way(self, moved_m: float, heading_rad: float) -> int | None:
        """Return the body to push now, or None."""
        touched = {node: bearing for node, bearing in self._touched().items() if node not in self._firm}
        again = [node for node in touched if node in self._again]
        if again:
            return again[0]
        off = {node: angle_between(bearing, heading_rad) for node, bearing in touched.items()}
        nearest = min(off, key=lambda node: off[node], default=None)
        stopped = moved_m < STOPPED_FRACTION * self._motion.step_m
        return nearest if stopped and nearest is not None and off[nearest] < math.pi / 2.0 else None

    def _straight(self, node: int) -> Generator[BodyVelocity, None, None]:
        """Push straight at a body, and find out whether it yields."""
        motion = self._motion
        self._again.pop(node, None)
        direction_rad, way_m = 0.0, 0.0
        for tick in range(PUSH_TICKS):
            touched = self._touched()
            if node not in touched:
                return
            direction_rad, before = touched[node], motion.position
            ux, uy = unit(direction_rad)
            yield motion.velocity(ux * motion.step_m, uy * motion.step_m)
            if tick > 0:
                way_m += (motion.position[0] - before[0]) * ux + (motion.position[1] - before[1]) * uy
        if node not in self._touched() or way_m > YIELD_FRACTION * motion.step_m * (PUSH_TICKS - 1):
            return
        places = [motion.position]
        for _ in range(REST_TICKS):
            yield BodyVelocity()
            places.append(motion.position)
        first, *more = (math.dist(a, b) / motion.step_m for a, b in pairwise(places))
        if first > BACK_FRACTION or max(more) > YIELD_FRACTION:
            self._living[node] = None
        elif node in self._touched():
            self._firm[node] = _Pushed(direction_rad)


class HeldPoints:
    """Reports the points of a walk to `report`, and holds those at bodies back until walls alone are in touch again."""

    def __init__(self, bodies: DeadBodies, report: Callable[[Waypoint], None]) -> None:
        self._bodies = bodies
        self._report = report
        self._held: list[tuple[Waypoint, tuple[float, ...]]] = []
        self._firm: list[tuple[float, ...]] = []  # directions [rad] of bodies that did not yield
        self._at = 0.0, 0.0  # where the robot touched one of these last [m]
        self._walls: tuple[float, ...] = ()  # directions [rad] of the walls touched last without a body

    def take(self, point: Waypoint) -> None:
        """Take in a point, at which the robot is now."""
        firm, at = self._bodies.firm(), (point.x_m, point.y_m)
        at_body = any(self._bodies.is_body(each) for each in point.robots)
        if firm:
            self._firm.append(firm)
            self._at = at
        elif at_body and math.dist(at, self._at) > STOPPED_FRACTION * self._bodies.step_m:
            self._firm = []  # a body has yielded
        if at_body or (self._held and not point.touched):
            self._held.append((point, firm))
            if len(self._held) > HELD_MAX:
                self.end()
            return
        self._release(self._is_round(point.touched))
        self._walls = point.touched or self._walls
        self._report(point)

    def end(self) -> None:
        """Report the points that are held back: the bodies there are no wall."""
        self._release(False)

    def _is_round(self, walls: tuple[float, ...]) -> bool:
        """Return whether the robot turned round bodies that did not yield, to walls in some directions [rad]."""
        if not self._firm:
            return False
        first, last = self._firm[0], self._firm[-1]
        turned_rad = min(angle_between(a, b) for a in first for b in last)
        corner = [angle_between(a, b) for a in self._walls for b in walls]
        leans = _at_right_angles(self._walls, first) and _at_right_angles(walls, last)
        in_corner = leans and min(corner) >= CORNER_RAD_MIN and max(corner) <= CORNER_RAD_MAX
        return turned_rad >= (ROUND_IN_CORNER_RAD if in_corner else ROUND_RAD)

    def _release(self, at_walls: bool) -> None:
        held, self._held, self._firm = self._held, [], []
        for point, firm in held:
            if at_walls:
                robots = tuple(each for each in point.robots if not self._bodies.is_body(each))
                point = msgspec.structs.replace(point, touched=point.touched or firm, robots=robots)
            self._report(point)


def _at_right_angles(walls: Collection[float], bodies: Collection[float]) -> bool:
    """Return whether there are walls in touch, and all are beside all bodies in touch: directions [rad] to both."""
    off = [abs(angle_between(a, b) - math.pi / 2.0) for a in walls for b in bodies]
    return bool(off) and max(off) <= LEANS_RAD
