"""A robot's map of the slots around its own, and the deployments it could lead: the planner's rules on one neighbourhood.

A robot plans only for the edges at its own slot, and only as their mover.
"""

import cmath
import math
from collections.abc import Callable
from itertools import islice
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.decisions import FrontierService, SlotCoverageProof
from zwerm.agents.sensor_coverage.frontier.directions import wrapped
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, mark_of
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, NOWHERE, Route, SeenRobot, StateBeacon
from zwerm.agents.sensor_coverage.messages.commands import NearWalls
from zwerm.agents.sensor_coverage.messages.pushes import SlotMemory
from zwerm.agents.sensor_coverage.neighbourhood.attempt_exchange import attempts_at, other_end, take_over
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable
from zwerm.agents.sensor_coverage.neighbourhood.obstructions import Obstructions
from zwerm.agents.sensor_coverage.neighbourhood.references import Displaced, References
from zwerm.agents.sensor_coverage.protocols.path_vector import PathVectorProtocol
from zwerm.maths.simplicial import Edge, FlagComplex, edge

# Cost of a route to a robot that does not know yet whether it is at the frontier. Other robots do not push there.
DOUBT_COST: Final = 1_000.0
# Added cost of a route to a robot at a gap. Gaps are expanded when no edge can be expanded and no robot is in doubt.
GAP_COST: Final = 10_000.0
# The same for a robot with an open arc, from which a robot must follow a wall. That comes after all edges and gaps.
WALL_COST: Final = 20_000.0


class FrontierMakers(NamedTuple):
    """What makes the planner of a slot, and its proof of coverage."""

    planner: Callable[[PlannerParameters, Slots], FrontierService]
    proof: Callable[[], SlotCoverageProof]


class LocalMap(NeighbourTable):
    """One robot's neighbourhood.

    `plans` expand edges and `gaps` expand gaps around this robot, and `wall_plans` lead into open arcs of the `proof` of
    coverage. `unproven` counts the open arcs without an attempt left. `obstacle` has the obstacle edges here, and
    `obstructed` counts the sides and gaps that the body of a dead robot closes. `path_vectors` has the routes to the
    frontier. `plan_count` counts the times that plans were made. A base station sets `guests`.
    """

    def __init__(self, node: int, parameters: PlannerParameters, makers: FrontierMakers, incarnation: int = 1) -> None:
        super().__init__(node, incarnation)
        self.guests: tuple[int, ...] = ()
        self.parameters = parameters
        self.plans: list[Plan] = []
        self.gaps: list[Plan] = []
        self.wall_plans: list[Plan] = []
        self.unproven = 0
        self.proof = makers.proof()
        self.path_vectors = PathVectorProtocol()
        self.obstacle: dict[Edge, None] = {}
        self.obstructed = 0
        self._bodies = Obstructions()
        self.plan_count = 0
        self._makers = makers
        self.references = References()
        self._slots = Slots()
        self._planner = makers.planner(parameters, self._slots)
        self._plan_basis: object = None
        self._led: tuple[int, int | None] | None = None  # (new slot, follower) of a push that failed

    # --- memory of the slot -------------------------------------------------------------------------------------------

    def learn_references(self) -> None:
        """Refine the reference directions to all slots whose robots see this robot too."""
        if self.heading is None or self.slot == NOWHERE:
            return
        for node, state in self.mutual().items():
            if self.references.is_new(node, numbers := (self.epoch, self.samples, state.epoch, state.samples)):
                there, back = self.seen[node].bearing_rad + self.heading, self._back(node) or 0.0
                known_m = self.distances_m.get(state.slot, math.inf)
                match self.references.take(node, state.slot, numbers, there, back, known_m):
                    case Displaced.SELF:
                        self.forget_walls()
                    case Displaced.OTHER:
                        self.proof.lose(state.slot)

    def forget_walls(self) -> None:
        """Forget what former robots at the slot saw of walls: this one stands elsewhere."""
        self.proof.inherit(())
        self._planner.walls.forget()

    def update_walls(self, bearings: tuple[float, ...], robots: tuple[int, ...] = ()) -> None:
        """Remember the walls that this robot touches, by their bearings [rad], and the robots."""
        heading = self.heading
        if heading is None or self.slot == NOWHERE:
            return
        if self._slots.touch(self.slot, [wrapped(each + heading) for each in bearings], robots):
            self._plan_basis = None
            self.change()

    def memory(self) -> SlotMemory:
        """Return the memory of this slot, for its next occupant."""
        log, me = self._planner.attempt_log, self.slot
        return SlotMemory(
            me,
            self.references.memory(self.at),
            tuple(self._slots.walls.get(me, ())),
            tuple(log.closed),
            tuple(key for key, slot in log.failed if slot == me),
            tuple(log.attempts.items()),
            tuple(log.blocked.get(me, ())),
            self.path_vectors.newest_claim(me),
            tuple(self._bodies.stopped.items()),
            tuple(self._planner.walls.tried.get(me, ())),
            self.proof.memory(),
            tuple(self.distances_m.items()),
            tuple(self._planner.walls.probed.get(me, ())),
            self.proof.edges(),
            tuple((slot, *way) for slot, way in self.references.ways.items()),
        )

    def reopen(self) -> None:
        """Try again all that has failed: a robot is missing, and the obstacle of that time may be gone."""
        log = self._planner.attempt_log
        log.closed, log.failed, log.attempts = {}, {}, {}
        log.blocked.clear()
        self._planner.walls.forget()
        self._bodies.stopped = {}
        self.replan()

    def replan(self) -> None:
        """Make plans again, although neither the view nor a neighbour has changed."""
        self._plan_basis = None
        self.change()

    # --- robots that died or restarted --------------------------------------------------------------------------------

    def remove_dead(self, node: int) -> None:
        """Forget a robot that is dead, the claims of its slot, and attempts at gaps: these have other directions without it."""
        slot = self.slot_of(node)
        if slot != NOWHERE and not self.states[node].moving and not self.path_vectors.is_claimed(slot):
            self._bodies.finished[node] = None
        self.path_vectors.forget(node, slot)
        self._planner.attempt_log.forget_gaps()
        self._planner.walls.tried.clear()
        self.proof.lose(slot, mark_of(node))
        if node in self._bodies.stopped.values():
            self.reopen()  # a drive that pushes its body finds out what is behind it
        self._plan_basis = None
        self.forget(node)

    def restarted(self, node: int) -> None:
        """Forget a robot that has lost its memory, and end the claims of its slot."""
        self.proof.lose(self.slot_of(node), mark_of(node))
        self.path_vectors.forget(node, self.slot_of(node))
        super().restarted(node)

    # --- slots change hands -------------------------------------------------------------------------------------------

    def vacate(self) -> None:
        """Occupy no slot, and delete all that is known of the present one."""
        self.slot, self.redundant = NOWHERE, False
        self.references = References()
        self._slots = Slots()
        self._planner = self._makers.planner(self.parameters, self._slots)
        self._drop_plans()
        self.proof, self.distances_m = self._makers.proof(), {}
        self.reach.leave()
        self._bodies.stopped, self._handovers = {}, {}
        self._plan_basis = self._led = None
        self.change()

    def occupy(self, slot: int) -> None:
        """Be the first robot at a new slot."""
        self._take(slot)

    def _take(self, slot: int, claims: int = 0) -> None:
        self.vacate()
        self.slot = slot
        self.at_base = False
        self.path_vectors.take_over(slot, Route(DOUBT_COST, (slot,)), claims)

    def inherit(self, memory: SlotMemory) -> None:
        """Take over a slot with its memory."""
        self._take(memory.slot, memory.claims)
        me = self.slot
        self.references = References(memory.references, memory.ways)
        self._slots.walls[me] = list(memory.walls)
        log = self._planner.attempt_log
        log.closed = dict.fromkeys(memory.closed)
        log.failed = dict.fromkeys((key, me) for key in memory.failed)
        log.attempts = dict(memory.attempts)
        log.blocked[me] = list(memory.blocked)
        self._bodies.stopped = dict(memory.obstructed)
        self._planner.walls.tried[me], self._planner.walls.probed[me] = list(memory.explored), list(memory.probed)
        self.proof.inherit(memory.proved, memory.edges)
        self.distances_m = dict(memory.distances_m)

    def leave_complex(self) -> None:
        """Leave the complex; the body stays at the slot."""
        self.redundant = True
        self._drop_plans()
        self.change()

    def _drop_plans(self) -> None:
        self.plans, self.gaps, self.wall_plans, self.obstacle = [], [], [], {}
        self.obstructed = self.unproven = 0

    def abandon_push(self, fresh: int, follower: int | None) -> None:
        """Record that this robot led a push and stays: no robot occupies `fresh`, and `follower` should not come."""
        self._led = fresh, follower

    def resolve_duplicate(self) -> None:
        """Occupy the new slot of an abandoned push if the follower came all the same: no two robots keep one slot."""
        if self._led is not None:
            fresh, follower = self._led
            state = None if follower is None else self.states.get(follower)
            if state is not None and state.slot == self.slot:
                self.occupy(fresh)

    # --- where to expand ----------------------------------------------------------------------------------------------

    @property
    def plan_basis(self) -> object:
        """The knowledge that the latest plans were made of: another object whenever plans were made."""
        return self._plan_basis

    def update_plans(self) -> None:
        """Find the deployments that this robot could lead, if anything has changed."""
        mutual = self.mutual()
        views = [(n, s.epoch, s.seen, s.attempts, s.expandable) for n, s in mutual.items()]
        basis = self.slot, self.epoch, self.samples, views
        if self.slot == NOWHERE or self.redundant or self.heading is None or basis == self._plan_basis:
            return
        self._plan_basis = basis
        self.plan_count += 1
        me, planner, scan = self.slot, self._planner, self.scan()
        take_over(planner.attempt_log, me, mutual.values(), self.parameters.attempts_max)
        for slot, (mean, _) in self.references.items():
            self._slots.remember(me, slot, cmath.phase(mean))
        follows, arcs = self.parameters.walls == "followed", list[Arc]()
        if follows:
            self.update_proof(scan)
            arcs = self.proof.open_arcs() if self.proof.around else []
        known = {me: arcs} if self.proof.knows_walks else None
        planner.update(scan, [each for each in scan.complex_.edges if me in each], known)
        # Plans into holes are left out, because a robot alone cannot recognise a hole.
        edges, gaps = islice(planner.plans(), 2)
        self.plans, self.gaps = list(edges), list(gaps)
        could = {
            (edge(me, state.slot), sign) for state in mutual.values() for other, sign in state.expandable if other == me
        }
        could |= {(edge(*each.key[:2]), each.key[2]) for each in self.plans}
        found = planner.fence
        self.obstacle = dict.fromkeys(
            (*found.corners, *(side.edge for side in found.sides if (side.edge, side.sign) not in could))
        )
        seen = {node: each.bearing_rad + (self.heading or 0.0) for node, each in self.seen.items()}
        self.obstructed = self._bodies.count(me, scan, planner.fence, seen, self.states, mutual.values())
        if follows:  # a robot without neighbours has no open arcs
            self.wall_plans, self.unproven = planner.walls.plans_at(me, self.proof.around, arcs)

    def update_proof(self, scan: ScanResult | None = None) -> None:
        """Take the present view into the proof of coverage."""
        me, slots = self.slot, self._slots
        self.proof.lose(*(each.slot for each in self.states.values() if each.redundant))
        in_touch = [state.slot for node, state in self.mutual().items() if node in slots.in_touch.get(me, ())]
        self.proof.update(me, scan or self.scan(), slots.touching.get(me, ()), in_touch)

    def scan(self) -> ScanResult:
        """Return the views of this robot and its neighbours as a scan, by this robot's slot."""
        me, mutual, heading = self.slot, self.mutual(), self.heading or 0.0
        views = {me: {state.slot: self.seen[node].bearing_rad + heading for node, state in sorted(mutual.items())}}
        for state in mutual.values():
            views[state.slot] = {s.slot: s.direction_rad for s in state.seen if s.slot != NOWHERE}
        near = tuple(views)
        for slot in near:
            for other, direction in views[slot].items():
                if other not in near:  # two hops away: only the robots that see it are known
                    views.setdefault(other, {})[slot] = direction + math.pi
        complex_ = FlagComplex(views)
        return ScanResult(views, complex_, tuple(each for each in complex_.vertices if each != me or me == 0))

    def boundary_slots(self) -> tuple[int, ...]:
        """Return the slots to which a boundary edge leads from here, by the latest plans."""
        edges = self._planner.boundary_edges()
        return tuple(b if a == self.slot else a for a, b in edges if self.slot in (a, b))

    def best_plan(self) -> Plan | None:
        """Return the plan to carry out here, or None."""
        wanted = self.plans or self.gaps or self.wall_plans
        return min(wanted, key=lambda each: each.key) if wanted else None

    def note_attempt(self, plan: Plan) -> None:
        """Record that a plan is tried."""
        self._planner.note_attempt(plan)
        self.replan()

    def note_obstruction(self, plan: Plan, driven_m: float, body: int) -> None:
        """Record that a robot's body stopped a plan after `driven_m`: if it is dead, nobody may know what is behind it."""
        self._bodies.stopped[plan.key] = body
        self.note_failure(plan, driven_m)

    def unblock(self, node: int) -> None:
        """Try again what had failed, if a robot was in the way that is alive again."""
        self._bodies.finished.pop(node, None)
        if node in self._bodies.stopped.values():
            self.reopen()

    def probes(self) -> list[Plan]:
        """Return a plan for each open arc here that no robot has probed yet, for this robot to carry out."""
        return self._planner.walls.probes_at(self.slot, self.proof.open_arcs())

    def note_failure(self, plan: Plan, driven_m: float) -> Plan | None:
        """Record that a wall stopped a plan after `driven_m`; return the plan to carry out at once."""
        self._planner.note_failure(plan, driven_m)
        self.replan()
        return self._planner.next_plan(plan)

    def note_near(self, near: NearWalls) -> None:
        """Record walls close to this slot that were followed."""
        self.proof.add_near(near)
        self.replan()

    # --- the route to the frontier ------------------------------------------------------------------------------------

    @property
    def route(self) -> Route | None:
        """The route to the frontier, or None."""
        return self.path_vectors.route

    @property
    def to_gap(self) -> bool:
        """True if the route leads to a gap, or to a wall that must be followed."""
        return self.route is not None and self.route.cost >= GAP_COST

    @property
    def to_wall(self) -> bool:
        """True if the route leads to a wall that must be followed."""
        return self.route is not None and self.route.cost >= WALL_COST

    @property
    def has_route(self) -> bool:
        """True if there is a route to a frontier, and no nearer robot is in doubt."""
        return self.route is not None and not DOUBT_COST <= self.route.cost < GAP_COST

    def next_hop(self) -> int | None:
        """Return the next robot on the route to the frontier, if it is a neighbour; None at the frontier itself."""
        if self.route is None or not self.has_route or len(self.route.slots) < 2:
            return None
        return next((node for node, s in self.mutual().items() if s.slot == self.route.slots[1]), None)

    def claim_doubt(self, tick: int) -> None:
        """Announce doubt, so that no robot concludes that there is no frontier while this robot does not know."""
        if self.slot not in (0, NOWHERE) and (self.route is None or self.route.cost >= GAP_COST):
            self.path_vectors.claim(self.slot, DOUBT_COST, tick)

    def find_route(self, tick: int) -> None:
        """Choose the route to the frontier by the neighbours' routes."""
        placed = self.slot not in (0, NOWHERE)
        cost = None
        if placed:
            cost = 0.0 if self.plans else GAP_COST if self.gaps else WALL_COST if self.wall_plans else None
        obstacle_cost = self.parameters.obstacle_cost
        weights = {
            state.slot: obstacle_cost if edge(self.slot, state.slot) in self.obstacle else 1.0
            for state in self.mutual().values()
        }
        self.path_vectors.choose(self.slot, cost, weights, tick)

    # --- this robot's state -------------------------------------------------------------------------------------------

    def state(self, waiting: bool) -> StateBeacon:
        """Return this robot's state without its number and path vector."""
        heading, sightings = self.heading, sorted(self.seen.items())
        seen = (
            ()
            if heading is None
            else tuple(
                SeenRobot(node, epoch, slot, wrapped(bearing + heading)) for node, (epoch, slot, bearing) in sightings
            )
        )
        return StateBeacon(
            0,
            self.slot,
            self.epoch,
            self.moving,
            waiting,
            self.samples,
            seen,
            attempts_at(self._planner.attempt_log, self.slot),
            tuple(sorted({(other_end(each.key, self.slot), each.key[2]) for each in self.plans})),
            NO_PATH_VECTOR,
            self.redundant,
            self.guests,
            self.displaced,
        )
