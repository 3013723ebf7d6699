"""The coordinator of sensor coverage: survey, fence, path, push, and again until nothing is left to expand.

Algorithm 1 of Ramaithitima et al. 2015. It knows what robots told it over the uplink, and nothing else. What is to be decided
stands behind one interface each (`zwerm.frontier.services`); here is only the story.
"""

import math
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

import msgspec

from zwerm.frontier.assignment import CheapestFirst
from zwerm.frontier.paths import Dijkstra, Reach
from zwerm.frontier.places import Places
from zwerm.frontier.planner import Parameters, Planner
from zwerm.frontier.redundancy import RelativeHomology
from zwerm.frontier.services import Picture, Plan, Services
from zwerm.frontier.termination import COVERED, Quiet
from zwerm.orders import (
    Answer,
    Arrived,
    Cleared,
    Correct,
    Deploy,
    Emerged,
    Landmark,
    Move,
    Order,
    Release,
    Report,
    Sighting,
    Survey,
    encode,
    read_answer,
)
from zwerm.protocol import Command, Observation, Transmission, Wake
from zwerm.simplicial import Edge, FlagComplex

BASE: Final = 0

# A robot that can be spared is taken before any from a base station.
SPARED_COST: Final = -100.0

# How a deployment ends that does not end with all covered.
GIVEN_UP: Final = {
    "depot-dry": "the depot is empty",
    "source-blocked": "no robot gets away from the base",
    "cut-off": "no path leads to the frontier",
    "no-end": "too many cycles",
}
Story = Generator[Wake, None, None]


class Setup(Protocol):
    """What a coordinator needs of its setup."""

    @property
    def dt_s(self) -> float:
        """The period of a tick."""

    @property
    def parameters(self) -> dict[str, Any]:
        """What the scenario set."""


class SensorCoverage:
    """Fills an unknown space with robots, from what they tell by radio (Ramaithitima et al. 2015, algorithm 1)."""

    Parameters = Parameters

    def __init__(self, setup: Setup) -> None:
        self.parameters: Parameters = msgspec.convert(setup.parameters, Parameters)
        self.dt_s = setup.dt_s
        self.places = Places()
        self.services = Services(
            Planner(self.parameters, self.places),
            Dijkstra(self.parameters.obstacle_cost),
            RelativeHomology(),
            CheapestFirst(),
            Quiet(),
        )
        self.picture = Picture({}, FlagComplex({}), (BASE,))
        self.redundant: tuple[int, ...] = ()
        self.outcome = ""
        self.cycle = 0
        self.pushes = 0
        self.released = 0
        self._now_s = 0.0
        self._outbox: list[Transmission] = []
        self._told: dict[str, Any] = {}
        self._mail: list[tuple[int, Answer]] = []
        self._waiting: int | None = None
        self._story = self._tell()

    def step(self, observation: Observation) -> Command:
        """Take the mail and go on."""
        self._now_s = observation.time_s
        for packet in observation.inbox:
            answer = read_answer(packet.payload)
            if answer is not None and packet.sender is not None:
                self._mail.append((packet.sender, answer))
        wake = next(self._story, Wake())
        outbox, self._outbox = tuple(self._outbox), []
        told, self._told = self._told, {}
        return Command(outbox=outbox, wake=wake, done=self.outcome == COVERED, gave_up=self._gave_up(), told=told)

    def _gave_up(self) -> str:
        """Return why the task cannot be completed, if so."""
        reason = GIVEN_UP.get(self.outcome, "")
        return f"{self.outcome}: {reason}, {len(self.services.frontier.frontier)} frontier edges left" if reason else ""

    # --- the story --------------------------------------------------------------------------------------------------

    def _tell(self) -> Story:
        self.places.found(BASE, 0.0)
        self.places.take(BASE, ())
        moved: Sequence[int] = ()
        while self.cycle < self.parameters.cycles_max:
            self.cycle += 1
            yield from self._survey(moved)
            moved = ()
            if len(self.places.occupant) == 1:
                moved = yield from self._first()
                if self.outcome:
                    break
                continue
            plan = self._next()
            self._tell_complex(plan)
            self.outcome = self.services.termination.judge(plan is not None, bool(self.services.frontier.frontier))
            if plan is not None:
                moved = yield from self._push(plan)
            if self.outcome:
                break
        self.outcome = self.outcome or "no-end"
        self._spare()
        self._tell_numbers()
        yield Wake()

    def _next(self) -> Plan | None:
        """Return the deployment to carry out next, if there is any."""
        services, every = self.services, self.parameters.redundancy_every
        if self.pushes and every and self.pushes % every == 0:
            self._spare()
        self.redundant = tuple(place for place in self.redundant if place in self.places.occupant)
        sources = {BASE: 0.0, **dict.fromkeys(self.redundant, SPARED_COST)}

        def ways(complex_: FlagComplex, sources: Mapping[int, float]) -> Reach:
            return services.paths.ways(complex_, sources, services.frontier.obstacle)

        found = services.assignment.assign(services.frontier.plans(), self.picture, sources, ways)
        return found[0] if found else None

    def _spare(self) -> None:
        self.redundant = self.services.redundancy.redundant(self.picture, self.services.frontier.rim())

    def _tell_complex(self, best: Plan | None) -> None:
        """Tell who watches what the swarm looks like, by robots."""
        self._told["complex"] = {
            "cycle": self.cycle,
            "edges": self._by_robot(self.picture.complex_.edges),
            "frontier": self._by_robot(self.services.frontier.frontier),
            "obstacle": self._by_robot(self.services.frontier.obstacle),
            "path": [] if best is None else [self.places.occupant[each] for each in best.path],
        }

    def _by_robot(self, edges: Iterable[Edge]) -> list[list[int]]:
        occupant = self.places.occupant
        return [[occupant[i], occupant[j]] for i, j in edges]

    def _tell_numbers(self) -> None:
        self._told |= {
            "deployment_cycles": self.cycle,
            "pushes": self.pushes,
            "robots_released": self.released,
            "redundant_robots": len(self.redundant),
        }

    def _say(self, node: int, order: Order) -> None:
        self._outbox.append(Transmission("uplink", encode(order), node))

    def _await(
        self, wanted: Callable[[int, Answer], bool], count: int, ticks: int
    ) -> Generator[Wake, None, list[tuple[int, Answer]]]:
        """Wait until `count` answers that are wanted have come, or so many ticks have passed, and return them."""
        until_s = self._now_s + ticks * self.dt_s
        found: list[tuple[int, Answer]] = []
        while True:
            rest: list[tuple[int, Answer]] = []
            for each in self._mail:
                (found if len(found) < count and wanted(*each) else rest).append(each)
            self._mail = rest
            if len(found) >= count or self._now_s >= until_s - 1e-9:
                return found
            yield Wake(at_s=until_s, on_packet=True)

    def _survey(self, moved: Sequence[int]) -> Story:
        """Ask everyone what they see; who does not answer is dead."""
        places, cycle = self.places, self.cycle
        self._mail.clear()
        asked = sorted(places.occupant.values())
        for robot in asked:
            self._say(robot, Survey(cycle, tuple(sorted(moved))))
        answers = yield from self._await(
            lambda _, answer: isinstance(answer, Report) and answer.cycle == cycle,
            len(asked),
            self.parameters.survey_ticks_max,
        )
        place_of = places.place_of()
        reports = {node: answer for node, answer in answers if isinstance(answer, Report)}
        for robot in asked:
            if robot not in reports:
                places.drop(place_of[robot])
        fresh = []
        for robot, report in sorted(reports.items()):
            if report.sightings is not None:
                places.take(robot, report.sightings)
                fresh.append(robot)
        places.learn_headings(fresh)
        for robot, report in sorted(reports.items()):
            place = place_of[robot]
            for bearing in report.touched:
                self._remember(places.walls.setdefault(place, []), bearing + places.heading[robot])
        views = places.views()
        places.learn_references(views)
        self.picture = Picture(views, FlagComplex(views), (BASE,))
        self.services.frontier.look(self.picture)

    @staticmethod
    def _remember(known: list[float], direction: float) -> None:
        if all(_apart(each, direction) > 0.2 for each in known):
            known.append(direction)

    # --- pushing ----------------------------------------------------------------------------------------------------

    def _first(self) -> Generator[Wake, None, Sequence[int]]:
        """Deploy robot 1, open loop. Algorithm 1, line 1."""
        p = self.parameters
        robot = yield from self._release()
        if robot is None:
            self.outcome = "depot-dry"
            return ()
        for bearing in (0.0, math.pi / 2.0, -math.pi / 2.0, math.pi):
            self._say(robot, Deploy(self.cycle, bearing, p.link_m - p.margin_m, p.clear_m))
            arrived = yield from self._arrivals([robot])
            if arrived.get(robot) is not None and arrived[robot].ok:
                self.places.found(robot, 0.0)
                yield from self._correct(robot, [(BASE, bearing + math.pi)])
                return (robot,)
        self.outcome = "source-blocked"
        return ()

    def _release(self) -> Generator[Wake, None, int | None]:
        self._say(self.places.occupant[BASE], Release(self.cycle))
        answers = yield from self._await(
            lambda _, answer: isinstance(answer, Emerged), 1, self.parameters.survey_ticks_max
        )
        for robot, answer in answers:
            if isinstance(answer, Emerged):
                self.released += 1
                self.places.take(robot, answer.sightings)
                return robot
        return None

    def _push(self, plan: Plan) -> Generator[Wake, None, Sequence[int]]:
        """Push along the plan's path; section III-B. Return the robots that moved."""
        places, cycle, path = self.places, self.cycle, plan.path
        robots = [places.occupant[place] for place in path]
        leader = robots[-1]
        self.services.frontier.note_attempt(plan)
        if path[0] == BASE and self._waiting is None and not any(each not in path for each in self.picture.views[BASE]):
            # Whom the base sees is about to move: the next robot must look around before that.
            yield from self._let_out(path)
        bearing = plan.direction - places.heading[leader]
        self._say(leader, Deploy(cycle, _wrapped(bearing), plan.hop_m, plan.clear_m))
        news = yield from self._await(
            lambda node, answer: node == leader and isinstance(answer, Cleared | Arrived),
            1,
            self.parameters.drive_ticks_max,
        )
        first = news[0][1] if news else None
        if first is None or (isinstance(first, Arrived) and not first.ok):
            self.services.frontier.note_failure(plan, math.inf if first is None else first.driven_m)
            return (leader,)
        followers = robots[:-1]
        if path[0] == BASE:
            yield from self._let_out(path)
            born, self._waiting = self._waiting, None
            if born is None:
                self.outcome = "depot-dry"
                self._move([leader], [plan.mover], [plan.mover], {})
                yield from self._arrivals([leader])
                return (leader,)
            followers[0] = born
        going = list(path[1:])
        self._move(followers, path[:-1], going, dict(zip(going, followers, strict=True)))
        arrived = yield from self._arrivals([*followers, leader])
        self.pushes += 1
        if path[0] != BASE:
            places.drop(path[0])
        for place, robot in zip(going, followers, strict=True):
            places.occupant[place] = robot
        places.found(leader, 0.0)
        yield from self._straighten(followers, path, arrived)
        yield from self._settle(followers, going, arrived)
        if leader in arrived:
            back = plan.direction + math.pi - places.heading[leader]
            yield from self._correct(leader, [(places.occupant[each], back) for each in plan.anchors])
        return (*followers, leader)

    def _let_out(self, path: Sequence[int]) -> Story:
        """Have a robot wait at the base, its heading known, unless one does."""
        if self._waiting is not None:
            return
        born = yield from self._release()
        if born is not None:
            self.places.heading[born] = self._heading_at_base(born, path)
            self._waiting = born

    def _heading_at_base(self, born: int, path: Sequence[int]) -> float:
        """Return the heading of a robot that stands on the base and sees what the base sees."""
        base = self.picture.views[BASE]
        place_of = self.places.place_of()
        x = y = 0.0
        for node, bearing in self.places.view[born].items():
            place = place_of.get(node)
            if place is not None and place in base and (place not in path or len(base) == 1):
                x += math.cos(base[place] - bearing)
                y += math.sin(base[place] - bearing)
        return math.atan2(y, x)

    def _move(
        self, robots: Sequence[int], origins: Sequence[int], goals: Sequence[int], future: dict[int, int]
    ) -> None:
        """Tell robots to take the places ahead of them; `future` is who will be where among the places that change."""
        places = self.places
        hop = self.parameters.link_m - self.parameters.margin_m
        vacated = [place for place in origins if place not in future and place != BASE]
        for robot, origin, goal in zip(robots, origins, goals, strict=True):
            heading = places.heading[robot]
            direction = places.direction(origin, goal)
            length = hop
            if direction is None:
                direction, length = 0.0, 0.0
            landmarks = []
            for place, there in places.known_from(goal):
                node = future.get(place, places.occupant[place])
                if node == robot or (place in vacated and place not in future and future):
                    continue
                still = place not in future
                landmarks.append(Landmark(node, _wrapped(there - heading), still))
            if origin == BASE and sum(each.still for each in landmarks) > 2:
                landmarks = [each for each in landmarks if each.node != places.occupant[BASE]]
            self._say(robot, Move(self.cycle, _wrapped(direction - heading), length, tuple(landmarks)))

    def _settle(self, robots: Sequence[int], goals: Sequence[int], arrived: dict[int, Arrived]) -> Story:
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

    def _straighten(self, followers: Sequence[int], path: Sequence[int], arrived: dict[int, Arrived]) -> Story:
        """In single file, rear to front: bearings did not tell how far to go, the range of sight does."""
        rear = self.places.occupant.get(path[0])
        for robot in followers:
            if robot in arrived and arrived[robot].loose and rear is not None:
                yield from self._correct(robot, [(rear, 0.0)])
            rear = robot

    def _correct(self, robot: int, anchors: Sequence[tuple[int, float]]) -> Story:
        self._say(robot, Correct(self.cycle, tuple(Sighting(node, _wrapped(there)) for node, there in anchors)))
        yield from self._arrivals([robot])

    def _arrivals(self, robots: Sequence[int]) -> Generator[Wake, None, dict[int, Arrived]]:
        answers = yield from self._await(
            lambda node, answer: node in robots and isinstance(answer, Arrived),
            len(robots),
            self.parameters.drive_ticks_max,
        )
        return {node: answer for node, answer in answers if isinstance(answer, Arrived)}


def _leaned(arrived: dict[int, Arrived], robot: int) -> bool:
    return robot in arrived and arrived[robot].leaned


def _apart(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))


def _wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)
