"""One push, from the robot that goes into the unknown to the scale correction. Ramaithitima et al. 2015, algorithm 1.

Several pushes may be told at once, if none has a place in its path that is anybody's landmark in another.
"""

import math
from collections.abc import Sequence

from zwerm.agents.sensor_coverage.frontier.planner import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.services import FrontierService, Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import Arrived, Cleared, Correct, Deploy, Landmark, Move, Sighting
from zwerm.coordinator.sensor_coverage.command_mailbox import CommandMailbox, Story
from zwerm.coordinator.sensor_coverage.sources import Sources
from zwerm.maths.simplicial import FlagComplex

# Which ways the first robot tries, in its own frame.
FIRST_WAYS_RAD = (0.0, math.pi / 2.0, -math.pi / 2.0, math.pi)

Moved = Sequence[int]


class PushExecution:
    """The pushes of one cycle. `pushes` counts those that led into a new place."""

    def __init__(
        self, rules: PlannerParameters, places: Slots, post: CommandMailbox, sources: Sources, frontier: FrontierService
    ) -> None:
        self.pushes = 0
        self.lost: dict[int, None] = {}  # robots that could not get to their places
        self.cycle = 0
        self.picture = ScanResult({}, FlagComplex({}), ())
        self._rules = rules
        self._places = places
        self._post = post
        self._sources = sources
        self._frontier = frontier
        self._hop_m = rules.link_m - rules.margin_m

    def first(self, base: int) -> Story[Moved]:
        """Deploy a station's first robot, open loop. Algorithm 1, line 1."""
        robot = yield from self._sources.release(base, self.cycle)
        if robot is None:
            return ()
        for bearing in FIRST_WAYS_RAD:
            self._post.say(robot, Deploy(self.cycle, bearing, self._hop_m, self._rules.clear_m), drive=True)
            arrived = yield from self._arrivals([robot])
            if robot not in arrived:  # dead: the next one tries
                del self._sources.waiting[base]
                return ()
            if arrived[robot].ok:
                del self._sources.waiting[base]
                self._places.found(robot)
                yield from self._correct(robot, [(self._places.occupant[base], bearing + math.pi)])
                return (robot,)
        self._sources.blocked[base] = None
        return ()

    def push(self, plan: Plan) -> Story[Moved]:
        """Push along the plan's path; section III-B. Return the robots that moved."""
        places, cycle, path = self._places, self.cycle, plan.path
        base = path[0] if path[0] in self.picture.bases else None
        if plan.mover in self.picture.bases:
            return (yield from self._set_out(plan))
        leader = places.occupant[path[-1]]
        self._frontier.note_attempt(plan)
        if base is not None and not any(each not in path for each in self.picture.views[base]):
            # Whom the base sees is about to move: the next robot must look around before that.
            yield from self._sources.let_out(base, cycle, self.picture.views[base], path)
        bearing = plan.direction - places.heading[leader]
        self._post.say(leader, Deploy(cycle, _wrapped(bearing), plan.hop_m, plan.clear_m), drive=True)
        news = yield from self._post.answers([leader], Cleared, Arrived)
        if leader not in news:  # dead on its way: that says nothing of walls
            return (leader,)
        first = news[leader]
        there: dict[int, Arrived] = {}
        if isinstance(first, Arrived):
            if not first.ok:
                self._frontier.note_failure(plan, first.driven_m)
                return (leader,)
            there = {leader: first}  # that it was clear got lost
        followers = [places.occupant[place] for place in path[:-1]]
        if base is not None:
            yield from self._sources.let_out(base, cycle, self.picture.views[base], path)
            born = self._sources.waiting.pop(base, None)
            if born is None:  # nobody comes: back
                if not there:
                    yield from self._arrivals([leader])
                self._move([leader], [plan.mover], [plan.mover], {})
                yield from self._arrivals([leader])
                return (leader,)
            followers[0] = born
        going = list(path[1:])
        self._move(followers, path[:-1], going, dict(zip(going, followers, strict=True)))
        arrived = there | (yield from self._arrivals([*followers, *([] if there else [leader])]))
        self.pushes += 1
        if base is None:
            places.drop(path[0])
        for place, robot in zip(going, followers, strict=True):
            places.occupant[place] = robot
        places.found(leader)
        followers, going = self._without_lost(followers, going, arrived)
        yield from self._straighten(followers, going, path[0], arrived)
        yield from self._settle(followers, going, arrived)
        anchors = [places.occupant[each] for each in plan.anchors if each in places.occupant]
        if leader in arrived and anchors:
            back = plan.direction + math.pi - places.heading[leader]
            yield from self._correct(leader, [(each, back) for each in anchors])
        return (*followers, leader)

    def _set_out(self, plan: Plan) -> Story[Moved]:
        """Deploy a robot from a station's own place."""
        places, base = self._places, plan.mover
        self._frontier.note_attempt(plan)
        yield from self._sources.let_out(base, self.cycle, self.picture.views[base], ())
        robot = self._sources.waiting.get(base)
        if robot is None:
            return ()
        heading = places.heading[robot]
        order = Deploy(self.cycle, _wrapped(plan.direction - heading), plan.hop_m, plan.clear_m)
        self._post.say(robot, order, drive=True)
        arrived = yield from self._arrivals([robot])
        if robot in arrived and not arrived[robot].ok:  # it waits on
            self._frontier.note_failure(plan, arrived[robot].driven_m)
            return (robot,)
        del self._sources.waiting[base]
        if robot in arrived:
            self.pushes += 1
            places.found(robot)
            yield from self._correct(robot, [(places.occupant[base], plan.direction + math.pi - heading)])
        return (robot,)

    def _move(
        self, robots: Sequence[int], origins: Sequence[int], goals: Sequence[int], future: dict[int, int]
    ) -> None:
        """Tell robots to take the places ahead of them; `future` is who will be where among the places that change."""
        places, bases = self._places, self.picture.bases
        vacated = [place for place in origins if place not in future and place not in bases]
        for robot, origin, goal in zip(robots, origins, goals, strict=True):
            heading = places.heading[robot]
            direction = places.direction(origin, goal)
            length = self._hop_m
            if direction is None:
                direction, length = 0.0, 0.0
            landmarks = []
            for place, there in places.known_from(goal):
                node = future.get(place, places.occupant[place])
                if node == robot or (place in vacated and place not in future and future):
                    continue
                still = place not in future
                landmarks.append(Landmark(node, _wrapped(there - heading), still))
            if origin in bases and sum(each.still for each in landmarks) > 2:
                landmarks = [each for each in landmarks if each.node != places.occupant[origin]]
            order = Move(self.cycle, _wrapped(direction - heading), length, tuple(landmarks))
            self._post.say(robot, order, drive=True)

    def _settle(self, robots: Sequence[int], goals: Sequence[int], arrived: dict[int, Arrived]) -> Story[None]:
        """Who leaned on moving robots finds its place again now that they stand: one by one, rear to front."""
        leaning = {place: robot for place, robot in zip(goals, robots, strict=True) if _leaned(arrived, robot)}
        for _ in range(2):
            again: dict[int, int] = {}
            for place, robot in list(leaning.items()):
                del leaning[place]
                self._move([robot], [place], [place], leaning)
                arrived = yield from self._arrivals([robot])
                if _leaned(arrived, robot):
                    again[place] = robot
            leaning = again

    def _without_lost(
        self, followers: Sequence[int], going: Sequence[int], arrived: dict[int, Arrived]
    ) -> tuple[list[int], list[int]]:
        """Return who arrived, and where. Who says that it did not is of no use where it is: its place is empty."""
        self.lost |= {robot: None for robot in followers if robot in arrived and not arrived[robot].ok}
        for place, robot in zip(going, followers, strict=True):
            if robot in self.lost:
                self._places.drop(place)
        left = [(robot, place) for robot, place in zip(followers, going, strict=True) if robot not in self.lost]
        return [robot for robot, _ in left], [place for _, place in left]

    def _straighten(
        self, followers: Sequence[int], going: Sequence[int], rear: int, arrived: dict[int, Arrived]
    ) -> Story[None]:
        """In single file, rear to front: bearings did not tell how far to go, the range of sight does.

        Who went too far has lost sight of the robot at the place behind, and must be told where it is.
        """
        places = self._places
        for robot, place in zip(followers, going, strict=True):
            back = places.direction(place, rear)
            if robot in arrived and arrived[robot].loose and rear in places.occupant and back is not None:
                yield from self._correct(robot, [(places.occupant[rear], back - places.heading[robot])])
            rear = place

    def _correct(self, robot: int, anchors: Sequence[tuple[int, float]]) -> Story[None]:
        sightings = tuple(Sighting(node, _wrapped(there)) for node, there in anchors)
        self._post.say(robot, Correct(self.cycle, sightings), drive=True)
        yield from self._arrivals([robot])

    def _arrivals(self, robots: Sequence[int]) -> Story[dict[int, Arrived]]:
        answers = yield from self._post.answers(robots, Arrived)
        return {node: answer for node, answer in answers.items() if isinstance(answer, Arrived)}


def _leaned(arrived: dict[int, Arrived], robot: int) -> bool:
    return robot in arrived and arrived[robot].leaned


def _wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)
