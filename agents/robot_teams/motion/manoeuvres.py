"""The three manoeuvres: approach an end, sweep a slice, trace the boundary to the next slice.

Each is stepped once a tick with the robot's senses. It returns the unit vector to move along, or None when it is done.
The argument `blocks` has unit vectors towards robots in the way: a manoeuvre goes around them as if they were walls. A
manoeuvre offers its findings as facts; the pilot decides what to do next.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from zwerm.agents.robot_teams.mapping.facts import End, TracedArc, Wreck
from zwerm.agents.robot_teams.motion.senses import Senses
from zwerm.agents.robot_teams.motion.wall_following import INTO, LEFT_HAND, RIGHT_HAND, Vector, WallFollower

# A contact blocks a sweep if this much of its normal lies along the motion.
BLOCKS: Final = 0.02
# Distance off its slice at which a sweep that touches a wall is over [m].
OFF_SLICE_M: Final = 0.003
# Distance off its slice up to which a sweep that a wall stops measures the end [m]. Other robots push it farther.
BESIDE_SLICE_M: Final = 0.04
# A robot nearer than this may make a sweep slow [m].
NEAR_M: Final = 0.1
# A sweep that is farther off its slice than a tick before by more than this is pushed off it [m].
PUSHED_M: Final = 2e-5
# Distance of the centre beyond a slice at which it has crossed the slice [m].
CROSSED_M: Final = 0.002
# Time after which a sweep that goes around other robots gives up [ticks].
AROUND_TICKS_MAX: Final = 100
# Distance that it may leave its slice for that [m].
AROUND_M: Final = 1.2
# Ticks beside a wreck without coming nearer after which an approach gives up, and what counts as nearer [m].
HIDDEN_TICKS: Final = 20
NEARER_M: Final = 0.02
# Distance along its slice within which a trace that begins without a touch looks for the wall [m].
PRESS_M: Final = 0.4
# A wall leans to a side if this much of its normal points there.
LEANS: Final = 0.3
# Two ends of a slice that are nearer may be taken for each other beside a wall that leans to no side [m].
SHORT_M: Final = 0.1
# Distance on the wrong side of its slice at which a trace may begin [m].
SLACK_M: Final = 0.75
# Largest distance between two touches of one boundary, and of a boundary from a body that stands there [m]: two bodies.
BESIDE_BODY_M: Final = 1.1
# Length of a way outside the slab after which a robot that comes back has gone around robots in a circle [m].
CIRCLE_M: Final = 3.0
# Largest distance of two touches across a straight wall [m].
IN_LINE_M: Final = 0.05


# Returns the ends at which the robots in contact stand.
Parked = Callable[[Senses], Sequence[End]]


class SliceGrid(NamedTuple):
    """The slices: x = origin_m + k * spacing_m."""

    origin_m: float
    spacing_m: float

    def x_m(self, k: int) -> float:
        """Return where slice k is."""
        return self.origin_m + k * self.spacing_m

    def nearest(self, x_m: float) -> int:
        """Return the slice nearest to x."""
        return round((x_m - self.origin_m) / self.spacing_m)


def mm(length_m: float) -> int:
    """Return a length in whole millimetres."""
    return round(1000.0 * length_m)


def hand_of(side: int, direction: int) -> int:
    """Return the hand on which the wall is when a robot leaves an end of this side in x-direction `direction`."""
    return LEFT_HAND if side * direction > 0 else RIGHT_HAND


class Around:
    """The way around robots that stand on a straight course: follow their bodies and the walls until back on the course."""

    def __init__(self, senses: Senses, course: Vector, hand: int) -> None:
        self._course = course
        self._origin = senses.x_m, senses.y_m
        self._follower = WallFollower(hand, course)
        self.ticks = 0

    def direction(self, senses: Senses, blocks: Sequence[Vector], offset_m: float) -> Vector | None:
        """Return where to go, or None once the course is reached again, farther on and free; `offset_m` is the way off it."""
        self.ticks += 1
        cx, cy = self._course
        ahead = (senses.x_m - self._origin[0]) * cx + (senses.y_m - self._origin[1]) * cy
        if not blocks and not senses.walls and abs(offset_m) < 0.04 and ahead > 0.1:
            return None
        return self._follower.direction(senses.walls, blocks)


class Approach:
    """Go straight to an end near by, sliding along walls, and press against the boundary there.

    A wreck may stand at the end, or in the way: then the approach is over, and `hidden` is true.
    """

    def __init__(self, end: End, grid: SliceGrid, parked: Parked) -> None:
        self.end = end
        self._parked = parked
        self._x_m, self._y_m = grid.x_m(end.slice), end.y_mm / 1000.0
        self._nearest_m = math.inf
        self._beside_wreck_ticks = 0
        self.hidden = False

    def step(self, senses: Senses, blocks: Sequence[Vector]) -> Vector | None:
        """Return where to go, or None at the end."""
        dx, dy = self._x_m - senses.x_m, self._y_m - senses.y_m
        distance = math.hypot(dx, dy)
        if distance < 0.03 or (blocks and distance < 0.7 and self.end in self._parked(senses)):
            return None
        if distance < self._nearest_m - NEARER_M:
            self._nearest_m, self._beside_wreck_ticks = distance, 0
        elif senses.wrecks:
            self._beside_wreck_ticks += 1
            if self._beside_wreck_ticks > HIDDEN_TICKS:
                self.hidden = True
                return None
        return dx / distance, dy / distance


class SliceSweep:
    """Move along a slice to the end of its segment on side `side`, or to the height `limit_mm` of a virtual frontier.

    The end is where a wall stops the robot, or where a wall begins to push it off its slice. So robots with other headings
    measure the same end at a wall that is almost parallel to the slice. `end` is None if the robot was beside its slice.
    """

    def __init__(
        self, k: int, side: int, grid: SliceGrid, step_m: float, parked: Parked, limit_mm: int | None = None
    ) -> None:
        self._limit_mm = limit_mm
        self.is_cut = False
        self.slice, self.side = k, side
        self._parked = parked
        self._x_m = grid.x_m(k)
        self._step_m = step_m
        self._last_y_m: float | None = None
        self._last_off_m: float | None = None
        self._on_slice_y_m: float | None = None
        self._around: Around | None = None
        self.around_ticks = 0
        self.wrecks: dict[Wreck, None] = {}
        self.end: End | None = None

    def step(self, senses: Senses, blocks: Sequence[Vector]) -> Vector | None:
        """Return where to go, or None once the boundary is reached: then `end` is where."""
        off = self._x_m - senses.x_m
        side = self.side
        self.wrecks.update(dict.fromkeys(senses.wrecks))
        if self._around is not None:
            self.around_ticks += 1
            if self.around_ticks > AROUND_TICKS_MAX or abs(off) > AROUND_M:
                return None
            way = self._around.direction(senses, blocks, off)
            if way is not None:
                return way
            self._around, self._last_y_m, self._last_off_m = None, None, None
        if self._limit_mm is not None and (1000.0 * senses.y_m - self._limit_mm) * side >= 0.0:
            self.end, self.is_cut = End(self.slice, side, self._limit_mm), True
            return None
        last_y_m, self._last_y_m = self._last_y_m, senses.y_m
        last_off_m, self._last_off_m = self._last_off_m, off
        slow = last_y_m is not None and (senses.y_m - last_y_m) * side < 0.3 * self._step_m
        if _stops(senses, side, slow):
            if abs(off) <= BESIDE_SLICE_M:
                self.end = End(self.slice, side, mm(senses.y_m))
            return None
        if abs(off) < CROSSED_M:
            self._on_slice_y_m = senses.y_m
        # The bearing of a touch has the resolution of the switches. It does not tell to which side a wall leans that is
        # almost parallel to the slice. The motion does.
        leaves = last_off_m is not None and abs(off) > max(OFF_SLICE_M, abs(last_off_m) + PUSHED_M)
        if leaves and any(ny * side > BLOCKS or (not blocks and nx * off > 0.0) for nx, ny in senses.walls):
            if self._on_slice_y_m is not None:
                self.end = End(self.slice, side, mm(self._on_slice_y_m))
            return None
        if any(ny * side > 0.2 for _, ny in blocks):
            for end in self._parked(senses):
                if (end.slice, end.side) == (self.slice, side) and (end.y_mm / 1000.0 - senses.y_m) * side > 0.0:
                    self.end = end
                    return None
            self._around = Around(senses, (0.0, float(side)), LEFT_HAND if senses.tick // 200 % 2 else RIGHT_HAND)
            return self._around.direction(senses, blocks, off)
        vx = max(-0.7, min(0.7, off / self._step_m))
        return vx, side * math.sqrt(1.0 - vx * vx)


def _stops(senses: Senses, side: int, slow: bool) -> bool:
    """Return whether a wall stops a sweep towards `side`. A robot near by may also make a sweep slow."""
    steep = max([ny * side for _, ny in senses.walls], default=0.0)
    near = any(other.gap_m < NEAR_M and other.wreck is None for other in senses.robots)
    return steep > 0.9 or (slow and steep > (LEANS if near else BLOCKS))


class BoundaryTrace:
    """Follow the boundary from an end into the slab on the side `direction`, until it crosses a slice.

    Bodies may lead the robot to another boundary. An arc on which it went around a robot is not certain, unless the last touch
    before and the first after are in line with one wall.
    """

    def __init__(self, start: End, direction: int, grid: SliceGrid, parked: Parked) -> None:
        self.start, self.direction = start, direction
        self._parked = parked
        self._grid = grid
        self._follower = WallFollower(hand_of(start.side, direction), (float(direction), 0.0))
        self._inside = self._pressed = False
        self._began_y_m = 0.0
        self._x_m = grid.x_m(start.slice)
        self._last: Vector | None = None
        self._length_m = 0.0
        self._out_m = math.inf  # the length when it last left the slab
        self._extreme: Vector = (-math.inf, 0.0)
        self._wall_tick = -10
        self._touched_m: Vector = self._x_m, start.y_mm / 1000.0
        self._normals: tuple[Vector, ...] = ()
        self._led = False
        self.certain = True
        self.wrecks: dict[Wreck, None] = {}
        self.arc: TracedArc | None = None
        self.end: End | None = None

    def step(self, senses: Senses, blocks: Sequence[Vector]) -> Vector | None:
        """Return where to go, or None at a crossing: then `end` is where, and `arc` the fact if it is `certain`."""
        x, y, d = senses.x_m, senses.y_m, self.direction
        self.wrecks.update(dict.fromkeys(senses.wrecks))
        self._led = self._led or bool(blocks)
        if senses.walls:
            same = self._is_in_line(senses) or (self._is_beside(x, y) and not self._led)
            self.certain = self.certain and same
            self._led = False
            self._wall_tick, self._touched_m, self._normals = senses.tick, (x, y), senses.walls
        last = self._last
        if last is None:
            self._began_y_m = y
        else:
            self._length_m += math.hypot(x - last[0], y - last[1])
        depth = (x - self._x_m) * d
        if depth > self._extreme[0]:
            self._extreme = depth, y
        spacing = self._grid.spacing_m
        if depth > CROSSED_M:
            if not self._inside and self._length_m - self._out_m > CIRCLE_M:
                return None
            self._inside = True
        if depth > spacing + CROSSED_M:
            self._arrive(senses, self.start.slice + d, 1)
            return None
        if self._inside and depth < -CROSSED_M:
            if self._is_beyond(senses) or (blocks and self._is_occupied(senses)):
                self._arrive(senses, self.start.slice, -1)
                return None
            self._inside, self._out_m = False, self._length_m
        if depth < -SLACK_M:
            return None
        if blocks and self._inside and senses.walls:
            for end in self._parked(senses):
                if (end.slice, end.side) == (self.start.slice + d, self.start.side):
                    self._stop(end)
                    return None
        self._last = x, y
        self._pressed = self._pressed or bool(senses.walls or blocks)
        if not self._pressed and abs(y - self._began_y_m) < PRESS_M:
            return 0.0, float(self.start.side)
        return self._follower.direction(senses.walls, blocks)

    def _is_beyond(self, senses: Senses) -> bool:
        """Return whether the robot came to the other end of its slice; otherwise it was only pushed back.

        The wall beside the other end is on the other side. A wall almost parallel to the slice is on no side, and may also be
        beside the end where the trace began.
        """
        side = self.start.side
        lean = min([ny * side for _, ny in senses.walls], default=1.0)
        return lean < -LEANS or (lean < INTO and abs(senses.y_m - self.start.y_mm / 1000.0) > SHORT_M)

    def _is_occupied(self, senses: Senses) -> bool:
        """Return whether a robot in contact stands at the other end of the slice, so that no wall is felt there."""
        return any((end.slice, end.side) == (self.start.slice, -self.start.side) for end in self._parked(senses))

    def _arrive(self, senses: Senses, k: int, way: int) -> None:
        x, y, side = senses.x_m, senses.y_m, self.start.side * way
        if self._last is not None:
            line, (x0, y0) = self._grid.x_m(k), self._last
            if abs(x - x0) > 1e-9:
                y = y0 + max(0.0, min(1.0, (line - x0) / (x - x0))) * (y - y0)
        if senses.tick - self._wall_tick <= 1:
            self._stop(End(k, side, mm(y)))
            return
        # A robot hides the end: it stands there, or the arc stays open.
        self.end = End(k, side, mm(y))
        for end in self._parked(senses):
            if (end.slice, end.side) == (k, side) and self._is_beside(self._grid.x_m(k), end.y_mm / 1000.0):
                self._stop(end)

    def _is_beside(self, x_m: float, y_m: float) -> bool:
        """Return whether a point of the boundary is near enough to the last touch to be on the same one."""
        return math.hypot(x_m - self._touched_m[0], y_m - self._touched_m[1]) <= BESIDE_BODY_M

    def _is_in_line(self, senses: Senses) -> bool:
        """Return whether the wall in touch is the straight wall of the last touch, as far as touch tells."""
        dx, dy = senses.x_m - self._touched_m[0], senses.y_m - self._touched_m[1]
        return any(
            nx * mx + ny * my > 0.999 and abs(dx * nx + dy * ny) < IN_LINE_M
            for nx, ny in senses.walls
            for mx, my in self._normals
        )

    def _stop(self, end: End) -> None:
        depth, extreme_y = self._extreme
        extreme_x = self._x_m + self.direction * max(depth, 0.0)
        self.end = end
        self.arc = TracedArc(
            self.start, self.direction, end, mm(self._length_m), mm(extreme_x), mm(extreme_y), tuple(self.wrecks)
        )


class Seek:
    """From anywhere, go to the nearest slice: straight, and along the boundary where a wall is in the way."""

    def __init__(self, grid: SliceGrid) -> None:
        self._grid = grid
        self._follower: WallFollower | None = None
        self._last_x_m = math.nan
        self.slice = 0

    def step(self, senses: Senses, blocks: Sequence[Vector]) -> Vector | None:
        """Return where to go, or None on slice `slice`."""
        x = senses.x_m
        nearest = self._grid.nearest(x)
        line = self._grid.x_m(nearest)
        last, self._last_x_m = self._last_x_m, x
        if abs(x - line) < 0.02 or (last - line) * (x - line) < 0.0:
            self.slice = nearest
            return None
        if self._follower is None:
            way = math.copysign(1.0, line - x)
            ahead = [each for each in (*senses.walls, *blocks) if each[0] * way > BLOCKS]
            if not ahead:
                return way, 0.0
            # Slide along the obstacle, on the side that leads on.
            self._follower = WallFollower(LEFT_HAND if ahead[0][1] * way > 0.0 else RIGHT_HAND, (way, 0.0))
        return self._follower.direction(senses.walls, blocks)


Manoeuvre = Approach | SliceSweep | BoundaryTrace | Seek
