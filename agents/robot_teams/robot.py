"""A robot of a team that covers an unknown arena together (Latimer et al. 2002), by pose, touch and radio."""

import math
from collections.abc import Generator
from typing import Annotated, ClassVar, Final

import msgspec
from msgspec import Meta, Struct

from zwerm.agents.robot_teams.corridor_mates import CorridorMates
from zwerm.agents.robot_teams.fact_exchange import FactExchange
from zwerm.agents.robot_teams.facts import BOTTOM, PASSES, TOP, Arc, End, Segment, Void
from zwerm.agents.robot_teams.manoeuvres import Grid, Manoeuvre, mm
from zwerm.agents.robot_teams.pilot import FAILED, IDLE, RUNNING, Pilot
from zwerm.agents.robot_teams.planning import (
    FAR,
    LINK,
    Task,
    assign,
    division,
    finder,
    free_members,
    latest_plans,
    without_busy,
)
from zwerm.agents.robot_teams.senses import Senses, Sensing
from zwerm.agents.robot_teams.slice_map import SliceMap
from zwerm.agents.robot_teams.team_membership import Membership
from zwerm.agents.robot_teams.team_messages import (
    READY,
    Beacon,
    FoundSnapshot,
    Plan,
    Status,
    decode_beacon,
    encode_beacon,
    encode_snapshot,
)
from zwerm.agents.robot_teams.work import Lost, NoWay, Work
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ControllerError, ProtocolError
from zwerm.wire.checksum import seal, unseal
from zwerm.wire.messages import BodyVelocity, Command, Observation, Transmission

# In the first second every robot that is heard is met: the robots start together, as one team.
MUSTER_S: Final = 1.0
# How long a team waits for one with a smaller lead to unite them [s].
MERGE_PATIENCE_S: Final = 30.0
# A robot this near to an end, or to one that stands there, stands at it [m].
PARKED_M: Final = 0.75
# For how long a task that brought nothing new is passed over [s].
SKIP_S: Final = 30.0
# After so long without a new corridor free robots take tasks however far, and then in cells where others work [s].
FAR_AFTER_S: Final = 20.0
ANY_AFTER_S: Final = 60.0
# The lead decides every so many ticks.
DECIDE_TICKS: Final = 4


class TeamTable(Struct, frozen=True, forbid_unknown_fields=True):
    """The footprint's radius, the slices, the beacons, and when robots are met or given up for lost."""

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
        self.membership = Membership(setup.node, setup.dt_s, table.silence_s)
        self._view = self.membership.view
        self.exchange = FactExchange(self.map, setup.dt_s)
        self.plans: tuple[Plan, ...] = ()
        self.refused = 0
        self._radius_m = body.radius_m
        self._wrecks: dict[int, int] = {}
        self._sensing = Sensing(body.radius_m)
        self._senses: Senses | None = None
        self._grid = Grid(table.origin_m, table.spacing_m)
        self.work = Work(
            self.map,
            self._grid,
            body.max_speed_m_s * setup.dt_s,
            self._newest_senses,
            self._parked,
        )
        self._story = self._live()
        self._waits = True
        self._number = 0
        self._epoch = 0
        self._skip: dict[Task, int] = {}
        self._judged: dict[int, Plan] = {}
        self._digests: dict[int, int] = {}
        self._made_tick = 0
        self._every = max(1, round(table.beacon_s / setup.dt_s))
        self._urgent = False
        self._told_count = -1
        self._done = False

    def step(self, observation: Observation) -> Command:
        """Hear, decide, move, and say."""
        tick = observation.tick
        senses = self._senses = self._sensing.read(observation, self._is_dead)
        for other in senses.robots:
            if other.dead and other.node not in self._wrecks:
                self._wrecks[other.node] = tick
                self._note_wreck(other.x_m, other.y_m)
        if observation.inbox:
            self._hear(observation, senses)
        if tick == round(MUSTER_S / self.setup.dt_s):
            self.membership.muster(tick)
        self.membership.poll(tick)
        if self.membership.view != self._view:
            self._view = self.membership.view
            self._judged.clear()
            self._digests.clear()
            self._made_tick = tick
            self._urgent = True
            self.plans = tuple([plan for plan in self.plans if plan.epoch == self.membership.view.epoch])
        self._done = self.map.certificate.complete
        vx, vy = self.pilot.stand(senses) if self._done else self._move(senses)
        if self.membership.leads:
            self._decide(tick)
        outbox = self._say(observation, senses)
        sensing = self._sensing
        drive = BodyVelocity(sensing.cos * vx + sensing.sin * vy, sensing.cos * vy - sensing.sin * vx, 0.0)
        telemetry, snapshot = self._telemetry(), self._snapshot()
        return Command(drive=drive, outbox=outbox, done=self._done, telemetry=telemetry, snapshot=snapshot)

    # --- moving -------------------------------------------------------------------------------------------------------

    def _move(self, senses: Senses) -> tuple[float, float]:
        pilot = self.pilot
        velocity = pilot.step(senses)
        if pilot.state == RUNNING or (pilot.state == IDLE and not self._waits):
            return velocity
        # The manoeuvre ended: the next may begin in the same tick.
        for _ in range(10):
            failed = pilot.state == FAILED
            manoeuvre = self._story.throw(Lost()) if failed else next(self._story)
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

    def _live(self) -> Generator[Manoeuvre | None, None, None]:
        """Find an end, then carry out one plan after the other; after a failure find an end again."""
        while True:
            try:
                if self.work.at is None:
                    side = TOP if self.work.failures == 0 or self.random.random() < 0.5 else BOTTOM
                    yield from self.work.localise(side, self._swept_by_others)
                plan = latest_plans(self.plans, self.membership.view).get(self.setup.node)
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
            except (Lost, NoWay):
                self.work.failures += 1
                self.work.at = self.work.sweeping = None
                yield None

    def _swept_by_others(self, k: int) -> bool:
        """Tell whether another robot is sweeping slice k now, by its own word."""
        roster, tick = self.membership.roster, self._newest_senses().tick
        silence = self.parameters.silence_s / self.setup.dt_s
        return any(
            status.sweeping == k and roster.silent_ticks(node, tick) < silence
            for node, status in roster.statuses.items()
            if node != self.setup.node
        )

    def _parked(self, senses: Senses) -> list[End]:
        """Return the ends at which robots in contact stand, by their own word."""
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

    def _note_wreck(self, x_m: float, y_m: float) -> None:
        """Add to the map which ends a dead robot hides: those nearer to it than another body can come."""
        radius_m = 2.0 * self._radius_m
        for k in (self._grid.nearest(x_m) + step for step in (-1, 0, 1)):
            half_m2 = radius_m**2 - (self._grid.x_m(k) - x_m) ** 2
            if half_m2 > 0.0:
                half_m = math.sqrt(half_m2)
                self.map.add(Void(k, mm(x_m), mm(y_m - half_m), mm(y_m + half_m)))

    def _is_dead(self, node: int) -> bool:
        """Tell whether a robot in sight has been silent for too long to be alive."""
        tick = 0 if self._senses is None else self._senses.tick
        silent = self.membership.roster.silent_ticks(node, tick)
        if node in self._wrecks:
            return bool(silent * self.setup.dt_s > self.parameters.silence_s)
        return bool(self.setup.channels) and silent * self.setup.dt_s > 2.0 * self.parameters.silence_s

    def _newest_senses(self) -> Senses:
        assert self._senses is not None
        return self._senses

    # --- deciding -----------------------------------------------------------------------------------------------------

    def _decide(self, tick: int) -> None:
        """As the lead, unite with teams that were met, divide, or give the free members something to do."""
        membership, dt_s = self.membership, self.setup.dt_s
        if tick % DECIDE_TICKS or tick * dt_s < MUSTER_S:
            return
        view, statuses = membership.view, membership.roster.statuses
        statuses[self.setup.node] = self._status(self._newest_senses(), tick)
        membership.roster.news_tick[self.setup.node] = tick
        free = free_members(view, self.plans, statuses)
        if not free:
            return
        table: TeamTable = self.parameters
        everybody = len(free) == len(view.members)
        if table.merge and membership.met():
            if everybody and membership.merge(tick):
                self._urgent = True
                return
            if membership.merges_soon(tick, round(MERGE_PATIENCE_S / dt_s)):
                return
        if self.map.certificate.complete:
            return
        for plan in dict.fromkeys(latest_plans(self.plans, view).values()):
            if plan.number not in self._judged and all(node in free for node in plan.order):
                self._judged[plan.number] = plan
                if self._digests.pop(plan.number, None) == self.map.facts.digest:
                    self._skip[Task(plan.anchor, plan.direction, plan.own_slice)] = tick
                index = finder(plan.order, statuses) if table.divide and plan.anchor.side != LINK else None
                groups = None if index is None else division(view, plan.order, index)
                if groups is not None:
                    membership.divide(groups, tick)
                    self._forget_plans()
                    return
        self._skip = {task: since for task, since in self._skip.items() if (tick - since) * dt_s < SKIP_S}
        # Where nothing could be assigned for some time, far tasks are taken too, and then those in reserved cells.
        idle_s = (tick - self._made_tick) * dt_s
        join_mm = mm(table.join_m) if idle_s < FAR_AFTER_S else FAR
        plans = self.plans if idle_s < ANY_AFTER_S else without_busy(self.plans, free)
        made = assign(self.map, view, self.plans, plans, statuses, self._skip, table.one_corridor, join_mm)
        if made:
            self._made_tick = tick
            self.plans = (*dict.fromkeys(latest_plans(self.plans, view).values()), *made)
            for plan in made:
                self._digests[plan.number] = self.map.facts.digest
            self._urgent = True

    def _forget_plans(self) -> None:
        self.plans = ()
        self._judged.clear()
        self._digests.clear()
        self._urgent = True

    # --- hearing and saying -------------------------------------------------------------------------------------------

    def _hear(self, observation: Observation, senses: Senses) -> None:
        tick = observation.tick
        table: TeamTable = self.parameters
        for packet in observation.inbox:
            try:
                beacon: Beacon = decode_beacon(unseal(packet.payload))
            except (ProtocolError, msgspec.DecodeError, UnicodeDecodeError):
                self.refused += 1
                continue
            near = False
            for status in beacon.statuses:
                if status.node == beacon.sender and table.merge:
                    apart = math.hypot(status.x_mm / 1000.0 - senses.x_m, status.y_mm / 1000.0 - senses.y_m)
                    near = apart <= table.meeting_m
            self.membership.receive(beacon, tick, near)
            if beacon.sender in self.membership.view.members or near:
                self.exchange.receive(beacon, tick)
            else:
                self.exchange.forget(beacon.sender)
            view = self.membership.view
            if beacon.sender in view.members and not self.membership.leads:
                known = dict.fromkeys((*self.plans, *[plan for plan in beacon.plans if plan.epoch == view.epoch]))
                self.plans = tuple(dict.fromkeys(latest_plans(tuple(known), view).values()))

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
            work.at,
            work.found,
            work.spare,
            work.claim,
            work.room,
            work.sweeping,
            (view.epoch, view.lead),
        )

    def _say(self, observation: Observation, senses: Senses) -> tuple[Transmission, ...]:
        tick = observation.tick
        if not self.setup.channels or not (self._urgent or (tick + self.setup.node) % self._every == 0):
            return ()
        self._urgent = False
        membership = self.membership
        parcel = self.exchange.outgoing(tick)
        mine = self._status(senses, tick)
        others = [status for node, status in sorted(membership.roster.statuses.items()) if node != self.setup.node]
        others = [status for status in others if status.node in membership.view.members]
        beacon = Beacon(
            self.setup.node,
            membership.outgoing(),
            membership.met(),
            self.plans,
            (mine, *others),
            self.map.facts.digest,
            len(self.map.facts),
            *parcel,
        )
        frame = seal(encode_beacon(beacon))
        return tuple([Transmission(channel, frame) for channel in self.setup.channels])

    def _telemetry(self) -> dict[str, float | bool]:
        """Return the certificate and what the team came to, whenever the map has grown."""
        facts = self.map.facts
        if len(facts) == self._told_count:
            return {}
        self._told_count = len(facts)
        certificate, membership = self.map.certificate, self.membership
        return {
            "certificate_satisfied": certificate.complete,
            "ends": certificate.ends,
            "ends_without_mate": len(certificate.ends_without_mate),
            "open_ports": len(certificate.open_ports),
            "critical_points": len({arc.ports for arc in facts.arcs if arc.kind != PASSES}),
            "divisions": membership.divisions,
            "merges": membership.merges,
        }

    def _snapshot(self) -> bytes:
        """Return what this robot has found since the last tick, encoded; empty where it found nothing."""
        found, self.work.found_facts = self.work.found_facts, []
        if not found:
            return b""
        slices = [fact for fact in found if isinstance(fact, Segment)]
        points = [fact for fact in found if isinstance(fact, Arc) and fact.kind != PASSES]
        return encode_snapshot(
            FoundSnapshot(
                self.membership.view.lead,
                tuple([(self._grid.x_m(s.slice), s.bottom_mm / 1000.0, s.top_mm / 1000.0) for s in slices]),
                tuple([(arc.x_mm / 1000.0, arc.y_mm / 1000.0) for arc in points]),
            )
        )
