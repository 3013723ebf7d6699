"""The pilot: carries out one manoeuvre at a time among other bodies, without collisions.

The traffic rules depend only on the robot's own senses. If two robots meet head-on, the one with the smaller id waits,
and the other goes around. A robot goes around a standing robot after a short wait. A robot that makes no progress goes
back along its own trail, waits, and comes forward again. The distance is random, and doubles with every attempt. So if
two robots meet in a passage for one, one of them leaves it backwards. Two robots that go around each other make no
progress either: if a retreat does not help them, the manoeuvre has failed. The speed towards another body is limited to
half of the gap a tick.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from zwerm.agents.robot_teams.motion.manoeuvres import Manoeuvre
from zwerm.agents.robot_teams.motion.senses import Beside, Senses
from zwerm.agents.robot_teams.motion.wall_following import Vector

# A robot nearer than this [m], beyond the gap that is kept, is in contact.
CONTACT_M: Final = 0.04
# Time that a robot waits for one that stands, and for one that has the right of way [s].
STANDING_WAIT_S: Final = 0.5
MOVING_WAIT_S: Final = 3.0
# No progress: less than this distance in this time.
HEADWAY_M: Final = 0.2
HEADWAY_S: Final = 4.0
# Circling: within this distance for this time, in contact with other robots at some time.
CIRCLE_M: Final = 2.0
CIRCLE_S: Final = 15.0
# A robot nearer than this to where it was before has closed a circle [m].
CLOSED_M: Final = 0.3
# Number of retreats after which the manoeuvre has failed.
ATTEMPTS_MAX: Final = 5
# The longest retreat, on average [m].
RETREAT_M: Final = 4.0
# Distance between the points of the trail, and their number.
TRAIL_STEP_M: Final = 0.08
TRAIL_POINTS: Final = 600
# Time that another robot may press against an idle robot before the idle robot moves away [s].
PRESSED_S: Final = 2.0

RUNNING: Final = "running"
IDLE: Final = "idle"
DONE: Final = "done"
FAILED: Final = "failed"


class Retreat:
    """Back along the trail, a pause, and forward again."""

    def __init__(self, trail: list[Vector], far_m: float, pause_ticks: int) -> None:
        self._trail = trail
        self._index = len(trail) - 1
        self._stop = max(0, len(trail) - 1 - math.ceil(far_m / TRAIL_STEP_M))
        self._pause = pause_ticks
        self._forward = self._paused = False
        self._still = 0
        self._ticks = 0
        self._patience = 40
        self._leg_ticks = 4 * (len(trail) - 1 - self._stop) + 60

    def step(self, senses: Senses, moved_m: float) -> Vector | None:
        """Return where to go, (0, 0) to wait, or None when the robot is back where it began."""
        self._still = self._still + 1 if moved_m < 0.01 else 0
        self._ticks += 1
        late = self._still > self._patience or self._ticks > self._leg_ticks
        if not self._forward and (self._index <= self._stop or late or self._paused):
            self._paused = True
            self._pause -= 1
            if self._pause > 0:
                return 0.0, 0.0
            self._forward, self._still, self._ticks = True, 0, 0
        goal = len(self._trail) - 1 if self._forward else self._stop
        while True:
            x, y = self._trail[self._index]
            dx, dy = x - senses.x_m, y - senses.y_m
            distance = math.hypot(dx, dy)
            near = 0.06 if self._index == goal else 0.2
            if distance > near:
                return _around_robots(senses, (dx / distance, dy / distance))
            if self._index == goal:
                return None if self._forward else (0.0, 0.0)
            self._index += 1 if self._forward else -1

    @property
    def blocked(self) -> bool:
        """True if a robot is in the way forward again."""
        return self._forward and (self._still > self._patience or self._ticks > self._leg_ticks)


def _around_robots(senses: Senses, way: Vector) -> Vector:
    """Return `way`, turned to the right where a robot is in it."""
    for other in senses.robots:
        if other.gap_m < CONTACT_M and way[0] * other.nx + way[1] * other.ny > 0.2:
            return 0.5 * way[0] + 0.87 * way[1], 0.5 * way[1] - 0.87 * way[0]
    return way


class Headway:
    """A robot's progress since the last `reset`: whether it stands, and whether it circles with other robots."""

    def __init__(self, dt_s: float) -> None:
        self._stand_ticks, self._circle_ticks = round(HEADWAY_S / dt_s), round(CIRCLE_S / dt_s)
        self.reset()

    def reset(self) -> None:
        """Begin again at the robot's next place."""
        self._stand: Vector = (math.inf, 0.0)
        self._circle: Vector = (math.inf, 0.0)
        self._stand_tick = self._circle_tick = 0
        self._touched = False
        self.gained = self.stands = self.circles = False

    def note(self, senses: Senses, touches: bool) -> None:
        """Take in one tick; `touches` is true in contact with a robot. `gained` is true after `HEADWAY_M` more."""
        tick = senses.tick
        self.gained = _apart(senses, self._stand) > HEADWAY_M
        if self.gained:
            self._stand, self._stand_tick = (senses.x_m, senses.y_m), tick
        if _apart(senses, self._circle) > CIRCLE_M:
            self._circle, self._circle_tick, self._touched = (senses.x_m, senses.y_m), tick, False
        self._touched = self._touched or touches
        self.stands = tick - self._stand_tick > self._stand_ticks
        self.circles = self._touched and tick - self._circle_tick > self._circle_ticks


def _apart(senses: Senses, place: Vector) -> float:
    return math.hypot(senses.x_m - place[0], senses.y_m - place[1])


class Pilot:
    """Steers one robot; `state` is the state of its manoeuvre."""

    def __init__(self, node: int, speed_m_s: float, dt_s: float, random: np.random.Generator) -> None:
        self.state = IDLE
        self.retreats = 0
        self._node = node
        self._speed_m_s, self._dt_s = speed_m_s, dt_s
        self._random = random
        self._manoeuvre: Manoeuvre | None = None
        self._wanted: Vector = (0.0, 0.0)
        self._contact_ticks: dict[int, int] = {}
        self._trail: list[Vector] = []
        self._retreat: Retreat | None = None
        self._attempts = 0
        self._last: Vector | None = None
        self._headway = Headway(dt_s)
        self._failed_at: Vector = (math.inf, 0.0)

    def start(self, manoeuvre: Manoeuvre) -> None:
        """Begin a manoeuvre."""
        self._manoeuvre = manoeuvre
        self.state = RUNNING
        self._headway.reset()

    def rest(self) -> None:
        """End the manoeuvre: stand, and move aside for others."""
        self._manoeuvre, self.state = None, IDLE

    def give_up(self) -> None:
        """Mark the manoeuvre as failed, if there is one."""
        self._manoeuvre, self._retreat, self.state = None, None, FAILED

    def stand(self, senses: Senses) -> Vector:
        """Return the velocity of a robot that has nothing left to do: it moves aside for others."""
        if self.state != IDLE:
            self.rest()
        return self.step(senses)

    def step(self, senses: Senses) -> Vector:
        """Return the velocity [m/s] in the frame of the arena; `state` changes to DONE or FAILED when the manoeuvre ends."""
        here = senses.x_m, senses.y_m
        moved = 0.0 if self._last is None else math.hypot(here[0] - self._last[0], here[1] - self._last[1])
        self._last = here
        blocks, waits = self._contacts(senses)
        way = self._way(senses, blocks, moved)
        if self.state in (DONE, FAILED):
            return 0.0, 0.0
        self._wanted = way
        if waits and self._retreat is None and self._into(senses, way):
            way = (0.0, 0.0)
        return self._limited(senses, way)

    def _way(self, senses: Senses, blocks: Sequence[Vector], moved_m: float) -> Vector:
        if self._retreat is not None:
            way = self._retreat.step(senses, moved_m)
            if way is None:
                self._retreat = None
                self._headway.reset()
            elif self._retreat.blocked:
                self._retire_or_retry(senses)
                return 0.0, 0.0
            else:
                return way
        self._leave_trail(senses)
        if self._manoeuvre is None:
            if max(self._contact_ticks.values(), default=0) * self._dt_s > PRESSED_S:
                self._contact_ticks.clear()
                self._begin_retreat(senses, 2.0)
            return 0.0, 0.0
        way = self._manoeuvre.step(senses, blocks)
        if way is None:
            self.state = DONE
            return 0.0, 0.0
        headway = self._headway
        headway.note(senses, bool(self._contact_ticks))
        if headway.gained and _apart(senses, self._failed_at) > CIRCLE_M:
            self._attempts = 0
        if headway.circles:
            if self._attempts > 0:
                self._fail()
                return 0.0, 0.0
            self._leave_circle(senses)
        if headway.stands or headway.circles:
            self._retire_or_retry(senses)
            return 0.0, 0.0
        return way

    def _leave_circle(self, senses: Senses) -> None:
        """Take the circles off the trail, so that the retreat leads out of them."""
        for index, place in enumerate(self._trail):
            if _apart(senses, place) < CLOSED_M:
                del self._trail[index + 1 :]
                return

    def _retire_or_retry(self, senses: Senses) -> None:
        self._attempts += 1
        self._retreat = None
        if self._attempts > ATTEMPTS_MAX or not senses.robots:
            self._fail()
        else:
            self._failed_at = senses.x_m, senses.y_m
            self._begin_retreat(senses, min(RETREAT_M, 0.5 * 2.0**self._attempts))

    def _fail(self) -> None:
        self.state = FAILED
        self._attempts = 0

    def _begin_retreat(self, senses: Senses, scale_m: float) -> None:
        self.retreats += 1
        far = scale_m * (0.5 + float(self._random.random()))
        pause = int((0.5 + min(4.0, scale_m) * float(self._random.random())) / self._dt_s)
        self._trail.append((senses.x_m, senses.y_m))
        self._retreat = Retreat(list(self._trail), far, pause)

    def _leave_trail(self, senses: Senses) -> None:
        trail = self._trail
        if not trail or _apart(senses, trail[-1]) > TRAIL_STEP_M:
            trail.append((senses.x_m, senses.y_m))
            if len(trail) > TRAIL_POINTS:
                del trail[: TRAIL_POINTS // 4]

    def _contacts(self, senses: Senses) -> tuple[list[Vector], bool]:
        """Return the bodies to go around, and whether to wait for one ahead."""
        blocks: list[Vector] = []
        waits = False
        touched: dict[int, int] = {}
        wx, wy = self._wanted
        for other in senses.robots:
            if other.gap_m > CONTACT_M or other.wreck is not None:
                continue  # a wreck is a wall
            ticks = touched[other.node] = self._contact_ticks.get(other.node, 0) + 1
            if wx * other.nx + wy * other.ny > 0.2:
                if self._goes_first(other, ticks):
                    waits = True
                    continue
                if not other.stands and other.dx_m * other.nx + other.dy_m * other.ny > 0.002:
                    continue  # it goes ahead in the same direction: follow it
            blocks.append((other.nx, other.ny))
        self._contact_ticks = touched
        return blocks, waits

    def _goes_first(self, other: Beside, ticks: int) -> bool:
        if other.stands:
            return ticks * self._dt_s < STANDING_WAIT_S
        if other.dx_m * other.nx + other.dy_m * other.ny > 0.002:
            return False
        return self._node < other.node and ticks * self._dt_s < MOVING_WAIT_S

    def _into(self, senses: Senses, way: Vector) -> bool:
        return any(
            r.gap_m <= CONTACT_M and r.wreck is None and way[0] * r.nx + way[1] * r.ny > 0.2 for r in senses.robots
        )

    def _limited(self, senses: Senses, way: Vector) -> Vector:
        """Return the velocity along `way`, limited so that it closes at most half of a gap in one tick."""
        vx, vy = way[0] * self._speed_m_s, way[1] * self._speed_m_s
        for other in senses.robots:
            limit = other.gap_m / (2.0 * self._dt_s)
            closing = vx * other.nx + vy * other.ny
            if closing > limit:
                vx -= (closing - limit) * other.nx
                vy -= (closing - limit) * other.ny
        # Walls deflect the motion, one after the other: no motion on the way there may lead into a body either. A wreck is
        # among the walls, and another wall may turn the robot back into it.
        motions = [(vx, vy)]
        for nx, ny in senses.walls:
            wx, wy = motions[-1]
            into = wx * nx + wy * ny
            if into > 0.0:
                motions.append((wx - into * nx, wy - into * ny))
        scale = 1.0
        for other in senses.robots:
            limit = max(0.0, other.gap_m) / (2.0 * self._dt_s)
            closing = max(wx * other.nx + wy * other.ny for wx, wy in motions)
            if closing > limit + 1e-6:
                scale = min(scale, limit / closing)
        return vx * scale, vy * scale
