"""The coordinator of sensor coverage: survey, fence, path, push, and again until nothing is left to expand.

Algorithm 1 of Ramaithitima et al. 2015. It knows what robots told it over the uplink, and nothing else. What is to be decided
stands behind one interface each (`zwerm.agents.sensor_coverage.frontier.services`); here is only the story.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

import msgspec

from zwerm.agents.sensor_coverage.frontier.assignment import CheapestFirst
from zwerm.agents.sensor_coverage.frontier.paths import Dijkstra, Reach
from zwerm.agents.sensor_coverage.frontier.planner import Planner, PlannerParameters
from zwerm.agents.sensor_coverage.frontier.quiescence import COVERED, QuiescenceDetector
from zwerm.agents.sensor_coverage.frontier.relative_homology import RelativeHomology
from zwerm.agents.sensor_coverage.frontier.services import Plan, ScanResult, Services
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import LIVES, Emerged, Report, RollCall, ScanRequest
from zwerm.coordinator.sensor_coverage.command_mailbox import MUSTER_COPIES, CommandMailbox, Story, together
from zwerm.coordinator.sensor_coverage.leave_requests import LeaveRequests
from zwerm.coordinator.sensor_coverage.push_execution import Moved, PushExecution
from zwerm.coordinator.sensor_coverage.sources import Sources
from zwerm.maths.keyed_random import stream
from zwerm.maths.simplicial import Edge, FlagComplex
from zwerm.wire.messages import Command, Observation, Wake

# A robot that can be spared is taken before any from a base station.
SPARED_COST: Final = -100.0

# So long it rests between surveys while it watches over what is covered.
WATCH_TICKS: Final = 50

# How a deployment ends that does not end with all covered.
GIVEN_UP: Final = {
    "depot-dry": "the depot is empty",
    "source-blocked": "no robot gets away from the base",
    "source-lost": "no base station answers",
    "cut-off": "no path leads to the frontier",
    "no-end": "too many cycles",
}


class CoordinatorSetup(Protocol):
    """What a coordinator needs of its setup."""

    @property
    def dt_s(self) -> float:
        """The period of a tick."""

    @property
    def parameters(self) -> dict[str, Any]:
        """What the scenario set."""

    @property
    def bases(self) -> tuple[int, ...]:
        """The ids of the base stations."""

    @property
    def stream_key(self) -> bytes:
        """The key of its own stream of randomness, another one in each life."""

    @property
    def services(self) -> dict[str, str]:
        """Who provides which service."""

    @property
    def incarnation(self) -> int:
        """How often it has begun."""


class SensorCoverageCoordinator:
    """Fills an unknown space with robots, from what they tell by radio (Ramaithitima et al. 2015, algorithm 1)."""

    Parameters = PlannerParameters

    def __init__(self, setup: CoordinatorSetup) -> None:
        rules: PlannerParameters = msgspec.convert(setup.parameters, PlannerParameters)
        self.parameters = rules
        self.places = Slots()
        life = int(stream(setup.stream_key).integers(1, LIVES))
        self.post = CommandMailbox(setup.dt_s, life, rules.survey_ticks_max, rules.drive_ticks_max)
        self.sources = Sources(setup.bases, self.places, self.post)
        planner = Planner(rules, self.places)
        self.services = Services(
            planner,
            Dijkstra(rules.obstacle_cost),
            RelativeHomology(),
            CheapestFirst(self.places, rules.pushes_max),
            QuiescenceDetector(),
        )
        self.pushing = PushExecution(rules, self.places, self.post, self.sources, planner)
        self.picture = ScanResult({}, FlagComplex({}), ())
        self.redundant: tuple[int, ...] = ()
        self.outcome = ""
        self.cycle = 0
        self._anew = setup.incarnation > 1
        self._conference = LeaveRequests(rules.corner_margin_rad, self.places, self.post)
        self._spares = setup.services.get("redundancy", "coordinator")
        self._spared_at = 0
        self._silent: dict[int, None] = {}
        self._told: dict[str, Any] = {}
        self._story = self._tell()

    def step(self, observation: Observation) -> Command:
        """Take the mail and go on."""
        self.post.take(observation.time_s, observation.inbox)
        wake = next(self._story, Wake())
        told, self._told = self._told, {}
        outbox = self.post.sent()
        again_s = None if self.outcome else self.post.next_s()
        if again_s is not None and (wake.at_s is None or again_s < wake.at_s):
            wake = Wake(at_s=again_s, on_packet=wake.on_packet)
        return Command(
            outbox=outbox,
            wake=wake,
            done=self.outcome == COVERED,
            gave_up=self._gave_up(),
            told=told,
        )

    def _gave_up(self) -> str:
        """Return why the task cannot be completed, if so."""
        reason = GIVEN_UP.get(self.outcome, "")
        return (
            f"{self.outcome}: {reason}; frontier edges left: {len(self.services.frontier.frontier)}" if reason else ""
        )

    # --- the story --------------------------------------------------------------------------------------------------

    def _tell(self) -> Story[None]:
        moved: Moved = ()
        self.post.muster(RollCall(1), MUSTER_COPIES if self._anew else 1)
        while self.cycle < self.parameters.cycles_max and not self.outcome:
            self.cycle += 1
            yield from self._survey(moved)
            stories, plans = yield from self._next()
            self._tell_complex(plans)
            self.outcome = self._judge(bool(stories))
            moved = [robot for each in (yield from together(stories)) for robot in each]
            if self.outcome == "source-lost" and self.post.suspect():
                self.outcome = ""
                self._ask_stations_again()
            if self.outcome == COVERED and self.post.now_s < self.parameters.watch_until_s:
                self.outcome = ""
                yield from self.post.pause(WATCH_TICKS)
        self.outcome = self.outcome or "no-end"
        if self._spares == "coordinator":
            yield from self._spare()
        self._tell_numbers()
        yield Wake()

    def _ask_stations_again(self) -> None:
        for place, base in self.sources.stations.items():
            self.places.occupant[place] = base
            self._silent.pop(base, None)

    def _judge(self, busy: bool) -> str:
        """Return the outcome, or nothing while it goes on.

        An empty frontier says that all is covered where nobody is cut off from all stations, and somebody got anywhere.
        """
        outcome = self.services.termination.judge(busy, bool(self.services.frontier.frontier))
        sources, pieces = self.sources, self.picture.complex_.components()
        stations = sources.alive()
        alone = all(place in stations for piece in pieces for place in piece)
        whole = [len(piece) > 1 for piece in pieces] == [True] or all(
            any(place in stations for place in piece) for piece in pieces
        )
        if not outcome or (outcome == COVERED and whole and not alone):
            return outcome
        if not stations:
            return "source-lost"
        if sources.dry:
            return "depot-dry"
        return "source-blocked" if alone else "cut-off"

    # --- what to do next --------------------------------------------------------------------------------------------

    def _next(self) -> Story[tuple[list[Story[Moved]], Sequence[Plan]]]:
        """Return what to do in this cycle: pushes, or the first ones of stations that see no robot but stations."""
        seen, stations = self.picture.complex_.neighbours, self.sources.alive()
        lonely = [place for place in self.sources.open() if all(each in stations for each in seen[place])]
        if lonely:
            return [self.pushing.first(place) for place in lonely], ()
        pushes, every = self.pushing.pushes, self.parameters.redundancy_every
        again = pushes == self._spared_at and self._spares == "coordinator"
        if every and pushes and (pushes // every > self._spared_at // every or again):
            yield from self._spare()
        plans = self._assign()
        if not plans and self.sources.dry:
            yield from self._spare()
            plans = self._assign()
        return [self.pushing.push(plan) for plan in plans], plans

    def _assign(self) -> tuple[Plan, ...]:
        services = self.services
        self.redundant = tuple(place for place in self.redundant if place in self.places.occupant)
        shut = self.picture.bases  # a station does not move
        sources = dict.fromkeys(self.sources.open(), 0.0) | dict.fromkeys(self.redundant, SPARED_COST)

        def ways(complex_: FlagComplex, sources: Mapping[int, float]) -> Reach:
            return services.paths.ways(complex_, sources, services.frontier.obstacle, shut)

        return services.assignment.assign(services.frontier.plans(), self.pushing.picture, sources, ways)

    def _spare(self) -> Story[None]:
        """Find out who can be spared, or have the robots find out."""
        if self._spares == "none":
            return
        self._spared_at = self.pushing.pushes
        rim = self.services.frontier.rim()
        if self._spares == "coordinator":
            self.redundant = self.services.redundancy.redundant(self.picture, rim)
        else:
            yield from self._conference.hold(self.picture, rim, self._silent, self.cycle)
            self._draw(self.pushing.picture)

    # --- the survey -------------------------------------------------------------------------------------------------

    def _survey(self, moved: Moved) -> Story[None]:
        """Ask everyone what they see; who does not answer is dead, until it says something."""
        places = self.places
        self._welcome()
        asked = sorted(places.occupant.values())
        reports = yield from self._ask(asked, moved)
        place_of = places.place_of()
        for robot in asked:
            if robot not in reports:
                places.drop(place_of[robot])
        self._look(reports)
        at_door: dict[int, tuple[int, Report]] = {}
        while strangers := self._strangers(reports, at_door):
            answers = yield from self._ask(strangers, ())
            doors = {robot: self.sources.door(robot) for robot, answer in answers.items() if answer.home}
            at_door |= {robot: (door, answers.pop(robot)) for robot, door in doors.items() if door is not None}
            for robot in answers:
                places.found(robot)
                self.sources.out[robot] = None
            self._look(answers)
            reports |= answers
        self._ping(reports)
        places.learn_headings(robot for robot, report in sorted(reports.items()) if report.sightings is not None)
        place_of = places.place_of()
        for robot, report in sorted(reports.items()):
            place = place_of[robot]
            for bearing in report.touched:
                self._remember(places.walls.setdefault(place, []), bearing + places.heading[robot])
        views = places.views()
        places.learn_references(views)
        for robot, (door, report) in at_door.items():
            self.sources.adopt(robot, door, report.sightings or (), views[door])
        self._conference.note(reports)
        self._draw(ScanResult(views, FlagComplex(views), tuple(self.sources.alive())))
        self.pushing.cycle = self.cycle

    def _draw(self, whole: ScanResult) -> None:
        """Take what the survey found for the picture, but for robots that have left: these are where pushes begin."""
        self.picture = self.pushing.picture = whole
        if self._spares == "link":
            self.redundant = self._conference.spare(whole)
            if self.redundant:
                self.picture = whole._replace(complex_=whole.complex_.without(self.redundant))
        self.services.frontier.look(self.picture)

    def _look(self, reports: Mapping[int, Report]) -> None:
        for robot, report in reports.items():
            if report.sightings is not None:
                self.places.take(robot, report.sightings)

    def _ask(self, robots: Sequence[int], moved: Moved) -> Story[dict[int, Report]]:
        """Return what robots report, by robot; who does not answer in time is not asked again.

        Of whom nothing is known, its own reading is asked for as if it had moved: "as before" would tell nothing.
        """
        cycle, known = self.cycle, self.places.view
        for robot in robots:
            if cycle == 1:
                self.post.expect(robot)
            else:
                self.post.say(robot, ScanRequest(cycle, tuple(sorted(moved if robot in known else {*moved, robot}))))
        answers = yield from self.post.answers(robots, Report)
        reports = {node: answer for node, answer in answers.items() if isinstance(answer, Report)}
        self._silent |= dict.fromkeys(robot for robot in robots if robot not in reports)
        return reports

    def _strangers(self, reports: Mapping[int, Report], at_door: Collection[int]) -> list[int]:
        """Return robots that are seen and have no place: a coordinator that begins anew finds the swarm as it is."""
        waiting = self.sources.waiting.values()
        known = {*self.places.occupant.values(), *waiting, *at_door, *self._silent, *self.pushing.lost}
        seen = {each.node for report in reports.values() for each in report.sightings or ()}
        return sorted(seen - known)

    def _ping(self, reports: Mapping[int, Report]) -> None:
        """Ask those who were given up for dead and are still seen, and wait for no answer: they may be back one day."""
        seen = {node for robot in reports for node in self.places.view.get(robot, ())}
        for robot in self._silent:
            if robot in seen and not self.post.waits_for(robot):
                self.post.say(robot, ScanRequest(self.cycle, (robot,)), ping=True)

    def _welcome(self) -> None:
        """Give a place to those who were given up for dead, and speak; who begins anew has a frame of its own."""
        placed = self.places.place_of()
        for robot, answer in self.post.rest():
            if isinstance(answer, Emerged) and robot in self.places.heading:
                self.places.orient(robot, robot, 0.0)
            if robot in self._silent and robot not in placed:
                del self._silent[robot]
                station = self.sources.place_of(robot)
                if station is None:
                    self.places.found(robot)
                else:
                    self.places.occupant[station] = robot

    @staticmethod
    def _remember(known: list[float], direction: float) -> None:
        if all(_apart(each, direction) > 0.2 for each in known):
            known.append(direction)

    # --- for those who watch ----------------------------------------------------------------------------------------

    def _tell_complex(self, plans: Iterable[Plan]) -> None:
        """Tell who watches what the swarm looks like, by robots."""
        self._told["complex"] = {
            "cycle": self.cycle,
            "edges": self._by_robot(self.picture.complex_.edges),
            "frontier": self._by_robot(self.services.frontier.frontier),
            "obstacle": self._by_robot(self.services.frontier.obstacle),
            "paths": [[self.places.occupant[each] for each in plan.path] for plan in plans],
        }

    def _by_robot(self, edges: Iterable[Edge]) -> list[list[int]]:
        occupant = self.places.occupant
        return [[occupant[i], occupant[j]] for i, j in edges]

    def _tell_numbers(self) -> None:
        self._told |= {
            "deployment_cycles": self.cycle,
            "pushes": self.pushing.pushes,
            "robots_released": len(self.sources.out),
            "redundant_robots": len(self.redundant),
        }


def _apart(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))
