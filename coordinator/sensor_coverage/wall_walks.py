"""The execution of walks along walls: one robot drives to a wall and follows it, past all robots that stand there.

The robots behind it close up first, so that every slot is occupied. The walk ends when all that it can close is closed,
or when no standing robot sees the walking robot further on. In the second case it gets a slot there, and the swarm
continues from that slot.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from typing import Final, NamedTuple

import msgspec

from zwerm.agents.sensor_coverage.frontier.decisions import FrontierService
from zwerm.agents.sensor_coverage.frontier.directions import angle_between, wrapped
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_plans import WallPlans
from zwerm.agents.sensor_coverage.frontier.wall_proof import ANYONE, SAME_WALL_RAD, Origin, Walk
from zwerm.agents.sensor_coverage.messages.commands import (
    LOST,
    MET,
    OPEN,
    SHUT,
    STRETCH,
    Arrived,
    FollowWall,
    FollowWallPastDead,
    Move,
    NearWalls,
    Probe,
    ProbePastDead,
    ToWall,
    ToWallPastDead,
    Walked,
    Waypoint,
    turned_arcs,
)
from zwerm.agents.sensor_coverage.motion.push_geometry import FIRST_BEARINGS_RAD
from zwerm.agents.sensor_coverage.motion.triangulation import distances_m
from zwerm.agents.sensor_coverage.motion.walls.passed_robots import passed_robots
from zwerm.agents.sensor_coverage.motion.walls.wall_walk import CLEAR_M, FIRST_HOP_M, IDLE_LEGS_MAX, LEG_M
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox, Routine, run_concurrently
from zwerm.coordinator.sensor_coverage.idle_slots import beside_others, still_idle, without_witnesses
from zwerm.coordinator.sensor_coverage.push_execution import Moved, PushExecution
from zwerm.coordinator.sensor_coverage.sources import Sources
from zwerm.maths.sums import added

# A leg closes something if the open arcs become smaller by this [rad].
PROGRESS_RAD: Final = 0.1
# A station's first robot follows a wall within the first length [m] for the second length [m], to learn its direction.
AXIS_HOP_M: Final = 0.9
AXIS_M: Final = 0.8
# Directions in which it looks for a wall. Parallel to a wall it meets none at right angles, so there are more.
AXIS_BEARINGS_RAD: Final = tuple(math.radians(each) for each in (180, -90, 90, 0, 135, -135, 45, -45))
# So many waypoints show the direction of a wall, if they are off a line by less than this [m], and spread along it by
# more than this [m] (both root mean squares).
LINE_POINTS_MIN: Final = 4
LINE_OFF_M: Final = 0.02
LINE_ALONG_M: Final = 0.1
# A leg leads where the walk was before if each place in touch is within this distance [m] of an earlier one at the same wall.
AGAIN_M: Final = 0.03
# The commands that name dead robots.
PAST_DEAD: Final = {ToWall: ToWallPastDead, FollowWall: FollowWallPastDead, Probe: ProbePastDead}
# Dead robots that a command names at most: the ones that fell silent last. An id has 5 bytes at most.
DEAD_MAX: Final = 500


class SetOut(NamedTuple):
    """The robots that moved when one set out for a wall, and the legs along walls that it goes on with, if any."""

    moved: Moved
    legs: Routine[None] | None = None


class WallWalks:
    """Walks along walls. `idle` are the slots at which a robot stands after a walk, and is not needed.

    `reach_m` is the distance [m] up to which slots know the walls beside which a walk has passed their robots. `silent` are the
    robots that do not answer, which may change: a walking robot pushes their bodies.
    """

    def __init__(
        self,
        slots: Slots,
        mailbox: CommandMailbox,
        sources: Sources,
        pushing: PushExecution,
        frontier: FrontierService,
        walls: WallPlans,
        reach_m: float,
        silent: Collection[int] = (),
    ) -> None:
        self.idle: dict[int, None] = {}
        self._woken: dict[int, None] = {}  # idle slots that counted again beside an arc that no walk closed
        self.walks = 0
        self._walking: dict[int, None] = {}  # robots on walks of this cycle: the scan has no slot where they are
        self._left = 0.0  # sum of the open arcs [rad] since the latest leg
        self._slots = slots
        self._mailbox = mailbox
        self._sources = sources
        self._pushing = pushing
        self._frontier = frontier
        self._walls = walls
        self._reach_m = reach_m
        self._silent = silent

    def walk(self, plans: Iterable[Plan], scan: ScanResult) -> Routine[Moved]:
        """Carry out plans to follow walls, and return the robots that have moved; `scan` has no idle robots.

        A robot sets out together with those before it, or after them if its plan waits. All follow walls at the same time,
        while the others stand.
        """
        self._walking = {}
        gone, together = list[SetOut](), list[list[Plan]]()
        for plan in plans:
            if plan.waits or not together:
                together.append([])
            together[-1].append(plan)
        for each in together:
            still = [self._still(plan, each) for plan in each]
            going = [self._set_out(plan, scan, here) for plan, here in zip(each, still, strict=True)]
            gone += yield from run_concurrently(going)
        if legs := [each.legs for each in gone if each.legs is not None]:
            self._left = self._open(scan)
            yield from run_concurrently(legs)
        return [robot for each in gone for robot in each.moved]

    def _still(self, plan: Plan, together: Iterable[Plan]) -> set[int]:
        """Return the robots that stand at their slots while the robot of one of several plans drives to a wall."""
        occupant = self._slots.occupant
        going = {occupant.get(slot) for each in together if each is not plan for slot in each.path}
        return {robot for robot in occupant.values() if robot not in self._walking and robot not in going}

    def _set_out(self, plan: Plan, scan: ScanResult, still: Collection[int]) -> Routine[SetOut]:
        """Let a robot drive to a wall, and the others close up. The robots `still` stand at their slots meanwhile."""
        slots, pushing = self._slots, self._pushing
        if any(slot not in slots.occupant for slot in plan.path):  # an earlier walk has lost a robot
            return SetOut(())
        self._frontier.note_attempt(plan)
        station = plan.mover in pushing.scan.bases
        if station:
            yield from self._sources.let_out(plan.mover, pushing.cycle, pushing.scan.views[plan.mover], ())
            waiting = self._sources.waiting.get(plan.mover)
            if waiting is None:
                return SetOut(())
            leader = waiting
        else:
            leader = slots.occupant[plan.mover]
            yield from pushing.prepare(plan)
        heading = slots.heading[leader]
        bearing = wrapped(plan.aim - heading)
        to_wall = ToWall(pushing.cycle, bearing, plan.hop_m, CLEAR_M, -plan.hand, plan.half_rad)
        walked = yield from self._order(leader, to_wall)
        if walked is None:  # dead
            self._sources.waiting.pop(plan.mover, None)
            return SetOut((leader,))
        moving = [robot for robot in slots.occupant.values() if robot not in still]
        self._note_near(leader, plan.mover, walked, -plan.hand, moving)
        if walked.end == SHUT:
            pushing.stopped += 1
            return SetOut((leader,))
        self._walking[leader] = None
        followers: Sequence[int] = ()
        if station:
            del self._sources.waiting[plan.mover]
            pushing.pushes += 1
            slots.add(leader)
        else:
            closed_up = yield from pushing.close_up(plan, leader, there=True)
            if closed_up is None:
                return SetOut((leader,))
            followers = closed_up[0]
        self.walks += 1
        if walked.end == OPEN:
            if plan.mover in slots.occupant:
                back = plan.aim + math.pi - heading
                yield from pushing.correct(leader, [(slots.occupant[plan.mover], back)])
            return SetOut((*followers, leader))
        keep = (slots.occupant[plan.mover],) if plan.beside and plan.mover in slots.occupant else ()
        meet = tuple(slots.occupant[each] for each in plan.meet if each in slots.occupant)
        follow = FollowWall(pushing.cycle, LEG_M, plan.hand, keep, meet)
        return SetOut((*followers, leader), self._legs(leader, plan.mover, walked, follow, scan))

    def probe(self, plans: Sequence[Plan], moving: Collection[int]) -> Routine[Moved]:
        """Let the robot of a slot follow walls close by, in the directions of some plans, and return to its slot.

        The robots `moving` do the same meanwhile: where it sees them they are not at their slots.
        """
        slot = plans[0].mover
        robot = self._slots.occupant[slot]
        for plan in plans:
            heading = self._slots.heading[robot]
            bearing = wrapped(plan.direction - heading)
            for hand in (1, -1):
                command = Probe(self._pushing.cycle, bearing, plan.hop_m, hand, plan.half_rad)
                walked = yield from self._order(robot, command)
                if walked is None:
                    return (robot,)
                self._note_near(robot, slot, walked, hand, moving)
                if walked.end == OPEN:
                    break
        return (robot,)

    def _note_near(self, robot: int, slot: int, walked: Walked, hand: int, moving: Collection[int] = ()) -> None:
        """Record how a robot followed a wall close to its slot: what closes arcs there, and what others saw of it.

        A station stands while the robot drives. If a corner hid the robot, the station knows as much as others that saw it.
        """
        heading, station = self._slots.heading[robot], self._slots.occupant[slot]
        sees_all = station == robot or all(each.sees(station) for each in walked.waypoints)
        if sees_all:
            near, beside = walked.near.turned(heading), turned_arcs(walked.near_beside, heading)
            self._walls.note_near(slot, near, hand, robot)
            self._walls.note_near(slot, NearWalls(beside), hand, ANYONE)
        if len(walked.waypoints) > 1:
            way, origin = walked.waypoints, Origin(slot, walked.start) if sees_all else None
            number = self._slots.take_walk(robot, hand, way, walked.radius_m, origin=origin, moving=moving)
            self.idle = without_witnesses(self.idle, self._slots.walks[number].points)

    def axis(self, base: int) -> Routine[Sequence[float]]:
        """Return bearings [rad] for a station's first robot, parallel to a wall nearby: lattices along walls need fewer robots.

        The robot drives to a wall, follows it for a short stretch, and returns. The bearings are in its own frame. They
        begin with the one away from the wall.
        """
        robot = yield from self._sources.release(base, self._pushing.cycle)
        if robot is None:
            return FIRST_BEARINGS_RAD
        cycle = self._pushing.cycle
        for bearing in AXIS_BEARINGS_RAD:
            walked = yield from self._order(robot, ToWall(cycle, bearing, AXIS_HOP_M, 0.0, 1, 0.0))
            if walked is None:
                break
            found = None
            for hand in (1, -1) if walked.end == STRETCH else ():  # the station itself may be in the way
                walked = yield from self._order(robot, FollowWall(cycle, AXIS_M, hand, (), ()))
                if walked is None:
                    return FIRST_BEARINGS_RAD
                found = _line(walked.waypoints)
                if found is not None or walked.end != STRETCH:
                    break
            way = walked.x_m, walked.y_m
            back = Move(cycle, math.atan2(-way[1], -way[0]), math.hypot(*way), ())
            self._mailbox.send(robot, back, drive=True)
            yield from self._mailbox.answers([robot], Arrived)
            if found is not None:
                wall_rad = next(each.touched[0] for each in walked.waypoints if each.touched)
                away = min((found + turn for turn in FIRST_BEARINGS_RAD), key=lambda each: math.cos(each - wall_rad))
                return [away + turn for turn in FIRST_BEARINGS_RAD]
        return FIRST_BEARINGS_RAD

    def first(self, base: int) -> Routine[Moved]:
        """Let the robot that waits at a station follow walls, as far as the station sees it. Its heading is unknown."""
        robot = self._sources.waiting[base]
        cycle, station = self._pushing.cycle, self._slots.occupant[base]
        way = 0.0, 0.0  # from the station, by odometry: a walk begins where the one before has ended
        for bearing in FIRST_BEARINGS_RAD:
            to_wall = ToWall(cycle, bearing, FIRST_HOP_M, 0.0, -1, 0.0)
            walked = yield from self._order(robot, to_wall)
            for hand in (1, -1) if walked is not None else ():
                walked = yield from self._order(robot, FollowWall(cycle, LEG_M, hand, (station,), ()))
                if walked is None or walked.end == LOST:
                    break
            if walked is None:  # dead: the next cycle releases another robot
                del self._sources.waiting[base], self._sources.blocked[base]
                return ()
            way = way[0] + walked.x_m, way[1] + walked.y_m
            if max(walked.driven_m, math.hypot(*way)) > CLEAR_M:
                del self._sources.waiting[base], self._sources.blocked[base]
                self._slots.add(robot)
                return (robot,)
        return ()

    def _legs(self, leader: int, origin: int, there: Walked, leg: FollowWall, scan: ScanResult) -> Routine[None]:
        """Follow the wall, leg by leg, from the slot `origin`; `there` is the way to the wall.

        The robot got clear with the wall at its other hand: so it passes its first slot. A leg that leads where the walk was
        before is the last one: only the noise of bearings could still close something.
        """
        slots, idle_legs = self._slots, 0
        number: int | None = None
        way: list[Waypoint] = []
        others = [each for each in self._walking if each != leader]
        while (self._left > 0.0 or leg.meet) and idle_legs < IDLE_LEGS_MAX:
            walked = yield from self._order(leader, leg)
            if walked is None:
                return
            waypoints = before_meeting(walked.waypoints, others)
            meets = len(waypoints) < len(walked.waypoints)
            there, stays = walked, walked.end in (LOST, MET) and not meets
            repeats = leads_again(way, waypoints)
            way += waypoints
            number = slots.take_walk(leader, leg.hand, waypoints, walked.radius_m, number, stays, moving=others)
            self._note_passed(slots.walks[number])
            if stays:
                self._measure(leader, origin, there, way)
                return
            self.idle = without_witnesses(self.idle, slots.walks[number].points)
            before, self._left = self._left, self._open(scan)
            idle_legs = idle_legs + 1 if self._left > before - PROGRESS_RAD or walked.end == SHUT else 0
            if repeats or meets:
                break
        self._measure(leader, origin, there, way)
        self.idle[slots.slot_of()[leader]] = None

    def _note_passed(self, walk: Walk) -> None:
        """Record the walls close to the slots whose robots a walk has passed, for these robots."""
        slots = self._slots
        for slot, walls, hand in passed_robots(walk, self._reach_m):
            robot = slots.occupant.get(slot)
            if robot is not None and slots.stays.number(slot, robot) == walk.stays[slot]:
                self._walls.note_near(slot, walls, hand, robot)

    def keep_idle(self, scan: ScanResult) -> None:
        """Forget idle slots that are empty, and those without which a station sees no others. `scan` has all robots."""
        occupied = {slot: None for slot in self.idle if slot in self._slots.occupant}
        self.idle = beside_others(occupied, [scan.complex_.neighbours[base] for base in scan.bases])

    def wake(self, scan: ScanResult) -> bool:
        """Let idle slots count again where they are needed; return whether there were any. `scan` has all robots.

        One that stands beside an arc that no walk closed keeps other robots from the wall, and its own place may close the
        arc. It counts again once.
        """
        neighbours, before = scan.complex_.neighbours, self.idle
        self.idle = still_idle(self.idle, neighbours)
        if self.idle == before:
            beside = {each for slot in self._walls.unproven for each in neighbours.get(slot, ())} - self._woken.keys()
            self._woken |= {slot: None for slot in self.idle if slot in beside}
            self.idle = {slot: None for slot in self.idle if slot not in beside}
        return self.idle != before

    def _open(self, scan: ScanResult) -> float:
        """Return the sum of all open arcs [rad]."""
        return added(arc.width_rad for arcs in self._walls.open_arcs(scan).values() for arc in arcs)

    def _measure(self, leader: int, origin: int, walked: Walked, way: Sequence[Waypoint]) -> None:
        """Find the distances of the leader's new slot to the robots in view, by their bearings along its way and odometry.

        Where these do not show the distance to the slot `origin`, it is that of the way from there: the robot that stands there
        now may stand beside the place that the leader left.
        """
        slot_of, length_m = self._slots.slot_of(), self._slots.length_m
        here = slot_of[leader]
        measured = {slot_of[node]: length for node, length in distances_m(way).items() if node in slot_of}
        for slot, length in measured.items():
            length_m[here, slot] = length_m[slot, here] = length
        if origin in self._slots.occupant and origin not in measured:
            length_m[here, origin] = length_m[origin, here] = math.hypot(walked.x_m, walked.y_m)

    def _order(self, robot: int, command: ToWall | FollowWall | Probe) -> Routine[Walked | None]:
        """Return how a walk ended, or None if the robot does not answer. The command names the dead robots."""
        self._mailbox.send(robot, past_dead(command, self._silent), drive=True)
        answers = yield from self._mailbox.answers([robot], Walked)
        answer = answers.get(robot)
        return answer if isinstance(answer, Walked) else None


def past_dead(command: ToWall | FollowWall | Probe, silent: Collection[int]) -> ToWall | FollowWall | Probe:
    """Return the command that names the robots that are silent; the same command if there are none."""
    dead = tuple(silent)[-DEAD_MAX:]
    return PAST_DEAD[type(command)](**msgspec.structs.asdict(command), dead=dead) if dead else command


def before_meeting(way: Sequence[Waypoint], others: Collection[int]) -> Sequence[Waypoint]:
    """Return the waypoints before the first one from which one of the other walking robots was in sight."""
    for number, each in enumerate(way):
        if any(one.node in others for one in each.sightings) or any(one in others for one in each.robots):
            return way[:number]
    return way


def leads_again(way: Sequence[Waypoint], leg: Iterable[Waypoint]) -> bool:
    """Return whether a leg leads along walls where the way before it led, by odometry."""
    in_touch = [each for each in leg if each.touched]
    return bool(in_touch) and all(any(_is_again(each, before) for before in way) for each in in_touch)


def _is_again(point: Waypoint, before: Waypoint) -> bool:
    """Return whether a robot is in touch with the same wall at the same place as before."""
    return math.dist((point.x_m, point.y_m), (before.x_m, before.y_m)) < AGAIN_M and any(
        angle_between(a, b) < SAME_WALL_RAD for a in point.touched for b in before.touched
    )


def _line(waypoints: Sequence[Waypoint]) -> float | None:
    """Return the direction [rad] of the line that waypoints lie on, or None if they do not lie on one."""
    touching = [(each.x_m, each.y_m) for each in waypoints if each.touched]
    if len(touching) < LINE_POINTS_MIN:
        return None
    mx, my = (added(each) / len(touching) for each in zip(*touching, strict=True))
    xx = added((x - mx) ** 2 for x, _ in touching)
    yy = added((y - my) ** 2 for _, y in touching)
    xy = added((x - mx) * (y - my) for x, y in touching)
    middle, half = (xx + yy) / 2.0, math.hypot((xx - yy) / 2.0, xy)
    if middle - half > len(touching) * LINE_OFF_M**2 or middle + half < len(touching) * LINE_ALONG_M**2:
        return None
    return 0.5 * math.atan2(2.0 * xy, xx - yy)
