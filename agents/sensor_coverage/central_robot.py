"""The robot of sensor coverage: it stands and watches until the coordinator sends it somewhere, one drive at a time.

Each drive is a story, told as a generator that yields one velocity a tick. A robot decides for itself what is local: where it
is from the bearings it should see, whether it touches a wall, when a visual link breaks, when it has arrived. It knows
bearings, touch, its own odometry and its radio; it never turns on purpose, and its frame is nobody else's business.
"""

import math
from collections.abc import Generator, Sequence
from itertools import count
from typing import Annotated, NamedTuple

from msgspec import Meta, Struct

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.sensor_coverage.messages.commands import (
    LIVES,
    Answer,
    Arrived,
    Cleared,
    Correct,
    Deploy,
    Emerged,
    Landmark,
    Move,
    NegotiateLeave,
    Order,
    Release,
    Report,
    RollCall,
    ScanRequest,
)
from zwerm.agents.sensor_coverage.motion.homing import Offset, Vector, offset, slid, unit
from zwerm.agents.sensor_coverage.motion.odometry_frame import OdometryFrame
from zwerm.agents.sensor_coverage.protocols.deduplication import RequestDeduplicator
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission, Wake

STOP = BodyVelocity()
Story = Generator[BodyVelocity, None, None]

# Bearings that err less than this do not err.
NOISE_MIN_RAD = 1e-5

# Who was pushed aside needs not that long to go back; who cannot must still answer a survey in time.
RETURN_TICKS_MAX = 20

# Who is no further from where it came out has not left.
HOME_M = 0.05

# A contact within this of the heading is ahead.
AHEAD_RAD = math.pi / 3.0


Length = Annotated[float, Meta(gt=0.0, le=1000.0)]
Count = Annotated[int, Meta(ge=1)]


class RobotParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """What a scenario may set. `link_m` is r_v; neighbours shall be `margin_m` less apart."""

    link_m: Length = 1.0
    margin_m: Length = 0.05
    samples: Count = 16
    first_samples: Count = 10
    tolerance_m: Length = 0.005
    creep_m: Length = 0.02
    fine_m: Length = 0.005
    stop_samples: Count = 12
    still_samples_max: Count = 120
    drive_ticks_max: Count = 90

    def __post_init__(self) -> None:
        """Refuse a margin that leaves no link."""
        if self.margin_m >= self.link_m:
            raise ValueError("expected margin_m < link_m")


class TargetPoint(NamedTuple):
    """The way to a place [m], and how it is known.

    `loose`: odometry had to say part of it; `leaned`: landmarks that move had to; `spread` is the variance per that of a
    bearing.
    """

    x: float
    y: float
    loose: bool
    leaned: bool
    spread: float


class CentralRobot(Controller):
    """A robot of the swarm."""

    sensors = ("bearings", "touch", "odometry")
    Parameters = RobotParameters

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        p: RobotParameters = self.parameters
        self.hop_m = p.link_m - p.margin_m
        self.step_m = setup.body.max_speed_m_s * setup.dt_s if setup.body is not None else 0.0
        self.senses = OdometryFrame()
        self.duty = RequestDeduplicator(int(self.random.integers(1, LIVES)))
        self._outbox: list[Answer] = []
        self._rest: Vector | None = None
        self._noise_rad: float | None = None  # how much a bearing errs: the robot finds out for itself
        self._story: Story | None = self._emerge()

    def step(self, observation: Observation) -> Command:
        """Go on with the present drive, or start what an order asks for."""
        self.senses.take(observation)
        for packet in observation.inbox:
            order = self.duty.take(packet.payload)
            if order is not None:
                self._story = self._begin(order)
        drive, wake = STOP, None
        if self._story is not None:
            try:
                drive = next(self._story)
            except StopIteration:
                self._story = None
        if self._story is None:
            wake = Wake(on_packet=True)
        outbox = tuple(Transmission("uplink", each) for each in self.duty.say(self._outbox))
        self._outbox.clear()
        return Command(drive=drive, outbox=outbox, wake=wake)

    def _begin(self, order: Order) -> Story | None:
        match order:
            case RollCall():
                self._rest = None  # who was on its way stands where it is
                return self._survey(ScanRequest(order.cycle, (self.setup.node,)))
            case ScanRequest():
                return self._survey(order)
            case Deploy():
                return self._deploy(order)
            case Move():
                return self._move(order)
            case Correct():
                return self._correct(order)
            case Release() | NegotiateLeave():
                return None

    # --- standing still ---------------------------------------------------------------------------------------------

    def _emerge(self) -> Story:
        yield from self._sample()
        self._outbox.append(Emerged(self.senses.sightings()))

    def _sample(self) -> Story:
        """Stand still until everyone in sight has been averaged."""
        wanted = self._samples
        for _ in range(2 * wanted):
            self.senses.average()
            if self.senses.averaged(wanted):
                break
            yield STOP
        if self._noise_rad is None:
            self._noise_rad = self.senses.spread()

    @property
    def _samples(self) -> int:
        """How many readings make an average: one will do if bearings do not err."""
        if self._noise_rad is None:
            return int(self.parameters.first_samples)
        return int(self.parameters.samples) if self._noise_rad > NOISE_MIN_RAD else 1

    def _survey(self, order: ScanRequest) -> Story:
        if self._rest is not None:
            self._rest = yield from self._return(self._rest)
        self.senses.forget(order.moved)
        if self.setup.node in order.moved:
            self.senses.forget()
        fresh = not self.senses.averaged(1 if self._noise_rad is None else self._samples)
        if fresh:
            yield from self._sample()
        sightings = self.senses.sightings() if fresh else None
        home = math.hypot(self.senses.x_m, self.senses.y_m) < HOME_M
        self._outbox.append(Report(order.cycle, sightings, self.senses.touched, home))

    def _return(self, rest: Vector) -> Generator[BodyVelocity, None, Vector]:
        """Go back to where the robot rests, if it was pushed aside, and return where it rests now: some cannot."""
        p, senses = self.parameters, self.senses
        for _ in range(RETURN_TICKS_MAX):
            dx, dy = rest[0] - senses.x_m, rest[1] - senses.y_m
            if math.hypot(dx, dy) < p.tolerance_m:
                return rest
            dx, dy = slid(dx, dy, senses.touched)
            if math.hypot(dx, dy) < p.tolerance_m:
                break
            yield self._velocity(dx, dy)
        return senses.x_m, senses.y_m

    # --- into the unknown -------------------------------------------------------------------------------------------

    def _deploy(self, order: Deploy) -> Story:
        """Algorithm 1, line 8, with the test drive of section III-A, item iv.

        The robot may lose sight of everyone on its way: its follower comes to where it was, and the link is restored then.
        """
        senses = self.senses
        self.senses.forget()
        start = senses.x_m, senses.y_m
        ux, uy = unit(order.bearing_rad)
        cleared, stuck = False, 0
        touched: tuple[float, ...] = ()
        done = 0.0
        for _ in range(self.parameters.drive_ticks_max):
            now = (senses.x_m - start[0]) * ux + (senses.y_m - start[1]) * uy
            stuck = stuck + 1 if now < done + 0.2 * self.step_m else 0
            done = max(done, now)
            ahead = [b for b in senses.touched if _apart(b, order.bearing_rad) < AHEAD_RAD]
            if ahead or stuck > 5:
                touched = tuple(ahead)
                if done < order.clear_m:
                    yield from self._back(start)
                    self._arrive(order.cycle, False, driven_m=done, touched=touched)
                    return
                break
            if not cleared and done >= order.clear_m:
                cleared = True
                self._outbox.append(Cleared(order.cycle))
            if done >= order.hop_m - 1e-3:
                break
            # Back onto the line if a wall pushed the robot off it.
            aside = (senses.y_m - start[1]) * ux - (senses.x_m - start[0]) * uy
            left = min(order.hop_m - done, self.step_m)
            yield self._velocity(ux * left + uy * aside * 0.5, uy * left - ux * aside * 0.5)
        if not cleared:
            self._outbox.append(Cleared(order.cycle))
        self._arrive(order.cycle, True, driven_m=done, touched=touched)

    def _back(self, to: Vector, near_m: float | None = None) -> Story:
        """Drive to where odometry says that `to` is."""
        near_m = self.parameters.tolerance_m if near_m is None else near_m
        for _ in range(self.parameters.drive_ticks_max):
            dx, dy = to[0] - self.senses.x_m, to[1] - self.senses.y_m
            if math.hypot(dx, dy) < near_m:
                return
            yield self._velocity(dx, dy)

    # --- taking the place of the robot ahead ------------------------------------------------------------------------

    def _move(self, order: Move) -> Story:
        """Push: section III-B, by the visual homing of section II-D."""
        p, senses = self.parameters, self.senses
        senses.forget()
        start = senses.x_m, senses.y_m
        ux, uy = unit(order.bearing_rad)
        goal = start[0] + ux * order.hop_m, start[1] + uy * order.hop_m
        noisy = self._samples > 1
        near = 0.06 if noisy else p.tolerance_m
        lost = 0
        way = TargetPoint(0.0, 0.0, False, False, 0.0)
        for _ in range(p.drive_ticks_max):
            way = self._towards(order.landmarks, senses.seen, goal)
            dx, dy = way.x, way.y
            if math.hypot(dx, dy) < near:
                break
            lost = 0 if senses.seen else lost + 1
            if lost > 20:
                yield from self._back(start)
                self._arrive(order.cycle, False, loose=True)
                return
            far = math.hypot(senses.x_m - start[0], senses.y_m - start[1])
            gain = 1.0 if far < 0.5 * order.hop_m else 0.7
            x, y = slid(gain * dx, gain * dy, senses.touched)
            if math.hypot(x, y) < p.tolerance_m:
                break  # a wall is in the way
            yield self._velocity(x, y)
        else:
            if math.hypot(way.x, way.y) > 0.5 * order.hop_m > 0.0:
                self._arrive(order.cycle, False, way.loose, way.leaned)
                return
        if noisy and not way.leaned:
            way = yield from self._settle(order, goal)
        self._arrive(order.cycle, True, way.loose, way.leaned)

    def _settle(self, order: Move, goal: Vector) -> Generator[BodyVelocity, None, TargetPoint]:
        """Stand, average, step, and again: noise falls with the root of all samples, since odometry tells each step."""
        p, senses = self.parameters, self.senses
        ex = ey = 0.0
        way = TargetPoint(0.0, 0.0, False, False, 0.0)
        for stop in count(1):
            senses.forget()
            for _ in range(p.stop_samples):
                yield STOP
                senses.average()
            mean = {each.node: each.bearing_rad for each in senses.sightings()}
            way = self._towards(order.landmarks, mean, goal)
            ex, ey = ex + (way.x - ex) / stop, ey + (way.y - ey) / stop
            sx, sy = slid(ex, ey, senses.touched)
            wanted = ((self._noise_rad or 0.0) * self.hop_m / p.tolerance_m) ** 2 * way.spread
            enough = stop * p.stop_samples >= min(wanted, p.still_samples_max)
            if enough and stop > 1 and math.hypot(sx, sy) < p.tolerance_m:
                break
            x, y = senses.x_m, senses.y_m
            yield from self._back((x + sx, y + sy), 0.3 * p.tolerance_m)
            ex, ey = ex - (senses.x_m - x), ey - (senses.y_m - y)
            if enough and stop > 1:
                break
        return way

    def _towards(self, landmarks: Sequence[Landmark], seen: dict[int, float], goal: Vector) -> TargetPoint:
        """Return the way to go.

        Landmarks that stand still are preferred, where they are enough. One landmark is none: odometry must do.
        """
        rx, ry = goal[0] - self.senses.x_m, goal[1] - self.senses.y_m
        found, pairs = Offset(0.0, 0.0, None, False), []
        for still in (True, False):
            pairs = [
                (unit(seen[each.node]), unit(each.bearing_rad))
                for each in landmarks
                if each.node in seen and (each.still or not still)
            ]
            found = offset(pairs)
            if found.known and found.blind is None:
                return TargetPoint(found.x * self.hop_m, found.y * self.hop_m, False, not still, found.spread)
        if len(pairs) < 2 or not found.known or found.blind is None:
            return TargetPoint(rx, ry, True, False, 0.0)
        bx, by = found.blind
        along = rx * bx + ry * by
        return TargetPoint(
            found.x * self.hop_m + along * bx,
            found.y * self.hop_m + along * by,
            True,
            not all(each.still for each in landmarks if each.node in seen),
            found.spread,
        )

    # --- the ruler --------------------------------------------------------------------------------------------------

    def _correct(self, order: Correct) -> Story:
        """Scale correction, section III-C.2: the range of sight is the only measure there is."""
        p, senses = self.parameters, self.senses
        first: Vector | None = None
        for anchor in order.anchors:
            ax, ay = unit(senses.seen.get(anchor.node, anchor.bearing_rad))
            if first is not None:  # on a circle about the first anchor
                turn = ax * first[0] + ay * first[1]
                ax, ay = ax - turn * first[0], ay - turn * first[1]
                length = math.hypot(ax, ay)
                if length < 0.3:
                    break
                ax, ay = ax / length, ay / length
            away = math.atan2(-ay, -ax)
            driven = 0.0
            while anchor.node in senses.seen and driven < 0.4:
                if any(_apart(each, away) < AHEAD_RAD for each in senses.touched):
                    break
                driven += p.creep_m
                yield self._velocity(-ax * p.creep_m, -ay * p.creep_m)
            broken = anchor.node not in senses.seen
            driven = 0.0
            while anchor.node not in senses.seen and driven < 0.5:
                driven += p.fine_m
                yield self._velocity(ax * p.fine_m, ay * p.fine_m)
            if broken:
                x, y = senses.x_m + ax * p.margin_m, senses.y_m + ay * p.margin_m
                yield from self._back((x, y))
            if first is None:
                first = unit(senses.seen.get(anchor.node, anchor.bearing_rad))
        self._arrive(order.cycle, True)

    # --- means ------------------------------------------------------------------------------------------------------

    def _arrive(
        self,
        cycle: int,
        ok: bool,
        loose: bool = False,
        leaned: bool = False,
        driven_m: float = 0.0,
        touched: tuple[float, ...] = (),
    ) -> None:
        self.senses.forget()
        self._rest = self.senses.x_m, self.senses.y_m
        self._outbox.append(Arrived(cycle, ok, loose, leaned, driven_m, touched))

    def _velocity(self, x_m: float, y_m: float) -> BodyVelocity:
        """Return the drive that goes (x, y) in the robot's first frame within a tick, or as far of it as it can."""
        length = math.hypot(x_m, y_m)
        scale = min(1.0, self.step_m / length) / self.setup.dt_s if length > 0.0 else 0.0
        cos, sin = math.cos(self.senses.turned_rad), math.sin(self.senses.turned_rad)
        return BodyVelocity((cos * x_m + sin * y_m) * scale, (cos * y_m - sin * x_m) * scale)


def _apart(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))
