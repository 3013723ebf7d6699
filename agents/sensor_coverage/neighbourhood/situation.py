"""One decentralised robot's situation, which its components share: readings, activity, local map, and mailbox."""

import math
from collections import ChainMap
from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from zwerm.agents.runtime.contract import Setup
from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.messages.beacons import FAR, NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import Landmark, Sighting
from zwerm.agents.sensor_coverage.messages.incarnations import adopted_slot
from zwerm.agents.sensor_coverage.motion.homing import Vector, unit
from zwerm.agents.sensor_coverage.motion.locomotion import STOP, Drive, Locomotion
from zwerm.agents.sensor_coverage.motion.motion_parameters import RobotParameters
from zwerm.agents.sensor_coverage.motion.push_drives import (
    AHEAD_RAD,
    DriveResult,
    DriveToResult,
    correct,
    deploy,
    drive_back,
    move,
    regain,
)
from zwerm.agents.sensor_coverage.motion.trail import Trail
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import (
    CLEAR_M,
    FIRST_HOP_M,
    LEG_M,
    DriveToWalk,
    WalkResult,
    WallWalk,
)
from zwerm.agents.sensor_coverage.neighbourhood.failure_detector import FailureDetector
from zwerm.agents.sensor_coverage.neighbourhood.local_map import FrontierMakers, LocalMap
from zwerm.agents.sensor_coverage.protocols.leave_negotiation import LeaveNegotiation
from zwerm.agents.sensor_coverage.protocols.transport.mailbox import ReliableMailbox
from zwerm.wire.messages import BodyVelocity, Observation

# A robot that is displaced again within so many ticks of its way back, so many times in a row, rests: another one is too near.
RECOVERY_TICKS: Final = 100
RECOVERIES_MAX: Final = 4
# Ticks that a standing robot sees no robot before it drives back on its way: one may be on its way to it.
ALONE_TICKS: Final = 200
# A dead robot's body within this angle [rad] of a drive's direction may stop the drive.
BODY_AHEAD_RAD: Final = 0.3
# A robot in touch within this angle [rad] of a drive's direction has stopped the drive.
BODY_BESIDE_RAD: Final = math.pi / 2.0
# A robot that pushes so many bodies still has a quarter of its speed, and does not count as stuck.
PUSHED_MAX: Final = 3
# A robot within the first distance [m] of the point where it came out of the depot still stands there. Up to the second one it
# does as long as it sees the first robot of a path: it gives way to a robot that stands close to the base.
AT_BASE_M: Final = 0.05
BESIDE_BASE_M: Final = 0.14


class Situation:
    """The state of one robot or base station.

    `driving`: the robot moves in this tick. `in_push`: it is part of a push. `calm`: it stands still, and its view
    agrees with its neighbours' states. `negotiation` exists if robots may leave the complex. `telemetry` and
    `snapshot` are reported with the next command.
    """

    def __init__(
        self, setup: Setup, parameters: RobotParameters, random: np.random.Generator, makers: FrontierMakers
    ) -> None:
        self.node = setup.node
        self.incarnation = setup.incarnation
        self.tick = 0
        self.motion = Locomotion(parameters, setup)
        self.motion.rest = 0.0, 0.0
        self.failure_detector = FailureDetector()
        self.said_dead: dict[int, None] = {}  # robots that others have found to be dead, for the present walk
        self.told_dead: tuple[int, ...] = ()  # robots that are dead by the latest wave of the census
        self.wall_walk = WallWalk(self.motion, ChainMap(self.failure_detector.dead, self.said_dead))
        planner_parameters = PlannerParameters(
            link_m=parameters.link_m, margin_m=parameters.margin_m, walls=parameters.walls
        )
        self.local_map = LocalMap(setup.node, planner_parameters, makers, setup.incarnation)
        self.mailbox = ReliableMailbox()
        self.negotiation: LeaveNegotiation | None = None
        if setup.services.get("redundancy") in ("link", "coordinator"):
            self.negotiation = LeaveNegotiation(setup.node, setup.dt_s, random, setup.incarnation == 1)
        self.driving = self.in_push = self.calm = False
        self.telemetry: dict[str, float | bool] = {}
        self.snapshot = b""
        self.on_cleared: Callable[[], None] = lambda: None
        self.on_arrived: Callable[[DriveResult | WalkResult], None] = lambda _: self.stand()
        self._activity: Generator[BodyVelocity, None, DriveResult | WalkResult | None] | None = self._look_around()
        self._recoveries = self._recovered_at = 0
        self._start = self._goal = self.motion.position  # of the latest push, by odometry
        self._trail = Trail()
        self._alone_since: int | None = None
        self._returns = 0
        self._company: dict[int, None] = {}  # robots of this robot's part of the swarm, since the base is out of reach
        self._cut_at = 0
        self._base: int | None = None

    # --- every tick -------------------------------------------------------------------------------------------------

    def observe(self, observation: Observation) -> None:
        """Take in the readings of a tick."""
        self.tick = observation.tick
        self.motion.frame.update(observation)
        self._trail.record(self.motion.position)
        if self.negotiation is not None:
            self.negotiation.observe(self.tick, self.motion.frame.seen)

    def advance(self) -> BodyVelocity:
        """Return the next velocity of the activity; report the end of a drive to `on_arrived`."""
        velocity, result = STOP, None
        if self._activity is not None:
            try:
                velocity = next(self._activity)
            except StopIteration as end:
                self._activity, result = None, end.value
        self.driving = velocity != STOP
        if isinstance(result, DriveResult | WalkResult):
            self.motion.settle()
            self.on_arrived(result)
        return velocity

    # --- the robot's own state --------------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """True if the robot drives or averages bearings."""
        return self._activity is not None

    @property
    def dead(self) -> Collection[int]:
        """The robots that this robot has found to be dead."""
        return self.failure_detector.dead

    @property
    def bearings(self) -> Mapping[int, float]:
        """Bearings [rad] of the visible robots that are not declared dead."""
        dead = self.failure_detector.dead
        if not dead:
            return self.motion.frame.seen
        return {node: bearing for node, bearing in self.motion.frame.seen.items() if node not in dead}

    @property
    def claims(self) -> int:
        """Number of frontier claims of this robot; also of what a dead body closes, and of a robot apart from all others."""
        local_map = self.local_map
        apart = local_map.slot not in (0, NOWHERE) and not (local_map.redundant or local_map.mutual())
        return len(local_map.plans) + len(local_map.gaps) + len(local_map.wall_plans) + local_map.obstructed + apart

    def dead_ahead(self, bearing_rad: float, within_rad: float) -> int | None:
        """Return the dead robot that is visible next to a bearing [rad] of this robot's frame, within an angle, or None."""
        seen = self.motion.frame.seen
        apart = {node: angle_between(seen[node], bearing_rad) for node in self.failure_detector.dead if node in seen}
        body = min(apart, key=lambda node: apart[node], default=None)
        return body if body is not None and apart[body] < within_rad else None

    def clear_m(self, bearing_rad: float, wanted_m: float) -> float:
        """Return how far [m] a leader has to get: less where a dead robot's body stands, which it sees past."""
        in_the_way = self.dead_ahead(bearing_rad, BODY_AHEAD_RAD)
        return wanted_m if in_the_way is None else min(wanted_m, self.local_map.parameters.near_wall_m)

    def body_in_the_way(self, result: DriveResult, bearing_rad: float) -> int | None:
        """Return the robot that stopped a drive and may hide free space, or None.

        Dead robots yield to a push, and bodies are smooth. So a body ahead that does not yield stands at a wall.
        """
        off = [(angle_between(each.bearing_rad, bearing_rad), each.node) for each in result.robots]
        away_rad, body = min(((angle, node) for angle, node in off if node is not None), default=(math.pi, None))
        if result.touched or away_rad > BODY_BESIDE_RAD:
            return None
        seen = self.motion.frame.seen
        dead = [node for node in self.failure_detector.dead if node in seen]
        row = [node for node in dead if angle_between(seen[node], bearing_rad) < BODY_BESIDE_RAD]
        at_wall = body in dead and away_rad < AHEAD_RAD and len(row) <= PUSHED_MAX
        return None if at_wall else body

    @property
    def busy(self) -> bool:
        """True if the robot drives, averages bearings, or must do so."""
        return self._activity is not None or self.unsure

    @property
    def clear(self) -> bool:
        """True if the robot stands still, has averaged bearings, and no slot around it changes hands."""
        return not self.busy and not self.local_map.changing(self.bearings, self.tick)

    @property
    def settled(self) -> bool:
        """True if the robot stands still, and its view agrees with those of all robots that do. Others may move in sight."""
        return not self.busy and self.local_map.settled(self.bearings, self.tick)

    @property
    def stands(self) -> bool:
        """True if the robot stands at its slot in the complex, and has nothing else to do."""
        return not (self.local_map.redundant or self.local_map.moving or self.driving or self.in_push)

    @property
    def idle(self) -> bool:
        """True if the robot is in no push, stands still, and knows its heading."""
        return not self.in_push and not self.local_map.moving and self.local_map.heading is not None

    @property
    def locked(self) -> bool:
        """True if the robot must stand still for a neighbour that leaves."""
        return self.negotiation is not None and self.negotiation.locked

    @property
    def free(self) -> bool:
        """True if the robot can take part in a push."""
        return self.idle and not self.locked

    @property
    def waiting(self) -> bool:
        """True if the robot stands at the base, ready to go."""
        return self.local_map.slot == NOWHERE and self.idle and self.local_map.at_base is True

    @property
    def homeless(self) -> bool:
        """True if the robot has no slot, and is not ready at the base either: it has restarted, or has no heading."""
        return self.local_map.slot == NOWHERE and not self.in_push and not self.waiting

    @property
    def displaced(self) -> bool:
        """True if another robot has pushed this robot away from its point of rest."""
        return self.motion.is_displaced() and not self.locked

    @property
    def alone(self) -> bool:
        """True if the robot stands at a slot and sees no living robot for so long that none is on its way to it."""
        if self.bearings or self.active or self.in_push or self.local_map.slot in (0, NOWHERE):
            self._alone_since = None
            return False
        if self._alone_since is None:
            self._alone_since = self.tick
        return self.tick - self._alone_since >= ALONE_TICKS and len(self._trail.points) > 1

    @property
    def homes(self) -> dict[int, tuple[int, int]]:
        """The neighbours' hops to the base, and the count of the base that came that way."""
        homes = self.local_map.path_vectors.homes
        return {node: homes.get(state.slot, (FAR, 0)) for node, state in self.local_map.mutual().items()}

    def is_cut_off(self) -> bool:
        """Return whether the base is out of reach of this robot and its neighbours, and it is this robot's turn to drive back.

        A robot that sees the base is not, even if the base counts as dead: its radio may have failed.
        """
        local_map = self.local_map
        base = local_map.at(0)
        self._base = self._base if base is None else base
        stands = self.calm and not (self.active or self.in_push) and local_map.slot not in (0, NOWHERE)
        if not (stands and local_map.reach.is_lost(self.tick)) or self._base in self.motion.frame.seen:
            return False
        return local_map.reach.is_turn(self.tick, self.node, {node: hops for node, (hops, _) in self.homes.items()})

    @property
    def unsure(self) -> bool:
        """True if a visible robot is not averaged yet, or an averaged robot is no longer visible."""
        motion, frame = self.motion, self.motion.frame
        if not self.local_map.samples or not self.local_map.seen.keys() <= frame.seen.keys():
            return True
        wanted = 1 if motion.bearing_noise_rad is None else motion.samples
        for node in frame.seen:  # noqa: SIM110 (asked at every step: a generator takes twice as long)
            if frame.count(node) < wanted and self._stands_still(node):
                return True
        return False

    def _standing(self) -> list[int]:
        """Return the visible robots that are not known to move."""
        return [node for node in self.motion.frame.seen if self._stands_still(node)]

    def _stands_still(self, node: int) -> bool:
        state = self.local_map.states.get(node)
        return state is None or not state.moving

    # --- activities -------------------------------------------------------------------------------------------------

    def look_around(self) -> None:
        """Begin to average the bearings of the visible robots that stand still."""
        self._activity = self._look_around()

    def recover(self) -> None:
        """Begin to drive back to the point of rest, or rest here if that did not help several times in a row."""
        if self.motion.rest is None:
            return
        in_a_row = self.tick - self._recovered_at <= RECOVERY_TICKS
        self._recoveries, self._recovered_at = (self._recoveries + 1 if in_a_row else 1), self.tick
        if self._recoveries > RECOVERIES_MAX:
            self._recoveries = 0
            self.local_map.begin_drive()  # neighbours average its bearing again
            self.motion.rest_at(self.motion.position, self.local_map.forget_walls)
            self.motion.settle()
            self.stand()
            self.look_around()
        else:
            self._activity = self._recover(self.motion.rest)

    def deploy(self, bearing_rad: float, hop_m: float, clear_m: float, bounded: bool = False) -> None:
        """Begin to drive into unknown space."""
        self._start = self.motion.position
        self._drive(deploy(self.motion, bearing_rad, hop_m, clear_m, lambda: self.on_cleared(), bounded))

    def move(self, bearing_rad: float, hop_m: float, landmarks: Sequence[Landmark], knows_way: bool = True) -> None:
        """Begin to drive to the slot ahead, by landmarks alone if the way there is unknown."""
        (x, y), (ux, uy) = self.motion.position, unit(bearing_rad)
        if hop_m > 0.0:
            self._start = x, y
            self._goal = x + hop_m * ux, y + hop_m * uy
        self._drive(move(self.motion, bearing_rad, hop_m, landmarks, knows_way))

    def regain(self, node: int, bearing_rad: float | None = None) -> None:
        """Begin to look for a robot that was in sight from the slot to which this robot has moved, or along a bearing [rad]."""
        self._drive(regain(self.motion, node, self._goal if bearing_rad is None else self.motion.position, bearing_rad))

    def correct(self, anchors: Sequence[Sighting]) -> None:
        """Begin to correct the scale."""
        self._drive(correct(self.motion, anchors))

    def to_wall(self, bearing_rad: float, hop_m: float, hand: int, half_rad: float) -> None:
        """Begin to drive to a wall, and along it until the start is clear, and `half_rad` beside the bearing."""
        self._drive(self.wall_walk.to_wall(bearing_rad, hop_m, CLEAR_M, hand, half_rad))

    def probe(self, bearing_rad: float, hop_m: float, hand: int, half_rad: float) -> None:
        """Begin to follow a wall close by, past the direction `half_rad` beside the bearing, and return."""
        self._drive(self.wall_walk.probe(bearing_rad, hop_m, hand, half_rad))

    def follow_wall(self, hand: int, keep: Collection[int]) -> None:
        """Begin to follow the wall in touch, in sight of a robot of `keep`, or of any robot if `keep` is empty."""
        self._drive(self.wall_walk.along(hand, LEG_M, keep, (), self.motion.parameters.margin_m))

    def leave_station(self, station: int, bearings_rad: Iterable[float]) -> None:
        """Begin to follow the walls that are met along these bearings, as far as the station is in sight."""
        walk, margin_m = self.wall_walk, self.motion.parameters.margin_m
        self._drive(walk.away_from(station, bearings_rad, FIRST_HOP_M, CLEAR_M, margin_m))

    def come_back(self) -> None:
        """Begin to drive back into sight of a robot that is not of this part of the swarm. The robot takes a new slot there."""
        self._alone_since = None
        reach = self.local_map.reach
        if reach.newest != self._cut_at:
            self._company.clear()
        self._cut_at = reach.newest
        self._company |= dict.fromkeys(self.bearings)
        states = [self.local_map.states[node] for node in self.bearings if node in self.local_map.states]
        self._company |= dict.fromkeys(each.node for state in states for each in state.seen)
        self._drive(self._come_back())

    def come_back_to(self, node: int) -> None:
        """Begin to drive back into sight of a robot that stands where this robot stood before the push, or stay."""
        self._drive(self._come_back_to(node, [*self._trail.since(self._start), self.motion.position]))

    def stand(self) -> None:
        """End a drive: the robot stands still, for neighbours to average its bearing."""
        self.check_at_base(BESIDE_BASE_M)
        self.local_map.end_drive()
        self.motion.frame.forget()

    def _drive(self, drive: DriveToResult | DriveToWalk) -> None:
        self.local_map.begin_drive()
        self._activity = drive

    def _come_back(self) -> DriveToResult:
        result = yield from drive_back(
            self.motion, self._trail.points, lambda: any(each not in self._company for each in self.bearings)
        )
        self._returns += 1
        self.local_map.reach.tried(self.tick)
        self.local_map.occupy(adopted_slot(self.node, self.incarnation, self._returns))
        return result

    def _come_back_to(self, node: int, way: Sequence[Vector]) -> DriveToResult:
        result = yield from drive_back(self.motion, way, lambda: node in self.bearings)
        if not result.ok:
            yield from drive_back(self.motion, way[::-1], lambda: False)
        return result

    def _look_around(self) -> Drive:
        motion, frame = self.motion, self.motion.frame
        yield from motion.average(lambda samples: all(frame.count(node) >= samples for node in self._standing()))
        standing = frozenset(self._standing())
        self.local_map.update_bearings({node: each for node, each in frame.averages().items() if node in standing})
        self.local_map.update_walls(frame.touched, frame.touched_robots)

    def _recover(self, rest: Vector) -> Drive:
        rest = yield from self.motion.return_to_rest(rest, lambda: self.local_map.set_displaced(True))
        self.motion.rest_at(rest, self.local_map.forget_walls)
        self.local_map.set_displaced(False)
        self.check_at_base(BESIDE_BASE_M)

    def check_at_base(self, within_m: float = AT_BASE_M) -> None:
        """Find out whether the robot is off the base's point. Then it sees other robots than the base, and takes a slot."""
        away_m = math.hypot(self.motion.frame.x_m, self.motion.frame.y_m)
        if self.local_map.at_base and self.local_map.heading is not None and away_m > within_m:
            self.local_map.at_base = False
            self.local_map.change()
