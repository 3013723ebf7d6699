"""Following a wall in touch, by which a robot proves that a stretch of wall has no opening that its body fits through.

The robot keeps a hand on the wall: of all directions that its contacts allow, it takes the one that turns most towards
the hand. So it enters every opening that is wider than its body, and turns back at the end of every niche. Robots in
its way are passed in the same manner, but the robot does not press against them. It pushes bodies of dead robots, and
passes those as walls that do not yield (`dead_bodies`).
"""

import math
from collections.abc import Callable, Collection, Generator, Iterable, Sequence
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.messages.commands import LOST, MET, OPEN, SHUT, STRETCH, NearWalls, Sighting, Waypoint
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit
from zwerm.agents.sensor_coverage.motion.locomotion import Locomotion
from zwerm.agents.sensor_coverage.motion.walls.dead_bodies import DeadBodies, HeldPoints
from zwerm.agents.sensor_coverage.motion.walls.near_arcs import NearPoint, NearPoints, NearWay, start_in_sight
from zwerm.agents.sensor_coverage.motion.walls.past_edge import EDGE_M_MAX, past_edge
from zwerm.agents.sensor_coverage.motion.walls.touched_robots import RobotsInReach, TouchedRobots
from zwerm.agents.sensor_coverage.motion.walls.wall_heading import hand_on_wall
from zwerm.agents.sensor_coverage.motion.walls.waypoint_choice import WaypointChoice, first_of_message
from zwerm.wire.messages import BodyVelocity

# The robot is lost in free space after so much turning without a contact.
TURNS_RAD_MAX: Final = 3.0 * math.tau
# A contact within this angle of the heading stops the way to the wall. It is less than the angle that a touched wall
# closes beside its direction (`frontier.wall_proof.TOUCH_RAD`), so a wall ahead always closes the heading.
AHEAD_RAD: Final = math.radians(40.0)
# The way to a wall ends after this many ticks with less than this fraction of a full step.
STUCK_TICKS: Final = 5
STUCK_FRACTION: Final = 0.2
# A walk ends after this many ticks in a row with less than that: the robot is wedged between walls and robots.
WEDGED_TICKS: Final = 30
# Distance [m] within which a robot must get clear of its start.
CLEARING_M_MAX: Final = 3.0
# The walking robot leaves its slot by this distance [m] before the next robot takes it: two bodies and some space.
CLEAR_M: Final = 0.3
# A robot in touch within this angle of the direction back to the start stands there.
ROBOT_BEHIND_RAD: Final = math.radians(60.0)
# Length [m] of one leg of a walk: after each leg it is decided whether the walk goes on.
LEG_M: Final = 3.0
# Longest way [m] of a station's first robot to a wall.
FIRST_HOP_M: Final = 0.95
# Number of consecutive legs that closed nothing after which a walk ends.
IDLE_LEGS_MAX: Final = 2


class WalkResult(NamedTuple):
    """The end of a walk; the fields have the meaning of `Walked`. `way` is that close to the start, if there was one."""

    end: str
    driven_m: float = 0.0
    waypoints: tuple[Waypoint, ...] = ()
    near: NearWalls = NearWalls()
    way: NearWay | None = None


DriveToWalk = Generator[BodyVelocity, None, WalkResult]


class WallWalk:
    """The walk of one robot along walls, over several commands: its trail, and the direction of the wall it has in touch.

    `on_step` is called with each point of a walk along a wall, one a tick; points at bodies of dead robots are held back.
    `dead` are the robots that are known to be dead, which may change. `swept_only` is that of `NearWay`.
    """

    def __init__(self, motion: Locomotion, dead: Collection[int] = (), swept_only: bool = False) -> None:
        self.on_step: Callable[[Waypoint], None] = lambda _: None
        self._motion = motion
        self._swept_only = swept_only
        self._bodies = DeadBodies(motion, dead)
        self._latest = motion.position, 0.0  # where the latest step began, and its heading [rad]
        self._wall_rad = 0.0
        self._trail: list[Vector] = []
        self._turned_rad = 0.0  # towards the hand, since a wall was at the hand
        self._latest_wall_rad = 0.0  # the direction of that wall
        self._start = motion.position
        self._near_points: NearPoints | None = None  # while the robot follows a wall close to the start
        self._held_near = self._held_points(self.on_step)
        self._in_reach = RobotsInReach(motion.radius_m)

    @property
    def radius_m(self) -> float:
        """The radius [m] of the robot's body."""
        return self._motion.radius_m

    @property
    def start(self) -> Vector:
        """The place [m] by odometry where the latest drive to a wall began."""
        return self._start

    @property
    def way(self) -> Vector:
        """The way [m] by odometry from the place where the latest drive to a wall began."""
        x, y = self._motion.position
        return x - self._start[0], y - self._start[1]

    def to_wall(
        self, bearing_rad: float, hop_m: float, clear_m: float, hand: int, half_rad: float = 0.0
    ) -> DriveToWalk:
        """Drive along a bearing to a wall, and along it until `clear_m` from the start and `half_rad` beside the bearing.

        Ends: SHUT (no way to get clear: the robot returns to its start), OPEN (no wall within `hop_m`), STRETCH (at the wall
        and clear).
        """
        motion, start = self._motion, self._begin_way()
        met, done = yield from self._meet_wall(bearing_rad, hop_m)
        if not met:
            return WalkResult(OPEN, done)
        way, end = self._begin_near(hand), STRETCH
        if not (yield from self._go_past(way, lambda: math.dist(start, motion.position) >= clear_m)):
            end = SHUT
            yield from self._drive_back(way)
        elif half_rad > 0.0:
            edge = past_edge(lambda: motion.position, self.radius_m, bearing_rad, hand, half_rad, start)
            yield from self._go_past(way, edge, EDGE_M_MAX)
        return self._end_near(way, end, done)

    def probe(self, bearing_rad: float, hop_m: float, hand: int, half_rad: float) -> DriveToWalk:
        """Follow a wall within `hop_m` along a bearing with a hand at it, past the direction `half_rad` beside it; return.

        Ends: OPEN (no wall within `hop_m`), STRETCH (it was past that, or clear), SHUT (no way leads there).
        """
        motion, start = self._motion, self._begin_way()
        met, done = yield from self._meet_wall(bearing_rad, hop_m)
        if not met:
            yield from motion.drive_to(start)
            return WalkResult(OPEN, done)
        way = self._begin_near(hand)
        edge = past_edge(lambda: motion.position, self.radius_m, bearing_rad, hand, half_rad, start, CLEAR_M)
        end = STRETCH if (yield from self._go_past(way, edge, EDGE_M_MAX)) else SHUT
        yield from self._drive_back(way)
        return self._end_near(way, end, done)

    def _drive_back(self, way: NearWay) -> Generator[BodyVelocity, None, None]:
        """Drive back to the start of a way close to it."""
        self._held_near.end()
        driven = list[Vector]()
        for velocity in self._motion.drive_to(self._start):
            yield velocity
            driven.append(self._motion.position)
        way.close(driven)

    def _begin_near(self, hand: int) -> NearWay:
        """Begin to record the way along a wall from here, close to the start, with the wall at the hand."""
        way = NearWay(self._start, hand, self.radius_m, self._swept_only)
        self._held_near = self._held_points(way.waypoints.append, way)
        self._in_reach.begin()
        self._report(self._held_near)
        return way

    def _end_near(self, way: NearWay, end: str, driven_m: float) -> WalkResult:
        """End this record, and return the end of the drive."""
        self._held_near.end()
        self._touched.end()
        return WalkResult(end, driven_m, tuple(first_of_message(way.seen_from_start())), way.walls(), way)

    def _held_points(self, report: Callable[[Waypoint], None], near: NearWay | None = None) -> HeldPoints:
        """Return what takes in the points of the way from here, which is `near` its start if that is given."""
        self._touched = TouchedRobots(self._motion.radius_m, report)
        self._near_points = None if near is None else NearPoints(near, self._touched.take)
        return HeldPoints(self._bodies, self._touched.take if self._near_points is None else self._near_points.take)

    def _begin_way(self) -> Vector:
        """Begin a way from here, and return this place."""
        self._motion.frame.forget()
        self._bodies.begin()
        self._start = self._motion.position
        self._trail = [self._start]
        return self._start

    def _meet_wall(self, bearing_rad: float, hop_m: float) -> Generator[BodyVelocity, None, tuple[bool, float]]:
        """Drive along a bearing, to a wall if there is one within `hop_m`; return whether there is, and the way [m]."""
        motion, frame, start = self._motion, self._motion.frame, self._start
        ux, uy = unit(bearing_rad)
        done, stuck = 0.0, 0
        while True:
            ahead = [
                each for each in self._bodies.contacts() if angle_between(each.bearing_rad, bearing_rad) < AHEAD_RAD
            ]
            now = (frame.x_m - start[0]) * ux + (frame.y_m - start[1]) * uy
            stuck = stuck + 1 if now < done + STUCK_FRACTION * motion.step_m else 0
            done = max(done, now)
            if ahead or stuck > STUCK_TICKS:
                break
            if done >= hop_m - 1e-3:
                return False, done
            aside = (frame.y_m - start[1]) * ux - (frame.x_m - start[0]) * uy
            left = min(hop_m - done, motion.step_m)
            yield motion.velocity(ux * left + uy * aside * 0.5, uy * left - ux * aside * 0.5)
            self._trail.append(motion.position)
        # Without a wall ahead, the robot has stopped at the one beside it.
        others = [] if ahead else [each.bearing_rad for each in self._bodies.contacts()]
        self._wall_rad = min(others, key=lambda each: angle_between(each, bearing_rad), default=bearing_rad)
        self._turned_rad, self._latest_wall_rad = 0.0, self._wall_rad
        return True, done

    def _go_past(
        self, way: NearWay, is_past: Callable[[], bool], way_m_max: float = CLEARING_M_MAX
    ) -> Generator[BodyVelocity, None, bool]:
        """Follow the wall for `way_m_max` at most, until the robot is past something; return whether it is."""
        motion, way_m, stuck = self._motion, 0.0, 0
        while not is_past():
            if way_m > way_m_max or self._turned_rad > TURNS_RAD_MAX or stuck > WEDGED_TICKS:
                return False
            step_m = yield from self._advance(way.hand)
            way_m += step_m
            stuck = stuck + 1 if step_m < STUCK_FRACTION * motion.step_m else 0
            self._trail.append(motion.position)
            self._report(self._held_near)
        return True

    def away_from(
        self, station: int, bearings_rad: Iterable[float], hop_m: float, clear_m: float, margin_m: float
    ) -> DriveToWalk:
        """Follow the walls that are met along these bearings, one after the other, as far as a station is in sight.

        Ends as `along` does, with the first wall along which the robot drives more than `clear_m`, or that is so far from
        the station, or with the last one. `driven_m` is the greater of the two lengths.
        """
        walked, start = WalkResult(SHUT), self._motion.position
        for bearing in bearings_rad:
            yield from self.to_wall(bearing, hop_m, 0.0, -1)
            for hand in (1, -1):
                walked = yield from self.along(hand, LEG_M, (station,), (), margin_m)
                if walked.end == LOST:
                    break
            # The drive to the wall, or the other hand, may have led to the end of the station's sight.
            walked = walked._replace(driven_m=max(walked.driven_m, math.dist(start, self._motion.position)))
            if walked.driven_m > clear_m:
                break
        return walked

    def along(
        self, hand: int, length_m: float, keep: Collection[int], meet: Collection[int], margin_m: float
    ) -> DriveToWalk:
        """Follow the wall for `length_m`, in sight of a robot of `keep`, or of any robot if `keep` is empty.

        Ends: STRETCH (`length_m` were followed, or the waypoints fill a message). LOST (no such robot is in sight further on;
        the robot stands at the last place with a margin of `margin_m`). MET (a robot of `meet` and another one are in
        sight). SHUT (no wall any more, or the robot is wedged).
        """
        reported = list[Waypoint]()

        def report(point: Waypoint) -> None:
            reported.append(point)
            self.on_step(point)

        held = self._held_points(report)
        end, way, kept = yield from self._along(hand, length_m, keep, meet, margin_m, held)
        held.end()
        self._touched.end()
        return WalkResult(end, way, tuple(reported[each] for each in kept))

    def _along(
        self,
        hand: int,
        length_m: float,
        keep: Collection[int],
        meet: Collection[int],
        margin_m: float,
        held: HeldPoints,
    ) -> Generator[BodyVelocity, None, tuple[str, float, Sequence[int]]]:
        """Return the end, the way [m], and the numbers of the points that are waypoints."""
        motion, frame = self._motion, self._motion.frame
        frame.forget()
        self._bodies.begin()
        self._in_reach.begin()
        choice = WaypointChoice(motion.position, frame.seen, frame.contacts)
        if not self._sees(keep):  # those that see it come back from here know that it was out of their sight
            self._report(held)
            yield from self._back_into_sight(keep)
            if not self._sees(keep):
                return LOST, 0.0, ()
            choice.take(motion.position, frame.seen, frame.contacts)
        self._trail = [motion.position]
        self._turned_rad = 0.0
        self._report(held)
        kept, way, stuck = choice.chosen, 0.0, 0
        while way < length_m and not choice.is_full:
            if self._meets(meet):
                return MET, way, kept
            if self._turned_rad > TURNS_RAD_MAX or stuck > WEDGED_TICKS:
                return SHUT, way, kept
            step_m = yield from self._advance(hand)
            way += step_m
            stuck = stuck + 1 if step_m < STUCK_FRACTION * motion.step_m else 0
            if not self._sees(keep):
                yield from self._back(margin_m, keep)
                return LOST, way, kept
            self._trail.append(motion.position)
            self._report(held)
            choice.take(motion.position, frame.seen, frame.contacts)
        return STRETCH, way, kept

    # --- one step ---------------------------------------------------------------------------------------------------

    def _advance(self, hand: int) -> Generator[BodyVelocity, None, float]:
        """Make one step along the wall, and return its length [m]."""
        motion, frame = self._motion, self._motion.frame
        before, seen_before = motion.position, frame.seen
        yield self._step(hand)
        touched = [each.node for each in frame.contacts if each.node is not None]
        self._in_reach.take(before, seen_before, motion.position, frame.seen, touched)
        return math.dist(before, motion.position)

    def _step(self, hand: int) -> BodyVelocity:
        """Return the velocity of the next step, and keep the direction of the wall."""
        motion = self._motion
        push = self._bodies.step(math.dist(self._latest[0], motion.position), self._latest[1])
        if push is not None:
            self._latest = motion.position, self._latest[1]
            return push
        contacts = self._in_reach.steered_by(self._bodies.contacts())
        heading, wall_rad = hand_on_wall(self._wall_rad, contacts, hand)
        walls = [each.bearing_rad for each in contacts if each.node is None]
        if any(angle_between(each, wall_rad) < 1e-6 for each in walls):
            self._turned_rad, self._latest_wall_rad = 0.0, wall_rad
        else:  # no wall at the hand
            self._turned_rad = max(0.0, self._turned_rad + hand * (wall_rad - self._wall_rad))
            # After a whole turn it circles, alone or round a robot, and touches a wall at its other side, or none at all.
            if self._turned_rad > math.tau and walls:
                nearest = min(walls, key=lambda each: angle_between(each, self._wall_rad))
                heading, wall_rad = hand_on_wall(nearest, contacts, hand)
            elif self._turned_rad > math.tau and not contacts:
                heading = wall_rad = self._latest_wall_rad
        self._wall_rad = wall_rad
        ux, uy = unit(heading)
        self._latest = motion.position, heading
        return motion.velocity(ux * motion.step_m, uy * motion.step_m)

    def _report(self, held: HeldPoints) -> None:
        """Report the point at which the robot is now."""
        point = self._waypoint()
        groups = self._motion.frame.touched_among()
        self._touched.note(point.x_m, point.y_m, [each for each in groups if not self._bodies.is_body(each[1][0])])
        if self._near_points is not None:
            self._expect_near(self._near_points, point)
        held.take(point)

    def _expect_near(self, points: NearPoints, point: Waypoint) -> None:
        """Note the point at which the robot is now. The robot that stands where the way began does not count."""
        frame, (x, y) = self._motion.frame, self.way
        back_rad = math.atan2(-y, -x)
        robots = [each for each in frame.contacts if each.node is not None]
        beside = [each for each in robots if angle_between(each.bearing_rad, back_rad) > ROBOT_BEHIND_RAD]
        near = NearPoint(self._motion.position, frame.touched, self._bodies.in_touch or bool(beside))
        points.expect(near, point, any(not self._bodies.is_body(each.node) for each in beside))

    def _waypoint(self) -> Waypoint:
        frame, near = self._motion.frame, self._near_points
        return Waypoint(
            frame.x_m,
            frame.y_m,
            tuple(Sighting(node, bearing) for node, bearing in sorted(frame.seen.items())),
            tuple(each.bearing_rad for each in frame.contacts if each.node is None),
            tuple(
                each.node
                for each in frame.contacts
                if each.node is not None and each.node not in self._in_reach.out_of_reach
            ),
            None if near is None else start_in_sight(self._start, self._trail, near.way.hand, self.radius_m),
        )

    # --- sight ------------------------------------------------------------------------------------------------------

    def _sees(self, keep: Collection[int]) -> bool:
        seen = self._motion.frame.seen
        return any(each in seen for each in keep) if keep else any(not self._bodies.is_body(each) for each in seen)

    def _meets(self, meet: Collection[int]) -> bool:
        seen = self._motion.frame.seen
        return any(each in seen for each in meet) and any(each not in meet for each in seen)

    def _back_into_sight(self, keep: Collection[int]) -> Generator[BodyVelocity, None, None]:
        """Drive back on the trail until a robot is in sight."""
        while not self._sees(keep) and self._trail:
            yield from self._leg(self._trail.pop())

    def _back(self, margin_m: float, keep: Collection[int]) -> Generator[BodyVelocity, None, None]:
        """Drive back on the trail into sight, and `margin_m` further."""
        yield from self._back_into_sight(keep)
        way = 0.0
        while way < margin_m and self._trail:
            before = self._motion.position
            yield from self._leg(self._trail.pop())
            way += math.dist(before, self._motion.position)

    def _leg(self, goal: Vector) -> Generator[BodyVelocity, None, None]:
        """Drive to a point of the trail close by; a robot in the way ends the leg."""
        motion = self._motion
        for _ in range(STUCK_TICKS):
            dx, dy = goal[0] - motion.frame.x_m, goal[1] - motion.frame.y_m
            if math.hypot(dx, dy) < motion.parameters.tolerance_m:
                return
            yield motion.velocity(dx, dy)
