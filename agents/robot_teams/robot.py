"""A robot of a team that covers an unknown arena together (Latimer et al. 2002), by pose, touch and radio."""

import math
from collections.abc import Generator
from inspect import GEN_CREATED, getgeneratorstate
from typing import Annotated, ClassVar, Final

from msgspec import Meta, Struct

from zwerm.agents.robot_teams.mapping.facts import (
    BOTTOM,
    PASSES,
    TOP,
    End,
    Return,
    SweptSegment,
    TracedArc,
    Void,
    Wreck,
)
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.motion.manoeuvres import Manoeuvre, SliceGrid, mm
from zwerm.agents.robot_teams.motion.pilot import FAILED, IDLE, RUNNING, Pilot
from zwerm.agents.robot_teams.motion.senses import GAP_M, SenseReader, Senses
from zwerm.agents.robot_teams.motion.wrecks import WreckWatch
from zwerm.agents.robot_teams.planning import LINK, latest_plans
from zwerm.agents.robot_teams.protocols.central_membership import CoordinatedMembership
from zwerm.agents.robot_teams.protocols.corridor_mates import CorridorMates
from zwerm.agents.robot_teams.protocols.fact_exchange import FactExchange
from zwerm.agents.robot_teams.protocols.team_membership import TeamMembership
from zwerm.agents.robot_teams.protocols.team_messages import (
    READY,
    FoundSnapshot,
    Status,
    TeamBeacon,
    encode_snapshot,
    read_beacon,
    write_beacon,
)
from zwerm.agents.robot_teams.task_end import TaskEnd
from zwerm.agents.robot_teams.team_lead import TeamLead, findings
from zwerm.agents.robot_teams.work import Lost, NoRoute, Work
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ControllerError
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission

# In the first second a robot meets every robot that it receives: the robots start together, as one team.
GATHER_S: Final = 1.0
# A robot nearer than this to an end, or to a robot at that end, counts as standing at it [m].
PARKED_M: Final = 0.75
# A wreck hides what is nearer to it than this, beyond two bodies' radii [m].
HIDDEN_M: Final = GAP_M - 0.005
# The channel to the coordinator.
UPLINK: Final = "uplink"
# Ticks between two decisions of the lead.
DECIDE_TICKS: Final = 4


class TeamTable(Struct, frozen=True, forbid_unknown_fields=True):
    """The footprint's radius, the slices, the beacons, and when robots are met or counted as lost."""

    footprint_m: Annotated[float, Meta(gt=0.0)] = 0.5
    spacing_m: Annotated[float, Meta(gt=0.0)] = 0.95
    origin_m: float = 0.0
    beacon_s: Annotated[float, Meta(gt=0.0)] = 0.25
    silence_s: Annotated[float, Meta(gt=0.0)] = 6.0
    meeting_m: Annotated[float, Meta(ge=0.0)] = 1.1
    divide: bool = True
    one_corridor: bool = False
    join_m: Annotated[float, Meta(gt=0.0)] = 6.0
    merge: bool = True
    virtual_frontier: bool = False


class TeamRobot(Controller):
    """One robot: its pilot, its work, and the protocols of its team."""

    sensors: ClassVar[tuple[str, ...]] = ("pose", "touch", "neighbours")
    Parameters: ClassVar[type[Struct]] = TeamTable

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        table: TeamTable = self.parameters
        body = setup.body
        if body is None or body.kind != "holonomic":
            raise ControllerError("robot-teams: expected a holonomic body")
        if table.spacing_m > min(2.0 * table.footprint_m, table.footprint_m + 2.0 * body.radius_m):
            raise ControllerError(
                "robot-teams: spacing_m: expected at most 2 footprint_m and at most footprint_m + 2 radius_m, "
                f"got {table.spacing_m}"
            )
        self.map = SliceMap()
        self.pilot = Pilot(setup.node, body.max_speed_m_s, setup.dt_s, self.random)
        # All cells are planned by the coordinator, or by the leads of teams.
        self._central = setup.services.get("cells") == "coordinator"
        membership = CoordinatedMembership if self._central else TeamMembership
        self.membership: TeamMembership = membership(setup.node, setup.dt_s, table.silence_s)
        self._channels = tuple([each for each in setup.channels if (each == UPLINK) == self._central])
        self._view = self.membership.view
        self.exchange = FactExchange(self.map, setup.dt_s)
        self.lead = TeamLead(
            self.map,
            self.membership,
            setup.dt_s,
            divide=table.divide,
            merge=table.merge,
            one_corridor=table.one_corridor,
            join_m=table.join_m,
            virtual_frontier=table.virtual_frontier,
        )
        self.refused = 0
        self._radius_m = body.radius_m
        self._wrecks = WreckWatch(setup.dt_s, table.silence_s, self.membership.roster.silent_ticks)
        self._sensing = SenseReader(body.radius_m)
        self._senses: Senses | None = None
        self._grid = SliceGrid(table.origin_m, table.spacing_m)
        self.work = Work(
            self.map,
            self._grid,
            body.max_speed_m_s * setup.dt_s,
            self._newest_senses,
            self._parked,
        )
        self._activity = self._activities()
        self._waits = True
        self._number = 0
        self._epoch = 0
        self._every = max(1, round(table.beacon_s / setup.dt_s))
        self._urgent = False
        self._reported = -1, False, 0, 0
        self._task = TaskEnd(self.map, self._grid, body.radius_m)
        self._left_off = False

    def step(self, observation: Observation) -> Command:
        """Receive, decide, move, and send."""
        tick = observation.tick
        senses = self._senses = self._sensing.read(observation, self._wrecks.wrecks)
        if observation.inbox:
            self._receive(observation, senses)
        self._watch(senses)
        membership = self.membership
        if tick == round(GATHER_S / self.setup.dt_s):
            membership.meet_first(tick)
        membership.poll(tick)
        if membership.view != self._view:
            self._view = membership.view
            self.lead.begin(tick)
            self._urgent = True
        task = self._task
        task.judge(self.work.here, senses)
        vx, vy = self._stand(senses) if task.over else self._move(senses)
        if membership.leads and tick % DECIDE_TICKS == 0 and tick * self.setup.dt_s >= GATHER_S:
            membership.roster.statuses[self.setup.node] = self._status(senses, tick)
            membership.roster.news_tick[self.setup.node] = tick
            self._urgent = self.lead.decide(tick) or self._urgent
        outbox = self._outgoing(observation, senses)
        sensing = self._sensing
        drive = BodyVelocity(sensing.cos * vx + sensing.sin * vy, sensing.cos * vy - sensing.sin * vx, 0.0)
        telemetry, snapshot = self._telemetry(), self._snapshot()
        return Command(
            drive=drive,
            outbox=outbox,
            done=task.done,
            gave_up=task.gave_up,
            telemetry=telemetry,
            snapshot=snapshot,
        )

    # --- moving -------------------------------------------------------------------------------------------------------

    def _stand(self, senses: Senses) -> tuple[float, float]:
        """Stop work, and move aside for others."""
        self._left_off = getgeneratorstate(self._activity) != GEN_CREATED
        return self.pilot.stand(senses)

    def _move(self, senses: Senses) -> tuple[float, float]:
        pilot = self.pilot
        if self._left_off:
            # New work was found: it begins at the robot's present place.
            self._left_off = False
            pilot.give_up()
        velocity = pilot.step(senses)
        if pilot.state == RUNNING or (pilot.state == IDLE and not self._waits):
            return velocity
        # The manoeuvre ended: the next may begin in the same tick.
        for _ in range(10):
            failed = pilot.state == FAILED
            manoeuvre = self._activity.throw(Lost()) if failed else next(self._activity)
            self._waits = manoeuvre is None
            if manoeuvre is None:
                if pilot.state != IDLE:
                    pilot.rest()
                return velocity
            pilot.start(manoeuvre)
            velocity = pilot.step(senses)
            if pilot.state == RUNNING:
                break
        return velocity

    def _activities(self) -> Generator[Manoeuvre | None, None, None]:
        """Find an end, then carry out one plan after the other; after a failure find an end again."""
        while True:
            try:
                if self.work.here is None:
                    # A wreck may hide the end at which the robot stood.
                    side = TOP if self.work.failures == 0 or self.random.random() < 0.5 else BOTTOM
                    yield from self.work.localise(side, self._swept_by_others)
                if not self._task.is_placed:
                    yield from self.work.approach_again()
                plan = latest_plans(self.lead.plans, self.membership.view).get(self.setup.node)
                if plan is not None and (plan.epoch, plan.number) != (self._epoch, self._number):
                    self._epoch, self._number = plan.epoch, plan.number
                    if plan.anchor.side == LINK:
                        yield from self.work.link(plan.direction, self._swept_by_others)
                    else:
                        yield from self.work.corridor(
                            plan, CorridorMates(plan, self.setup.node, self.membership, self._swept_by_others)
                        )
                if self.work.phase != READY:
                    self.work.phase, self.work.sweeping = READY, None
                    self._urgent = True
                yield None
            except (Lost, NoRoute):
                self.work.failures += 1
                self.work.at = self.work.sweeping = None

    def _swept_by_others(self, k: int) -> bool:
        """Return whether another robot reports that it is sweeping slice k now."""
        roster, tick = self.membership.roster, self._newest_senses().tick
        silence = self.parameters.silence_s / self.setup.dt_s
        return any(
            status.sweeping == k and roster.silent_ticks(node, tick) < silence
            for node, status in roster.statuses.items()
            if node != self.setup.node
        )

    def _parked(self, senses: Senses) -> list[End]:
        """Return the ends at which robots in contact report that they stand."""
        found = []
        grid = self._grid
        for other in senses.robots:
            status = self.membership.roster.statuses.get(other.node)
            if other.gap_m > 0.1 or not other.stands or status is None or status.at is None:
                continue
            dx, dy = other.x_m - grid.x_m(status.at.slice), other.y_m - status.at.y_mm / 1000.0
            if dx * dx + dy * dy < PARKED_M**2:
                found.append(status.at)
        return found

    def _watch(self, senses: Senses) -> None:
        """Look for wrecks. Record the ends that they hide, and the robots that were taken for dead and are alive."""
        tick, roster, voids = senses.tick, self.membership.roster, self.map.voids
        if self._channels:
            for node in self._wrecks.watch(senses, voids):
                place = next(other for other in senses.robots if other.node == node)
                self._note_wreck(self._wrecks.wrecks[node], place.x_m, place.y_m)
        for void in voids:
            node = void.wreck.node
            status = roster.statuses.get(node)
            if node == self.setup.node:
                self.map.add(Return(node, tick))
            elif status is not None and status.beat > void.wreck.tick:
                self.map.add(Return(node, status.beat))
        for node in self._wrecks.moved:
            self.map.add(Return(node, tick))
        for node in list(self._wrecks.wrecks):
            status = roster.statuses.get(node)
            if status is not None:
                self._wrecks.note_alive(node, status.beat)

    def _note_wreck(self, wreck: Wreck, x_m: float, y_m: float) -> None:
        """Add to the map which ends a wreck hides: those nearer to it than another body can come."""
        radius_m = 2.0 * self._radius_m + HIDDEN_M
        for k in (self._grid.nearest(x_m) + step for step in (-1, 0, 1)):
            half_m2 = radius_m**2 - (self._grid.x_m(k) - x_m) ** 2
            if half_m2 > 0.0:
                half_m = math.sqrt(half_m2)
                self.map.add(Void(k, mm(x_m), mm(y_m - half_m), mm(y_m + half_m), wreck))

    def _newest_senses(self) -> Senses:
        assert self._senses is not None
        return self._senses

    # --- receiving and sending ----------------------------------------------------------------------------------------

    def _receive(self, observation: Observation, senses: Senses) -> None:
        tick = observation.tick
        table: TeamTable = self.parameters
        for packet in observation.inbox:
            beacon = read_beacon(packet.payload)
            if beacon is None:
                self.refused += 1
                continue
            near = False
            for status in beacon.statuses:
                if status.node == beacon.sender and table.merge:
                    apart = math.hypot(status.x_mm / 1000.0 - senses.x_m, status.y_mm / 1000.0 - senses.y_m)
                    near = apart <= table.meeting_m
            self.membership.receive(beacon, tick, near)
            if self.membership.accepts(beacon.sender) or near:
                self.exchange.receive(beacon, tick)
            else:
                self.exchange.forget(beacon.sender)
            if self.membership.accepts(beacon.sender) and not self.membership.leads:
                self.lead.follow(beacon.plans)

    def _status(self, senses: Senses, tick: int) -> Status:
        work, view = self.work, self.membership.view
        busy = work.phase != READY
        number = self._number if busy or self._epoch == view.epoch else 0
        epoch = self._epoch if busy else view.epoch
        return Status(
            self.setup.node,
            tick,
            round(1000.0 * senses.x_m),
            round(1000.0 * senses.y_m),
            epoch,
            number,
            work.phase,
            work.at if self._task.is_placed else None,
            work.found,
            work.spare,
            work.claim,
            work.room,
            work.sweeping,
            (view.epoch, view.lead),
        )

    def _outgoing(self, observation: Observation, senses: Senses) -> tuple[Transmission, ...]:
        tick = observation.tick
        if not self._channels or not (self._urgent or (tick + self.setup.node) % self._every == 0):
            return ()
        self._urgent = False
        membership = self.membership
        parcel = self.exchange.outgoing(tick)
        mine = self._status(senses, tick)
        others = [] if self._central else membership.others()
        beacon = TeamBeacon(
            self.setup.node,
            membership.outgoing(),
            membership.met(),
            self.lead.plans,
            (mine, *others),
            self.map.facts.digest,
            len(self.map.facts),
            *parcel,
        )
        frame = write_beacon(beacon)
        return tuple([Transmission(channel, frame) for channel in self._channels])

    def _telemetry(self) -> dict[str, float | bool]:
        """Return the certificate and the team's results, whenever one of them may have changed."""
        membership = self.membership
        news = len(self.map.facts), self._task.done, membership.divisions, membership.merges
        if news == self._reported:
            return {}
        self._reported = news
        return {"certificate_satisfied": self._task.done, **findings(self.map, self.membership)}

    def _snapshot(self) -> bytes:
        """Return what this robot has found since the last tick, encoded; empty where it found nothing."""
        found, self.work.found_facts = self.work.found_facts, []
        if not found:
            return b""
        slices = [fact for fact in found if isinstance(fact, SweptSegment)]
        points = [fact for fact in found if isinstance(fact, TracedArc) and fact.kind != PASSES]
        return encode_snapshot(
            FoundSnapshot(
                self.membership.view.lead,
                tuple([(self._grid.x_m(s.slice), s.bottom_mm / 1000.0, s.top_mm / 1000.0) for s in slices]),
                tuple([(arc.x_mm / 1000.0, arc.y_mm / 1000.0) for arc in points]),
            )
        )
