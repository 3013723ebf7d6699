"""The coordinator of sensor coverage: Algorithm 1 of Ramaithitima et al. 2015.

It knows only the robots' reports over the uplink. Each decision stands behind an interface
(`zwerm.agents.sensor_coverage.frontier.decisions`). `SensorCoverageCoordinator._algorithm_1` is the algorithm as the
paper prints it.
"""

from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from typing import Any, Final, Protocol

import msgspec

from zwerm.agents.sensor_coverage.frontier.decisions import Services
from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes, Dijkstra
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner import Planner
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.commands import INCARNATIONS, Emerged, Report, RollCall, ScanRequest
from zwerm.coordinator.sensor_coverage.assignment import CheapestFirst
from zwerm.coordinator.sensor_coverage.command_mailbox import (
    ROLL_CALL_COPIES,
    CommandMailbox,
    Routine,
    run_concurrently,
)
from zwerm.coordinator.sensor_coverage.complex_reports import encoded_complex
from zwerm.coordinator.sensor_coverage.leave_requests import LeaveRequests
from zwerm.coordinator.sensor_coverage.push_execution import Moved, PushExecution
from zwerm.coordinator.sensor_coverage.quiescence import COVERED, GIVEN_UP, QuiescenceDetector, ScanSchedule
from zwerm.coordinator.sensor_coverage.relative_homology import RelativeHomology
from zwerm.coordinator.sensor_coverage.sources import Sources
from zwerm.coordinator.sensor_coverage.wall_walks import WallWalks
from zwerm.maths.keyed_random import stream
from zwerm.maths.simplicial import FlagComplex
from zwerm.wire.messages import Command, Observation, Wake

# Cost to start a path at a redundant robot: it is preferred to any station.
REDUNDANT_COST: Final = -100.0

# Pause [ticks] between scans while the coordinator watches a covered space.
WATCH_TICKS: Final = 50


class SensorCoverageSetup(Protocol):
    """The parts of its setup that the coordinator uses."""

    @property
    def dt_s(self) -> float:
        """The period of a tick [s]."""

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters that the scenario sets."""

    @property
    def bases(self) -> tuple[int, ...]:
        """The ids of the base stations."""

    @property
    def stream_key(self) -> bytes:
        """The key of its random stream, another one in each incarnation."""

    @property
    def services(self) -> dict[str, str]:
        """The provider of each service."""

    @property
    def incarnation(self) -> int:
        """The number of its starts, 1 at first."""


class SensorCoverageCoordinator:
    """Fills an unknown space with robots, by their reports over the uplink."""

    Parameters = PlannerParameters

    def __init__(self, setup: SensorCoverageSetup) -> None:
        parameters: PlannerParameters = msgspec.convert(setup.parameters, PlannerParameters)
        self.parameters = parameters
        self.slots = Slots()
        incarnation = int(stream(setup.stream_key).integers(1, INCARNATIONS))
        self.mailbox = CommandMailbox(setup.dt_s, incarnation, parameters.survey_ticks_max, parameters.drive_ticks_max)
        self.sources = Sources(setup.bases, self.slots, self.mailbox)
        planner = Planner(parameters, self.slots, SwarmProof())
        self.services = Services(
            planner,
            Dijkstra(parameters.obstacle_cost),
            RelativeHomology(),
            CheapestFirst(self.slots, parameters.pushes_max, planner.attempt_log),
            QuiescenceDetector(),
        )
        self.pushing = PushExecution(parameters, self.slots, self.mailbox, self.sources, planner)
        self.walls = planner.walls
        self._silent: dict[int, None] = {}
        parts = self.slots, self.mailbox, self.sources, self.pushing, planner
        self.walking = WallWalks(*parts, planner.walls, parameters.hop_m, self._silent)
        self.scan = ScanResult({}, FlagComplex({}), ())
        self.redundant: tuple[int, ...] = ()
        self.outcome = ""
        self.cycle = 0
        self._schedule = ScanSchedule()
        self._restarted = setup.incarnation > 1
        self._leave_requests = LeaveRequests(parameters.corner_margin_rad, self.slots, self.mailbox)
        self._redundancy = setup.services.get("redundancy", "coordinator")
        self._redundancy_at = 0  # number of pushes when redundant robots were last searched
        self._telemetry: dict[str, float | bool] = {}
        self._snapshot = b""
        self._routine = self._run()

    def step(self, observation: Observation) -> Command:
        """Take in the reports of a tick, and go on with the algorithm."""
        self.mailbox.receive(observation.time_s, observation.inbox)
        wake = next(self._routine, Wake())
        telemetry, self._telemetry = self._telemetry, {}
        snapshot, self._snapshot = self._snapshot, b""
        outbox = self.mailbox.outgoing(len(snapshot))
        repeat_s = None if self.outcome else self.mailbox.next_wake_s()
        if repeat_s is not None and (wake.at_s is None or repeat_s < wake.at_s):
            wake = Wake(at_s=repeat_s, on_packet=wake.on_packet)
        return Command(
            outbox=outbox,
            wake=wake,
            done=self.outcome == COVERED,
            gave_up=self._gave_up(),
            telemetry=telemetry,
            snapshot=snapshot,
        )

    def _gave_up(self) -> str:
        """Return why the task cannot be completed, or an empty string."""
        reason = GIVEN_UP.get(self.outcome, "")
        frontier = self.services.frontier.frontier
        return f"{self.outcome}: {reason}; frontier edges left: {len(frontier)}" if reason else ""

    # --- the algorithm ----------------------------------------------------------------------------------------------

    def _algorithm_1(self) -> Routine[None]:
        """Algorithm 1 of the paper; the numbers beside the lines are its line numbers.

        With several stations line 1 is carried out by each station that sees no robot, and pushes run concurrently.
        """
        moved: list[int] = []
        while self.cycle < self.parameters.cycles_max and not self.outcome:  # 2: do
            self.cycle += 1
            # 3: R := ComputeRipsComplex({N_i})
            scan = self.pushing.scan if self._schedule.unscanned else (yield from self._scan_swarm(moved))
            self._update_fence(scan)  # 4: [F, O] := FenceSubcomplex(R, {theta})
            plans: Sequence[Plan] = ()
            if stations := self._stations_without_robots():
                pushes = [self._deploy_first(base) for base in stations]  # 1: deploy robot 1
            else:
                if self._redundancy_is_due():
                    yield from self._find_redundant()  # 5: (periodically) identify redundant robots
                plans = yield from self._find_paths()  # 6: find path in the 1-skeleton
                # 7 and 8: push robots in path, deploy robot n + 1
                pushes = self._probes(plans) or self._carry_out(plans) or self.pushing.recalls(self._silent)
            if self._schedule.unscanned and not pushes:
                self._schedule.scan_next()
                continue  # only a new scan shows that nothing is left
            occupant, frontier = self.slots.occupant, self.services.frontier
            self._snapshot = encoded_complex(self.cycle, occupant, self.scan.complex_, frontier, plans)
            self.outcome = self._judge(bool(pushes))  # 9: while F is not empty
            moved, stopped = moved if self._schedule.unscanned else [], self.pushing.stopped
            moved += [robot for each in (yield from run_concurrently(pushes)) for robot in each]
            self._schedule.end_cycle(max(len(pushes), len(plans)), self.pushing.stopped - stopped)
            yield from self._reconsider_outcome()

    def _carry_out(self, plans: Sequence[Plan]) -> list[Routine[Moved]]:
        if any(plan.walk for plan in plans):
            return [self.walking.walk(plans, self.scan)]
        return [self.pushing.push_all(plans)] if plans else []

    def _probes(self, plans: Sequence[Plan]) -> list[Routine[Moved]]:
        """Return probes of walls close to slots, before a robot is sent along a wall."""
        if not any(plan.walk and not plan.meet for plan in plans):
            return []
        found = self.walls.probes(self.scan)
        moving = dict.fromkeys(self.slots.occupant[plan.mover] for plan in found)
        return [self.walking.probe(list(each), moving) for _, each in groupby(found, key=lambda plan: plan.mover)]

    def _deploy_first(self, base: int) -> Routine[Moved]:
        """Deploy a station's first robot; where walls stop it in every direction, let it follow them."""
        if self.parameters.walls == "paper":
            return (yield from self.pushing.deploy_first(base))
        bearings = yield from self.walking.axis(base)
        moved = yield from self.pushing.deploy_first(base, bearings)
        if base in self.sources.blocked:
            moved = yield from self.walking.first(base)
        return moved

    def _run(self) -> Routine[None]:
        """Send the roll call, carry out the algorithm, and report the numbers."""
        self.mailbox.roll_call(RollCall(1), ROLL_CALL_COPIES if self._restarted else 1)
        yield from self._algorithm_1()
        self.outcome = self.outcome or "no-end"
        if self._redundancy == "coordinator":
            yield from self._find_redundant()
        self._report_numbers()
        yield Wake()

    # --- line 3: the scan -------------------------------------------------------------------------------------------

    def _scan_swarm(self, moved: Moved) -> Routine[ScanResult]:
        """Ask all robots for their reports; a silent robot counts as dead until it sends something."""
        slots = self.slots
        self._readmit()
        asked = sorted(slots.occupant.values())
        reports = yield from self._ask(asked, moved)
        slot_of = slots.slot_of()
        for robot in asked:
            if robot not in reports:
                slots.drop(slot_of[robot])
        self._take_sightings(reports)
        at_station: dict[int, tuple[int, Report]] = {}
        while strangers := self._strangers(reports, at_station):
            answers = yield from self._ask(strangers, ())
            stations = {robot: self.sources.station_seeing(robot) for robot, each in answers.items() if each.home}
            at_station |= {robot: (at, answers.pop(robot)) for robot, at in stations.items() if at is not None}
            for robot in answers:
                slots.add(robot)
                self.sources.out[robot] = None
            self._take_sightings(answers)
            reports |= answers
        self._ping(reports)
        slots.learn_headings(robot for robot, report in sorted(reports.items()) if report.sightings is not None)
        slot_of = slots.slot_of()
        for robot, report in sorted(reports.items()):
            slots.note_push(slot_of[robot], report.pushed)
            slots.touch(slot_of[robot], [each + slots.heading[robot] for each in report.touched], report.robots)
        views = slots.views()
        slots.learn_references(views)
        for robot, (station, report) in at_station.items():
            self.sources.adopt(robot, station, report.sightings or (), views[station])
        self._leave_requests.update(reports)
        self.pushing.cycle = self.cycle
        return ScanResult(views, FlagComplex(views), tuple(self.sources.alive()))

    def _take_sightings(self, reports: Mapping[int, Report]) -> None:
        for robot, report in reports.items():
            if report.sightings is not None:
                self.slots.take(robot, report.sightings)

    def _ask(self, robots: Sequence[int], moved: Moved) -> Routine[dict[int, Report]]:
        """Return the reports of robots; a robot that does not answer in time is not asked again.

        If a robot's view is unknown, it is asked as if it had moved, because "nothing has changed" would be no information.
        """
        cycle, known = self.cycle, self.slots.view
        for robot in robots:
            if cycle == 1:
                self.mailbox.expect(robot)
            else:
                request = ScanRequest(cycle, tuple(sorted(moved if robot in known else {*moved, robot})))
                self.mailbox.send(robot, request)
        answers = yield from self.mailbox.answers(robots, Report)
        reports = {node: answer for node, answer in answers.items() if isinstance(answer, Report)}
        self._silent |= dict.fromkeys(robot for robot in robots if robot not in reports)
        return reports

    def _strangers(self, reports: Mapping[int, Report], at_station: Collection[int]) -> list[int]:
        """Return visible robots without a slot: a coordinator that starts again finds the swarm as it is."""
        waiting = self.sources.waiting.values()
        known = {*self.slots.occupant.values(), *waiting, *at_station, *self._silent, *self.pushing.lost}
        seen = {each.node for report in reports.values() for each in report.sightings or ()}
        return sorted(seen - known)

    def _ping(self, reports: Mapping[int, Report]) -> None:
        """Ask visible robots that count as dead, without waiting for an answer: they may come back."""
        seen = {node for robot in reports for node in self.slots.view.get(robot, ())}
        for robot in self._silent:
            if robot in seen and not self.mailbox.waits_for(robot):
                self.mailbox.send(robot, ScanRequest(self.cycle, (robot,)), ping=True)

    def _readmit(self) -> None:
        """Give a slot to robots that counted as dead and have sent something; one that has restarted has a new frame."""
        placed = self.slots.slot_of()
        for robot, answer in self.mailbox.take_unread():
            if isinstance(answer, Emerged) and robot in self.slots.heading:
                self.slots.orient(robot, robot, 0.0)
            if robot in self._silent and robot not in placed:
                del self._silent[robot]
                station = self.sources.slot_of(robot)
                if station is None:
                    self.slots.add(robot)
                else:
                    self.slots.occupant[station] = robot

    # --- line 4: the fence ------------------------------------------------------------------------------------------

    def _update_fence(self, scan: ScanResult) -> None:
        """Find the fence of the complex without robots that have left it; pushes may begin at those."""
        self.scan = self.pushing.scan = scan
        self.walking.keep_idle(scan)
        if self.walking.idle:
            self.scan = scan = scan._replace(complex_=scan.complex_.without(self.walking.idle))
        if self._redundancy == "link":
            self.redundant = self._leave_requests.redundant_slots(scan)
            if self.redundant:
                self.scan = scan._replace(complex_=scan.complex_.without(self.redundant))
        self.services.frontier.update(self.scan)

    # --- line 1: the first robot of a station -------------------------------------------------------------------------

    def _stations_without_robots(self) -> list[int]:
        """Return the slots of the stations that can release robots and see only stations."""
        seen, stations = self.scan.complex_.neighbours, self.sources.alive()
        return [slot for slot in self.sources.available() if all(each in stations for each in seen[slot])]

    # --- line 5: redundant robots -------------------------------------------------------------------------------------

    def _redundancy_is_due(self) -> bool:
        """Return whether `redundancy_every` pushes have succeeded, or none since the coordinator's latest search."""
        pushes, every = self.pushing.pushes, self.parameters.redundancy_every
        again = pushes == self._redundancy_at and self._redundancy == "coordinator"
        return bool(every and pushes and (pushes // every > self._redundancy_at // every or again))

    def _find_redundant(self) -> Routine[None]:
        """Find redundant robots by relative homology, or let robots negotiate."""
        if self._redundancy == "none":
            return
        self._redundancy_at = self.pushing.pushes
        boundary_edges = self.services.frontier.boundary_edges()
        if self._redundancy == "coordinator":
            self.redundant = self.services.redundancy.redundant(self.scan, boundary_edges)
        else:
            yield from self._leave_requests.negotiate(self.scan, boundary_edges, self._silent, self.cycle)
            self._update_fence(self.pushing.scan)

    # --- line 6: paths ------------------------------------------------------------------------------------------------

    def _find_paths(self) -> Routine[tuple[Plan, ...]]:
        """Return the deployments of this cycle with their paths; an empty depot makes redundant robots the only source."""
        plans = self._assign()
        if not plans and self.sources.empty:
            yield from self._find_redundant()
            plans = self._assign()
        if not plans and self.walking.wake(self.pushing.scan):
            self._update_fence(self.pushing.scan)
            plans = self._assign()
        return plans

    def _assign(self) -> tuple[Plan, ...]:
        services = self.services
        self.redundant = tuple(slot for slot in self.redundant if slot in self.slots.occupant)
        shut = self.scan.bases  # a station does not move
        redundant = (*self.redundant, *self.walking.idle)
        sources = dict.fromkeys(self.sources.available(), 0.0) | dict.fromkeys(redundant, REDUNDANT_COST)

        def find_routes(complex_: FlagComplex, sources: Mapping[int, float]) -> CheapestRoutes:
            return services.paths.routes(complex_, sources, services.frontier.obstacle, shut)

        return services.assignment.assign(services.frontier.plans(), self.pushing.scan, sources, find_routes)

    # --- line 9: the end ----------------------------------------------------------------------------------------------

    def _judge(self, busy: bool) -> str:
        """Return the outcome, or an empty string while the deployment goes on.

        An empty frontier means that all is covered if each component has a station, and a robot got away from a
        station.
        """
        outcome = self.services.termination.judge(busy, bool(self.services.frontier.frontier))
        sources, pieces = self.sources, self.scan.complex_.components()
        stations = sources.alive()
        alone = all(slot in stations for piece in pieces for slot in piece)
        whole = [len(piece) > 1 for piece in pieces] == [True] or all(
            any(slot in stations for slot in piece) for piece in pieces
        )
        if not outcome or (outcome == COVERED and whole and not alone):
            return "unproven" if outcome and self.walls.unproven else outcome
        if not stations:
            return "source-lost"
        if sources.empty:
            return "depot-dry"
        return "source-blocked" if alone else "cut-off"

    def _reconsider_outcome(self) -> Routine[None]:
        """Continue if stations may be silent by loss, if walls can be tried again, or until `watch_until_s`."""
        self.outcome = "" if self.outcome == "unproven" and self.walls.begin_again() else self.outcome
        if self.outcome == "source-lost" and self.mailbox.suspect_loss():
            self.outcome = ""
            for slot, base in self.sources.stations.items():
                self.slots.occupant[slot] = base
                self._silent.pop(base, None)
        if self.outcome == COVERED and self.mailbox.now_s < self.parameters.watch_until_s:
            self.outcome = ""
            yield from self.mailbox.pause(WATCH_TICKS)

    # --- telemetry ----------------------------------------------------------------------------------------------------

    def _report_numbers(self) -> None:
        self._telemetry |= {
            "deployment_cycles": self.cycle,
            "pushes": self.pushing.pushes,
            "robots_released": len(self.sources.out),
            "redundant_robots": len(self.redundant),
        }
