"""One push, from the deployment into unknown space to the scale correction. Ramaithitima et al. 2015, section III-B and III-C.

Several pushes may run concurrently if no slot of one path is a landmark in another push.
"""

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Final

from zwerm.agents.sensor_coverage.frontier.decisions import FrontierService
from zwerm.agents.sensor_coverage.frontier.directions import wrapped
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_proof import turned_vector
from zwerm.agents.sensor_coverage.messages.commands import Arrived, Cleared, ComeBack, Correct, Deploy, Move, Sighting
from zwerm.agents.sensor_coverage.motion.push_geometry import (
    FIRST_BEARINGS_RAD,
    SlotReference,
    future_occupants,
    landmarks_for_move,
)
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox, Routine, run_concurrently
from zwerm.coordinator.sensor_coverage.sources import Sources
from zwerm.maths.simplicial import FlagComplex

# Attempts of a robot to home again on landmarks that were moving before.
HOMING_ATTEMPTS: Final = 2
# Failures to reach a slot after which a robot is given up: its motors may be dead. With followed walls it gets a slot where
# it stands before that, because it may fill a passage.
FAILURES_MAX: Final = {"paper": 1, "followed": 2}

# Times that a robot is recalled which sees no robot of the part of the swarm with a station.
RECALLS_MAX: Final = 2

# Robots that have moved.
Moved = Sequence[int]


class PushExecution:
    """The pushes of one cycle.

    `pushes` counts the successful ones, and `stopped` those that a wall stopped, with the leader back at its slot. `lost`
    are robots that are given up, because they did not reach their slots. `scan` and `cycle` are those of the present cycle.
    """

    def __init__(
        self,
        parameters: PlannerParameters,
        slots: Slots,
        mailbox: CommandMailbox,
        sources: Sources,
        frontier: FrontierService,
    ) -> None:
        self.pushes = 0
        self.stopped = 0
        self.lost: dict[int, None] = {}
        self._failures: Counter[int] = Counter()  # slots that a robot did not reach, by robot
        self._recalled: Counter[int] = Counter()  # by robot
        self.cycle = 0
        self.scan = ScanResult({}, FlagComplex({}), ())
        self._parameters = parameters
        self._slots = slots
        self._mailbox = mailbox
        self._sources = sources
        self._frontier = frontier

    # --- kinds of deployment ------------------------------------------------------------------------------------------

    def deploy_first(self, base: int, bearings: Sequence[float] = FIRST_BEARINGS_RAD) -> Routine[Moved]:
        """Deploy a station's first robot along one of some bearings [rad], open loop. Algorithm 1, line 1."""
        robot = yield from self._sources.release(base, self.cycle)
        if robot is None:
            return ()
        for bearing in bearings:
            command = Deploy(self.cycle, bearing, self._parameters.hop_m, self._parameters.clear_m)
            self._mailbox.send(robot, command, drive=True)
            arrived = yield from self._arrivals([robot])
            if robot not in arrived:  # dead: the next cycle releases another robot
                del self._sources.waiting[base]
                return ()
            if arrived[robot].ok:
                del self._sources.waiting[base]
                self._slots.add(robot)
                yield from self.correct(robot, [(self._slots.occupant[base], bearing + math.pi)])
                return (robot,)
        self._sources.blocked[base] = None
        return ()

    def push_all(self, plans: Sequence[Plan]) -> Routine[Moved]:
        """Push along the paths of plans, and return the robots that moved.

        All leaders drive at once. The robots behind one whose plan waits follow after those of all earlier plans: their way may
        lead through the slot that an earlier leader has left.
        """
        ahead: dict[Plan, tuple[int, dict[int, Arrived] | None]] = {}
        moved: list[int] = []

        def go(plan: Plan) -> Routine[None]:
            if plan.waits:
                ahead[plan] = yield from self._lead(plan)
            else:
                moved.extend((yield from self.push(plan)))

        yield from run_concurrently([go(plan) for plan in plans])
        for plan in (each for each in plans if each.waits):
            leader, there = ahead[plan]
            moved += [leader] if there is None else (yield from self._follow(plan, leader, bool(there)))
        return moved

    def push(self, plan: Plan) -> Routine[Moved]:
        """Push along the plan's path, and return the robots that moved. Algorithm 1, lines 7 and 8."""
        if plan.mover in self.scan.bases:
            return (yield from self._set_out(plan))
        leader, there = yield from self._lead(plan)
        return (leader,) if there is None else (yield from self._follow(plan, leader, bool(there)))

    def _lead(self, plan: Plan) -> Routine[tuple[int, dict[int, Arrived] | None]]:
        """Let the robot at the mover's slot drive; return it, and what `_test_drive` returns."""
        leader = self._slots.occupant[plan.mover]
        self._frontier.note_attempt(plan)
        if not plan.waits:
            yield from self.prepare(plan)
        return leader, (yield from self._test_drive(plan, leader))

    def _follow(self, plan: Plan, leader: int, there: bool) -> Routine[Moved]:
        """Move the robots behind the leader up, and correct its place. It has arrived before if `there`."""
        slots = self._slots
        if any(slot not in slots.occupant for slot in plan.path):  # an earlier push has lost a robot
            yield from self._drive_back(plan, leader, there)
            return (leader,)
        if plan.waits:
            yield from self.prepare(plan)
        closed_up = yield from self.close_up(plan, leader, there)
        if closed_up is None:
            return (leader,)
        followers, arrived = closed_up
        anchors = [slots.occupant[each] for each in plan.anchors if each in slots.occupant]
        if arrived and anchors:
            back = plan.direction + math.pi - slots.heading[leader]
            there_now = yield from self.correct(leader, [(each, back) for each in anchors])
            slot = slots.slot_of().get(leader)
            if there_now is not None and slot is not None:
                slots.note_way(plan.mover, slot, turned_vector(there_now.way, slots.heading[leader]), False)
        return (*followers, leader)

    def _drive_back(self, plan: Plan, leader: int, there: bool) -> Routine[None]:
        """Let the leader drive back to its slot."""
        if not there:
            yield from self._arrivals([leader])
        self._move([leader], [plan.mover], [plan.mover], {})
        yield from self._arrivals([leader])

    def prepare(self, plan: Plan) -> Routine[None]:
        """Release the next robot early if all robots in sight of its station are about to move: it averages bearings before."""
        base = plan.path[0]
        if base in self.scan.bases and not any(each not in plan.path for each in self.scan.views[base]):
            yield from self._sources.let_out(base, self.cycle, self.scan.views[base], plan.path)

    def _set_out(self, plan: Plan) -> Routine[Moved]:
        """Deploy a robot from a station's own slot."""
        slots, base = self._slots, plan.mover
        self._frontier.note_attempt(plan)
        yield from self._sources.let_out(base, self.cycle, self.scan.views[base], ())
        robot = self._sources.waiting.get(base)
        if robot is None:
            return ()
        heading = slots.heading[robot]
        command = Deploy(self.cycle, wrapped(plan.direction - heading), plan.hop_m, plan.clear_m)
        self._mailbox.send(robot, command, drive=True)
        arrived = yield from self._arrivals([robot])
        if robot in arrived and not arrived[robot].ok:  # it goes on waiting
            self.stopped += 1
            self._frontier.note_failure(plan, arrived[robot].driven_m)
            return (robot,)
        del self._sources.waiting[base]
        if robot in arrived:
            self.pushes += 1
            slots.add(robot)
            yield from self.correct(robot, [(slots.occupant[base], plan.direction + math.pi - heading)])
        return (robot,)

    def close_up(self, plan: Plan, leader: int, there: bool) -> Routine[tuple[list[int], bool] | None]:
        """Move the robots behind the leader up by one slot, and give the leader a new slot.

        Return the followers that have arrived, and whether the leader has; `there` if it has arrived before. None: the
        depot is empty, and the leader drives back.
        """
        slots, path = self._slots, plan.path
        base = path[0] if path[0] in self.scan.bases else None
        followers = [slots.occupant[slot] for slot in path[:-1]]
        if base is not None:
            yield from self._sources.let_out(base, self.cycle, self.scan.views[base], path)
            released = self._sources.waiting.pop(base, None)
            if released is None:
                yield from self._drive_back(plan, leader, there)
                return None
            followers[0] = released
        going = list(path[1:])
        self._move(followers, path[:-1], going, future_occupants(path, followers))
        arrived = yield from self._arrivals([*followers, *([] if there else [leader])])
        self.pushes += 1
        if base is None:
            slots.drop(path[0])
        for slot, robot in zip(going, followers, strict=True):
            slots.occupant[slot] = robot
        slots.add(leader)
        there = there or leader in arrived
        followers, going = self._without_lost(followers, going, arrived)
        at_landmarks = [robot for robot in followers if _found_by_still_landmarks(arrived, robot)]
        arrived = arrived | (yield from self._home_again(followers, going, arrived))  # others use them as a ruler
        yield from self._straighten(followers, going, path[0], arrived, at_landmarks)
        return followers, there

    # --- steps of a push ----------------------------------------------------------------------------------------------

    def _test_drive(self, plan: Plan, leader: int) -> Routine[dict[int, Arrived] | None]:
        """Deploy the leader until its slot is clear; None if a wall or its death prevents the push.

        The result has the leader's arrival if its message that the slot is clear was lost.
        """
        bearing = plan.direction - self._slots.heading[leader]
        self._mailbox.send(leader, Deploy(self.cycle, wrapped(bearing), plan.hop_m, plan.clear_m), drive=True)
        answers = yield from self._mailbox.answers([leader], Cleared, Arrived)
        if leader not in answers:  # its death says nothing about walls
            return None
        answer = answers[leader]
        if not isinstance(answer, Arrived):
            return {}
        if not answer.ok:
            self.stopped += 1
            self._frontier.note_failure(plan, answer.driven_m)
            return None
        return {leader: answer}

    def _move(
        self, robots: Sequence[int], origins: Sequence[int], goals: Sequence[int], future: Mapping[int, int]
    ) -> None:
        """Command robots to move from their origins to the slots ahead; `future` has the next occupants of these slots."""
        slots, bases = self._slots, self.scan.bases
        vacated = [slot for slot in origins if slot not in future and slot not in bases] if future else []
        for robot, origin, goal in zip(robots, origins, goals, strict=True):
            heading = slots.heading[robot]
            direction = slots.direction(origin, goal)
            hop_m = slots.length_m.get((origin, goal), self._parameters.hop_m)
            if direction is None:
                direction, hop_m = 0.0, 0.0
            landmarks = landmarks_for_move(
                (SlotReference(slot, slots.occupant[slot], there) for slot, there in slots.known_from(goal)),
                future,
                robot,
                heading,
                vacated,
                station=origin if origin in bases else None,
            )
            self._mailbox.send(robot, Move(self.cycle, wrapped(direction - heading), hop_m, landmarks), drive=True)

    def _without_lost(
        self, followers: Sequence[int], going: Sequence[int], arrived: Mapping[int, Arrived]
    ) -> tuple[list[int], list[int]]:
        """Return the followers that have arrived, and their slots; the slots of the others are empty."""
        failed = [robot for robot in followers if robot in arrived and not arrived[robot].ok]
        self._failures.update(failed)
        failures_max = FAILURES_MAX[self._parameters.walls]
        self.lost |= {robot: None for robot in failed if self._failures[robot] >= failures_max}
        for slot, robot in zip(going, followers, strict=True):
            if robot in failed:
                self._slots.drop(slot)
        left = [(robot, slot) for robot, slot in zip(followers, going, strict=True) if robot not in failed]
        return [robot for robot, _ in left], [slot for _, slot in left]

    def _straighten(
        self,
        followers: Sequence[int],
        going: Sequence[int],
        rear: int,
        arrived: Mapping[int, Arrived],
        at_landmarks: Collection[int],
    ) -> Routine[None]:
        """Correct distances in a single file, rear to front, where bearings did not determine them.

        A robot that drove too far does not see the robot behind, so the command names its direction. The robots
        `at_landmarks` found their places by robots that did not move.
        """
        slots = self._slots
        for robot, slot in zip(followers, going, strict=True):
            back, there = slots.direction(slot, rear), arrived.get(robot)
            by_odometry = there is not None and there.used_odometry
            # Walls, and not the range of sight, determine a distance that was measured.
            if by_odometry and (slot, rear) not in slots.length_m and rear in slots.occupant and back is not None:
                there = yield from self.correct(robot, [(slots.occupant[rear], back - slots.heading[robot])])
            if there is not None:
                way = turned_vector(there.way, slots.heading[robot])
                slots.note_way(rear, slot, way, by_odometry, robot in at_landmarks)
            rear = slot

    def _home_again(
        self, robots: Sequence[int], goals: Sequence[int], arrived: Mapping[int, Arrived]
    ) -> Routine[dict[int, Arrived]]:
        """Home again on landmarks that were moving before, in groups of robots that are no landmarks of each other.

        A robot that has not returned to its slot yet is no landmark of others, unless these have no other landmarks. A robot
        that needs it goes once more. Return the last arrivals of these robots.
        """
        last: dict[int, Arrived] = {}
        unsettled = {
            slot: robot for slot, robot in zip(goals, robots, strict=True) if _used_moving_landmarks(arrived, robot)
        }
        for _ in range(HOMING_ATTEMPTS):
            pending = dict(unsettled)
            while pending:
                knows = {slot: [other for other, _ in self._slots.known_from(slot)] for slot in pending}
                group = {slot: pending[slot] for slot in no_landmarks_of_each_other(knows)}
                pending = {slot: robot for slot, robot in pending.items() if slot not in group}
                for slot, robot in group.items():
                    self._move([robot], [slot], [slot], unsettled)
                arrived = yield from self._arrivals(list(group.values()))
                last |= arrived
                unsettled = {
                    slot: robot
                    for slot, robot in unsettled.items()
                    if slot not in group or (robot in arrived and _waits_for_others(arrived[robot]))
                }
        return last

    def recalls(self, silent: Collection[int]) -> list[Routine[Moved]]:
        """Return the return of one robot that is cut off from all stations: where walls are followed, its way is known.

        `silent` are the robots that do not answer: to see them is not enough, nor to see one that waits for a station.
        """
        no_help = *silent, *self._sources.waiting.values()
        stations, occupant = self._sources.alive(), self._slots.occupant
        if self._parameters.walls == "paper" or not stations:
            return []
        for piece in self.scan.complex_.components():
            slots = [slot for slot in piece if self._recalled[occupant[slot]] < RECALLS_MAX]
            if slots and not any(slot in stations for slot in piece):
                return [self._recall(max(slots), [*(occupant[slot] for slot in piece), *no_help])]
        return []

    def _recall(self, slot: int, apart: Collection[int]) -> Routine[Moved]:
        """Let a robot drive back on its way into sight of a robot that is not one of `apart`; it gets a slot there."""
        robot = self._slots.occupant[slot]
        self._recalled[robot] += 1
        self._mailbox.send(robot, ComeBack(self.cycle, tuple(apart)), drive=True)
        if robot in (yield from self._arrivals([robot])):
            self._slots.drop(slot)
            self._slots.add(robot)
        return (robot,)

    def correct(self, robot: int, anchors: Sequence[tuple[int, float]]) -> Routine[Arrived | None]:
        """Correct a robot's scale by anchors with their approximate bearings [rad]; return its arrival unless it is dead."""
        sightings = tuple(Sighting(node, wrapped(there)) for node, there in anchors)
        self._mailbox.send(robot, Correct(self.cycle, sightings), drive=True)
        return (yield from self._arrivals([robot])).get(robot)

    def _arrivals(self, robots: Collection[int]) -> Routine[dict[int, Arrived]]:
        """Wait until robots have arrived or are given up."""
        answers = yield from self._mailbox.answers(robots, Arrived)
        return {node: answer for node, answer in answers.items() if isinstance(answer, Arrived)}


def no_landmarks_of_each_other(knows: Mapping[int, Collection[int]]) -> list[int]:
    """Return slots of which none is a landmark of another, the first one included; `knows` has each slot's landmarks."""
    found: list[int] = []
    for slot, landmarks in knows.items():
        if not any(each in landmarks or slot in knows[each] for each in found):
            found.append(slot)
    return found


def _waits_for_others(arrived: Arrived) -> bool:
    """Return whether landmarks that have not returned to their slots determine the place, and odometry does not."""
    return arrived.used_moving_landmarks and not arrived.used_odometry


def _used_moving_landmarks(arrived: Mapping[int, Arrived], robot: int) -> bool:
    return robot in arrived and arrived[robot].used_moving_landmarks


def _found_by_still_landmarks(arrived: Mapping[int, Arrived], robot: int) -> bool:
    """Return whether bearings of landmarks that did not move determine the place of a robot."""
    there = arrived.get(robot)
    return there is not None and not (there.used_odometry or there.used_moving_landmarks)
