"""The robot under a coordinator: it stands still and reports until the coordinator commands a drive.

An activity is a generator that yields one velocity a tick: averaging, a drive, or a scan. The robot decides local
questions itself: its offset from the bearings that it must reach, contacts with walls, broken visual links, and arrival.
"""

import math
from collections.abc import Collection, Generator, Sequence
from contextlib import closing
from typing import Final

from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.agents.sensor_coverage.messages.commands import (
    INCARNATIONS,
    OPEN,
    SHUT,
    STRETCH,
    UPLINK,
    Arrived,
    Cleared,
    ComeBack,
    Correct,
    Deploy,
    Emerged,
    FollowWall,
    FollowWallPastDead,
    Move,
    NegotiateLeave,
    Probe,
    ProbePastDead,
    Release,
    Report,
    RobotCommand,
    RollCall,
    ScanRequest,
    Sighting,
    ToWall,
    ToWallPastDead,
    Walked,
    read_request,
    write,
)
from zwerm.agents.sensor_coverage.motion.homing import Vector
from zwerm.agents.sensor_coverage.motion.locomotion import STOP, Drive, Locomotion
from zwerm.agents.sensor_coverage.motion.motion_parameters import RobotParameters
from zwerm.agents.sensor_coverage.motion.push_drives import DriveToResult, correct, deploy, drive_back, move
from zwerm.agents.sensor_coverage.motion.trail import Trail
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import DriveToWalk, WallWalk
from zwerm.agents.sensor_coverage.protocols.component import Component
from zwerm.agents.sensor_coverage.protocols.component_loop import Codec, ComponentLoop
from zwerm.agents.sensor_coverage.protocols.transport.deduplication import RequestDeduplicator
from zwerm.wire.messages import BodyVelocity, Command, Observation, Wake

# A robot within this distance [m] of the point where it came out still stands at the exit of the depot.
HOME_M: Final = 0.05
# The ends of a probe: at all of them the robot has driven back to its slot.
PROBE_ENDS: Final = OPEN, SHUT, STRETCH

UPLINK_CODEC: Final = Codec(read_request, write)


class CentralRobot(Controller):
    """A robot of the swarm."""

    sensors = ("bearings", "touch", "odometry")
    Parameters = RobotParameters

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.motion = Locomotion(self.parameters, setup)
        self._trail = Trail()
        self._left = self.motion.position  # where it stood before it was deployed or moved to another slot
        self._dead: dict[int, None] = {}  # as far as the coordinator has said
        self.wall_walk = WallWalk(self.motion, self._dead, swept_only=True)
        self.commands = RequestDeduplicator(int(self.random.integers(1, INCARNATIONS)), self._on_command)
        self.components = ComponentLoop(self._make_components(), self._make_codecs(), setup.incarnation)
        self._activity: Drive | None = self._emerge()

    def _make_components(self) -> Sequence[Component]:
        """Return the components, in the order in which they are polled."""
        return (self.commands,)

    def _make_codecs(self) -> dict[str, Codec]:
        return {UPLINK: UPLINK_CODEC}

    def step(self, observation: Observation) -> Command:
        """Take in readings and messages, go on with the activity, and poll the components."""
        self.motion.frame.update(observation)
        self._trail.record(self.motion.position)
        self.components.deliver(observation.inbox, observation.tick)
        drive = self._advance()
        self.components.poll(observation.tick)
        return Command(drive=drive, outbox=self.components.outbox(), wake=self._wake(observation.tick))

    def _advance(self) -> BodyVelocity:
        """Return the next velocity of the activity."""
        if self._activity is None and self.motion.is_displaced():
            self._activity = self._return()
        if self._activity is not None:
            try:
                return next(self._activity)
            except StopIteration:
                self._activity = None
        return STOP

    def _wake(self, tick: int) -> Wake | None:
        """Return the next wake-up: the next tick during an activity, else a packet, a contact or a component's wake-up."""
        if self._activity is not None:
            return None
        due = self.components.next_wake()
        return Wake(at_s=None if due is None else max(tick + 1, due) * self.setup.dt_s, on_packet=True, on_contact=True)

    # --- commands -----------------------------------------------------------------------------------------------------

    def _on_command(self, command: RobotCommand) -> None:
        self._activity = self._begin(command)

    def _begin(self, command: RobotCommand) -> Drive | None:
        """Return the activity that carries out a command."""
        self._dead.clear()
        if isinstance(command, ToWallPastDead | FollowWallPastDead | ProbePastDead):
            self._dead.update(dict.fromkeys(command.dead))
        match command:
            case RollCall(cycle):
                self.motion.rest = None  # a robot that was driving stands where it is
                return self._scan(ScanRequest(cycle, (self.setup.node,)))
            case ScanRequest():
                return self._scan(command)
            case Deploy(cycle, bearing_rad, hop_m, clear_m):
                self._left = self.motion.position
                return self._drive(cycle, deploy(self.motion, bearing_rad, hop_m, clear_m, lambda: self._clear(cycle)))
            case Move(cycle, bearing_rad, hop_m, landmarks):
                if hop_m > 0.0:  # else it homes again at its slot
                    self._left = self.motion.position
                return self._drive(cycle, move(self.motion, bearing_rad, hop_m, landmarks))
            case Correct(cycle, anchors):
                return self._drive(cycle, correct(self.motion, anchors))
            case ComeBack(cycle, apart):
                return self._drive(cycle, self._come_back(apart))
            case ToWall(cycle, bearing_rad, hop_m, clear_m, hand, half_rad):
                return self._walk(cycle, self.wall_walk.to_wall(bearing_rad, hop_m, clear_m, hand, half_rad), (SHUT,))
            case Probe(cycle, bearing_rad, hop_m, hand, half_rad):
                return self._walk(cycle, self.wall_walk.probe(bearing_rad, hop_m, hand, half_rad), PROBE_ENDS)
            case FollowWall(cycle, length_m, hand, keep, meet):
                margin_m = self.motion.parameters.margin_m
                return self._walk(cycle, self.wall_walk.along(hand, length_m, keep, meet, margin_m))
            case Release() | NegotiateLeave():
                return None

    def _drive(self, cycle: int, drive: DriveToResult) -> Drive:
        """Drive, and answer with the result."""
        result = yield from drive
        self.motion.settle()
        seen = result.used_odometry, result.used_moving_landmarks
        (x, y), (left_x, left_y) = self.motion.position, self._left
        way = x - left_x, y - left_y
        self.commands.answer(Arrived(cycle, result.ok, *seen, result.driven_m, result.touched, way))

    def _walk(self, cycle: int, walk: DriveToWalk, returns: Collection[str] = ()) -> Drive:
        """Drive to a wall or along it, and answer with the result.

        At the ends in `returns` the robot has driven back to where it began. If others kept it from there, it goes back later.
        """
        result = yield from walk
        self.motion.settle()
        if result.end in returns:
            self.motion.rest = self.wall_walk.start
        x_m, y_m = self.wall_walk.way
        self.commands.answer(
            Walked(
                cycle,
                result.end,
                x_m,
                y_m,
                result.driven_m,
                result.waypoints,
                result.near,
                self.motion.radius_m,
                self.wall_walk.start,
                () if result.way is None else result.way.arcs_beside(),
            )
        )

    def _come_back(self, apart: Collection[int]) -> DriveToResult:
        motion = self.motion
        return drive_back(
            motion, tuple(self._trail.points), lambda: any(each not in apart for each in motion.frame.seen)
        )

    def _clear(self, cycle: int) -> None:
        self.commands.answer(Cleared(cycle))

    # --- standing still -----------------------------------------------------------------------------------------------

    def _emerge(self) -> Drive:
        """Average bearings after coming out of the depot, and report them."""
        yield from self.motion.average(self.motion.frame.averaged)
        self.commands.answer(Emerged(self._sightings()))

    def _scan(self, command: ScanRequest) -> Drive:
        """Return to the point of rest if displaced, average bearings if anything has changed, and report."""
        motion, frame = self.motion, self.motion.frame
        if motion.rest is not None:
            motion.rest_at((yield from self._return_to_rest(motion.rest)))
        frame.forget(command.moved)
        if self.setup.node in command.moved:
            frame.forget()
        fresh = not frame.averaged(1 if motion.bearing_noise_rad is None else motion.samples)
        if fresh:
            yield from motion.average(frame.averaged)
        sightings = self._sightings() if fresh else None
        home = math.hypot(frame.x_m, frame.y_m) < HOME_M
        self.commands.answer(self._report(command.cycle, sightings, home))

    def _return(self) -> Drive:
        """Drive back to the point of rest, from which a passing robot has pushed this one away, while none is in touch.

        Others compare what they see of it with what its slot saw before.
        """
        if self.motion.rest is None:
            return
        with closing(self._return_to_rest(self.motion.rest)) as drive:
            for velocity in drive:
                if self.motion.frame.touched_robots:
                    return
                yield velocity

    def _report(self, cycle: int, sightings: tuple[Sighting, ...] | None, home: bool) -> Report:
        frame, pushed = self.motion.frame, self.motion.pushed
        self.motion.pushed = 0.0, 0.0
        return Report(cycle, sightings, frame.touched, home, frame.touched_robots, pushed)

    def _return_to_rest(self, rest: Vector) -> Generator[BodyVelocity, None, Vector]:
        return self.motion.return_to_rest(rest)

    def _sightings(self) -> tuple[Sighting, ...]:
        return tuple(Sighting(node, bearing) for node, bearing in self.motion.frame.averages().items())
