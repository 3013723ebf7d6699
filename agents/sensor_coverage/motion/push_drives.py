"""The three drives of a push: deploy into unknown space, move to the slot ahead, and correct the scale.

Each drive is a generator that yields one velocity a tick and returns a `DriveResult`. The coordinator's robots and the
decentralised robots use the same drives.
"""

import math
from collections.abc import Callable, Generator, Sequence
from itertools import count
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.messages.commands import Landmark, Sighting
from zwerm.agents.sensor_coverage.motion.homing import Vector, slide, unit
from zwerm.agents.sensor_coverage.motion.landmark_target import TargetPoint, target_point
from zwerm.agents.sensor_coverage.motion.locomotion import STOP, Locomotion
from zwerm.agents.sensor_coverage.motion.odometry_frame import Touched
from zwerm.agents.sensor_coverage.motion.walls.wall_heading import hand_on_wall
from zwerm.wire.messages import BodyVelocity

# A contact within this angle of the heading is ahead.
AHEAD_RAD: Final = math.pi / 3.0
# A deployment is stuck after this many ticks with less than this fraction of a full step forward.
STUCK_TICKS: Final = 5
STUCK_FRACTION: Final = 0.2
# A bounded deployment gives up this many ticks after it would be clear at full speed; the way back takes up to this many more
# than at full speed.
LATE_TICKS: Final = 8
# A deployment ends this close [m] to its full length.
HOP_TOLERANCE_M: Final = 1e-3
# A move with noisy bearings stops this close [m] to the goal and averages.
NOISY_NEAR_M: Final = 0.06
# Longest step [m] between two averages there. Where a wall has stopped the move far from its goal, the landmarks give the
# direction of the goal, but not its distance.
NOISY_STEP_M: Final = 0.1
# Bound of the ticks of this step: a body or a wall may be in the way.
STEP_TICKS: Final = 8
# A robot that homes again at its slot and is closer to it than this [m], by single readings, averages once.
HOMED_M: Final = 0.18
# A move that a wall stops further from the goal than this [m] goes on by odometry: it may pass the wall on its straight way.
STOPPED_M: Final = 0.15
# It is in touch with the wall if it was so in one of this many ticks: it may bounce.
TOUCH_TICKS: Final = 3
# If a wall stops that way, too, the robot follows the wall for this many ticks, until it is nearer to the goal by this [m].
CORNER_TICKS: Final = 12
CORNER_NEARER_M: Final = 0.1
# A move drives back after this many ticks without a visible robot.
LOST_TICKS: Final = 20
# Fraction of the offset to drive in the second half of a move.
LATE_GAIN: Final = 0.7
# Longest way [m] to creep forward until a link breaks, and back until it is restored.
BREAK_M_MAX: Final = 0.4
RESTORE_M_MAX: Final = 0.5
# A second anchor is skipped if less than this fraction of its direction is perpendicular to the first.
PERPENDICULAR_MIN: Final = 0.3
# A robot that looks for a link drives this far [m] past the place where the link was, by odometry.
PAST_M: Final = 0.1
# Bound of the ticks to drive back to one point of the way: a body or a wall may be in the way.
POINT_TICKS: Final = 8


class DriveResult(NamedTuple):
    """The end of a drive; the fields have the meaning of `Arrived`.

    `robots` are the robots in touch with a deployment that stopped early.
    """

    ok: bool
    used_odometry: bool = False
    used_moving_landmarks: bool = False
    driven_m: float = 0.0
    touched: tuple[float, ...] = ()
    robots: tuple[Touched, ...] = ()


DriveToResult = Generator[BodyVelocity, None, DriveResult]


def back_ticks(motion: Locomotion, clear_m: float) -> int:
    """Return the ticks after which a bounded deployment that was stopped before it was clear is back at its start."""
    return 2 * (math.ceil(clear_m / motion.step_m) + LATE_TICKS)


def deploy(
    motion: Locomotion,
    bearing_rad: float,
    hop_m: float,
    clear_m: float,
    on_cleared: Callable[[], None],
    bounded: bool = False,
) -> DriveToResult:
    """Drive into unknown space. Algorithm 1, line 8, with the test drive of section III-A, item iv.

    The robot may lose all visual links on its way: its follower drives to its start, and the link is restored then.
    `on_cleared` is called once the robot has driven `clear_m`. A `bounded` one that a wall stops is back in `back_ticks`.
    """
    frame = motion.frame
    frame.forget()
    start = motion.position
    ux, uy = unit(bearing_rad)
    cleared, stuck = False, 0
    out_ticks = back_ticks(motion, clear_m) // 2 if bounded else motion.parameters.drive_ticks_max
    touched: tuple[float, ...] = ()
    done = 0.0
    for ticks in range(motion.parameters.drive_ticks_max):
        now = (frame.x_m - start[0]) * ux + (frame.y_m - start[1]) * uy
        stuck = stuck + 1 if now < done + STUCK_FRACTION * motion.step_m else 0
        done = max(done, now)
        ahead = [each for each in frame.touched if angle_between(each, bearing_rad) < AHEAD_RAD]
        late = ticks >= out_ticks and done < clear_m
        if late:  # a body that it pushes slows it down
            late = all(each.node is None for each in frame.contacts)
        if ahead or stuck > STUCK_TICKS or late:
            touched = tuple(ahead)
            robots = tuple(each for each in frame.contacts if each.node is not None)
            if done < clear_m:
                yield from motion.drive_to(start)
                return DriveResult(False, driven_m=done, touched=touched, robots=robots)
            break
        if not cleared and done >= clear_m:
            cleared = True
            on_cleared()
        if done >= hop_m - HOP_TOLERANCE_M:
            break
        # A wall may have displaced the robot from its line: drive back onto it.
        aside = (frame.y_m - start[1]) * ux - (frame.x_m - start[0]) * uy
        left = min(hop_m - done, motion.step_m)
        yield motion.velocity(ux * left + uy * aside * 0.5, uy * left - ux * aside * 0.5)
    if not cleared:
        on_cleared()
    return DriveResult(True, driven_m=done, touched=touched)


def move(
    motion: Locomotion, bearing_rad: float, hop_m: float, landmarks: Sequence[Landmark], knows_way: bool = True
) -> DriveToResult:
    """Drive to the slot ahead. Section III-B, by the visual homing of section II-D.

    Without `knows_way` the bearing and the length of the way are unknown, and landmarks alone lead to the slot.
    """
    p, frame = motion.parameters, motion.frame
    frame.forget()
    start = motion.position
    ux, uy = unit(bearing_rad)
    goal = start[0] + ux * hop_m, start[1] + uy * hop_m
    scale_m = min(hop_m, motion.hop_m) if hop_m > 0.0 else motion.hop_m
    noisy = motion.samples > 1
    lost = 0
    target = TargetPoint(0.0, 0.0)
    passing = _Passing(motion)
    for _ in range(p.drive_ticks_max):
        target = target_point(landmarks, frame.seen, _offset(motion, goal) if knows_way else None, scale_m)
        if noisy and hop_m == 0.0 and target.distance_m < HOMED_M and not _waits_for_others(target):
            return (yield from _home_once(motion, landmarks, scale_m))
        approaches = noisy and not target.used_moving_landmarks  # else odometry leads to the goal
        if target.distance_m < (NOISY_NEAR_M if approaches else p.tolerance_m):
            if not approaches:
                # All robots come from the same side. If each stopped a little before the goal, the slot would drift.
                yield motion.velocity(*slide(target.x, target.y, frame.touched))
            break
        lost = 0 if frame.seen else lost + 1
        if lost > LOST_TICKS:
            yield from motion.drive_to(start)
            return DriveResult(False, used_odometry=True)
        far_m = math.hypot(frame.x_m - start[0], frame.y_m - start[1])
        gain = 1.0 if far_m < 0.5 * hop_m else LATE_GAIN
        x, y = slide(gain * target.x, gain * target.y, frame.touched)
        stopped = math.hypot(x, y) < p.tolerance_m
        if knows_way and passing.by_odometry(_offset(motion, goal), target.distance_m, stopped):
            x, y = slide(*_offset(motion, goal), frame.touched)
            if math.hypot(x, y) < p.tolerance_m:
                passing.stop(_offset(motion, goal), target.distance_m)
        if passing.is_stopped and hop_m > 0.0:
            passing.is_stopped = False
            yield from _round_corner(motion, goal)
            continue
        if math.hypot(x, y) < p.tolerance_m:
            break  # a wall is in the way
        yield motion.velocity(x, y)
    else:
        if target.distance_m > 0.5 * hop_m > 0.0:
            return DriveResult(False, target.used_odometry, target.used_moving_landmarks)
    if noisy and not target.used_moving_landmarks:
        target = yield from _approach(motion, landmarks, goal, scale_m)
    return DriveResult(True, target.used_odometry, target.used_moving_landmarks)


class _Passing:
    """Whether a wall has stopped a move on the way that its landmarks show, and it goes on by odometry, once."""

    def __init__(self, motion: Locomotion) -> None:
        self._motion = motion
        self._nearest_m = math.inf
        self._stuck = self._untouched = 0
        self.is_stopped = False  # a wall stops the way by odometry, too
        self._ways = 0  # 1 while the move goes on by odometry, 2 after that

    def by_odometry(self, by_odometry: Vector, target_m: float, stopped: bool) -> bool:
        """Return whether to go on by odometry.

        Takes the offset [m] to the goal by odometry, the distance [m] by landmarks, and whether a wall stops the way there.
        """
        away_m = math.hypot(*by_odometry)
        goes_on = away_m < self._nearest_m - STUCK_FRACTION * self._motion.step_m
        self._stuck = 0 if goes_on else self._stuck + 1
        self._nearest_m = min(self._nearest_m, away_m)
        self._untouched = 0 if self._motion.frame.touched else self._untouched + 1
        is_stuck = self._stuck > STUCK_TICKS
        if self._ways == 1 and (is_stuck or away_m < NOISY_NEAR_M):
            self.stop(by_odometry, target_m)
        elif (
            self._ways == 0
            and (is_stuck or stopped)
            and self._untouched < TOUCH_TICKS
            and min(target_m, away_m) > STOPPED_M
        ):
            self._ways, self._stuck = 1, 0
        return self._ways == 1

    def stop(self, by_odometry: Vector, target_m: float) -> None:
        """Go on by odometry no more: the goal is near, or a wall stops this way, too."""
        self._ways = 2
        self.is_stopped = min(target_m, math.hypot(*by_odometry)) > STOPPED_M


def _round_corner(motion: Locomotion, goal: Vector) -> Generator[BodyVelocity, None, None]:
    """Follow the wall in touch with either hand, until the goal [m] is nearer by odometry; else return."""
    frame, start = motion.frame, motion.position
    start_m = math.hypot(*_offset(motion, goal))
    for hand in (1, -1):
        x, y = _offset(motion, goal)
        wall_rad = math.atan2(y, x)
        for _ in range(CORNER_TICKS):
            if math.hypot(*_offset(motion, goal)) < start_m - CORNER_NEARER_M:
                return
            heading, wall_rad = hand_on_wall(wall_rad, frame.contacts, hand)
            ux, uy = unit(heading)
            yield motion.velocity(ux * motion.step_m, uy * motion.step_m)
        yield from motion.drive_to(start)


def _approach(
    motion: Locomotion, landmarks: Sequence[Landmark], goal: Vector, scale_m: float
) -> Generator[BodyVelocity, None, TargetPoint]:
    """Stop, average, step, and repeat.

    The error falls with the square root of the number of all readings, because odometry measures each step.
    """
    p, frame = motion.parameters, motion.frame
    ex = ey = 0.0
    target = TargetPoint(0.0, 0.0)
    for stop in count(1):
        frame.forget()
        for _ in range(p.stop_samples):
            yield STOP
            frame.average()
        target = target_point(landmarks, frame.averages(), _offset(motion, goal), scale_m)
        ex, ey = ex + (target.x - ex) / stop, ey + (target.y - ey) / stop
        sx, sy = slide(ex, ey, frame.touched)
        wanted = ((motion.bearing_noise_rad or 0.0) * motion.hop_m / p.tolerance_m) ** 2 * target.spread
        enough = stop * p.stop_samples >= min(wanted, p.still_samples_max)
        if enough and stop > 1 and math.hypot(sx, sy) < p.tolerance_m:
            yield motion.velocity(sx, sy)
            break
        x, y = motion.position
        part = min(1.0, NOISY_STEP_M / max(math.hypot(sx, sy), NOISY_STEP_M))
        yield from motion.drive_to((x + part * sx, y + part * sy), 0.3 * p.tolerance_m, STEP_TICKS)
        ex, ey = ex - (frame.x_m - x), ey - (frame.y_m - y)
        if enough and stop > 1:
            break
    return target


def _waits_for_others(target: TargetPoint) -> bool:
    """Return whether too few landmarks stand at their slots, but others that will do so determine the target."""
    return target.used_moving_landmarks and not target.used_odometry


def _home_once(motion: Locomotion, landmarks: Sequence[Landmark], scale_m: float) -> DriveToResult:
    """Average, and drive to where the landmarks show the slot.

    All landmarks stand, but robots of a single file, of which none has returned to its slot yet, are landmarks of each other.
    A longer average is no use for them.
    """
    frame = motion.frame
    for _ in range(motion.parameters.stop_samples):
        yield STOP
        frame.average()
    target = target_point(landmarks, frame.averages(), (0.0, 0.0), scale_m)
    x, y = slide(target.x, target.y, frame.touched)
    part = min(1.0, NOISY_STEP_M / max(math.hypot(x, y), NOISY_STEP_M))
    yield from motion.drive_to((frame.x_m + part * x, frame.y_m + part * y), ticks_max=STEP_TICKS)
    return DriveResult(True, target.used_odometry, target.used_moving_landmarks)


def correct(motion: Locomotion, anchors: Sequence[Sighting]) -> DriveToResult:
    """Correct the scale. Section III-C.2: the range of sight is the only known distance."""
    p, frame = motion.parameters, motion.frame
    first: Vector | None = None
    for anchor in anchors:
        ax, ay = unit(frame.seen.get(anchor.node, anchor.bearing_rad))
        if first is not None:  # stay at the corrected distance to the first anchor
            along = ax * first[0] + ay * first[1]
            ax, ay = ax - along * first[0], ay - along * first[1]
            length = math.hypot(ax, ay)
            if length < PERPENDICULAR_MIN:
                break
            ax, ay = ax / length, ay / length
        away = math.atan2(-ay, -ax)
        driven_m = 0.0
        while anchor.node in frame.seen and driven_m < BREAK_M_MAX:
            if any(angle_between(each, away) < AHEAD_RAD for each in frame.touched):
                break
            driven_m += p.creep_m
            yield motion.velocity(-ax * p.creep_m, -ay * p.creep_m)
        broken = anchor.node not in frame.seen
        driven_m = 0.0
        while anchor.node not in frame.seen and driven_m < RESTORE_M_MAX:
            driven_m += p.fine_m
            yield motion.velocity(ax * p.fine_m, ay * p.fine_m)
        if broken:
            x, y = frame.x_m + ax * p.margin_m, frame.y_m + ay * p.margin_m
            yield from motion.drive_to((x, y))
        if first is None:
            first = unit(frame.seen.get(anchor.node, anchor.bearing_rad))
    return DriveResult(True)


def regain(motion: Locomotion, node: int, goal: Vector, bearing_rad: float | None = None) -> DriveToResult:
    """Drive by odometry to where a robot was in sight, until it is, and `margin_m` further; else drive back.

    The last `PAST_M` of the way lead on past the goal, or along `bearing_rad`.
    A wall, or noise, may have stopped a move a little before its goal. Beside a door that hides the room behind it.
    """
    p, frame, start = motion.parameters, motion.frame, motion.position
    x, y = _offset(motion, goal)
    ux, uy = unit(math.atan2(y, x) if bearing_rad is None else bearing_rad)
    way_m, seen_m = math.hypot(x, y) + PAST_M, math.inf
    for step in range(math.ceil(way_m / p.creep_m)):
        driven_m = step * p.creep_m
        if node not in frame.seen:
            seen_m = math.inf
        elif seen_m + p.margin_m <= driven_m:
            break
        else:
            seen_m = min(seen_m, driven_m)
        yield motion.velocity(*slide(ux * p.creep_m, uy * p.creep_m, frame.touched))
    if node not in frame.seen:
        yield from motion.drive_to(start)
    return DriveResult(node in frame.seen, used_odometry=True)


def drive_back(motion: Locomotion, way: Sequence[Vector], sees: Callable[[], bool]) -> DriveToResult:
    """Drive back on the points [m] of a way until `sees()` holds, and `margin_m` further. `ok`: it holds at the end."""
    margin_m = motion.parameters.margin_m
    seen_at: Vector | None = None
    for goal in reversed(tuple(way)):
        for _ in range(POINT_TICKS):
            seen_at = (seen_at or motion.position) if sees() else None
            if seen_at is not None and math.dist(seen_at, motion.position) >= margin_m:
                return DriveResult(True, used_odometry=True)
            x, y = motion.position
            dx, dy = slide(goal[0] - x, goal[1] - y, motion.frame.touched)
            if math.hypot(dx, dy) < motion.parameters.tolerance_m:
                break
            yield motion.velocity(dx, dy)
    return DriveResult(sees(), used_odometry=True)


def _offset(motion: Locomotion, goal: Vector) -> Vector:
    return goal[0] - motion.frame.x_m, goal[1] - motion.frame.y_m
