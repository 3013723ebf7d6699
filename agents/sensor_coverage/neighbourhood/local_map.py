"""A robot's map of the slots around its own, and the deployments it could lead: the planner's rules on one neighbourhood.

A robot plans only for the edges at its own slot, and only as their mover.
"""

import cmath
import math
from collections.abc import Iterable
from itertools import islice
from typing import Final

from zwerm.agents.sensor_coverage.frontier.directions import (
    angle_between,
    wrapped,
)
from zwerm.agents.sensor_coverage.frontier.fence import VERTEX_BESIDE_RAD, wedges
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.wall_plans import WALLS
from zwerm.agents.sensor_coverage.messages.beacons import NO_PATH_VECTOR, NOWHERE, Route, SeenRobot, StateBeacon
from zwerm.agents.sensor_coverage.neighbourhood.attempt_exchange import attempts_at, other_end, take_over
from zwerm.agents.sensor_coverage.neighbourhood.slot_map import DOUBT_COST, SlotMap
from zwerm.maths.simplicial import FlagComplex, edge

# Added cost of a route to a robot at a gap. Gaps are expanded when no edge can be expanded and no robot is in doubt.
GAP_COST: Final = 10_000.0
# The same for a robot with an open arc, from which a robot must follow a wall. That comes after all edges and gaps.
WALL_COST: Final = 20_000.0

# A body is seen from the other side if the directions to it differ by more than this [rad].
BEHIND_RAD: Final = math.pi / 2.0


class LocalMap(SlotMap):
    """One robot's neighbourhood.

    `plans` expand edges and `gaps` expand gaps around this robot, and `wall_plans` lead into open arcs of the `proof` of
    coverage. `unproven` counts the open arcs without an attempt left. `obstacle` has the obstacle edges here, and
    `obstructed` counts the sides and gaps that the body of a dead robot closes. `path_vectors` has the routes to the
    frontier. `plan_count` counts the times that plans were made. A base station sets `guests`.
    """

    # --- where to expand ----------------------------------------------------------------------------------------------

    @property
    def plan_basis(self) -> object:
        """The knowledge that the latest plans were made of: another object whenever plans were made."""
        return self._plan_basis

    def update_plans(self) -> None:
        """Find the deployments that this robot could lead, if anything has changed."""
        mutual = self.mutual()
        basis = (
            self.slot,
            self.epoch,
            self.samples,
            [(n, s.epoch, s.seen, s.attempts, s.expandable) for n, s in mutual.items()],
        )
        if self.slot == NOWHERE or self.redundant or self.heading is None or basis == self._plan_basis:
            return
        self._plan_basis = basis
        self.plan_count += 1
        me, planner = self.slot, self._planner
        scan = self.scan()
        take_over(planner.attempt_log, me, mutual.values(), self.parameters.attempts_max)
        for slot, (mean, _) in self._references.items():
            self._slots.remember(me, slot, cmath.phase(mean))
        planner.update(scan, [each for each in scan.complex_.edges if me in each])
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
        self.obstructed = self._count_obstructed(scan)
        if self.parameters.walls == "followed":
            self._plan_walks(scan)

    def _plan_walks(self, scan: ScanResult) -> None:
        """Find the open arcs around this robot, and the walks into them. A robot without neighbours has none."""
        me = self.slot
        self.proof.update(me, scan, [*self._slots.walls.get(me, ()), *self._slots.felt.get(me, ())])
        self.wall_plans, self.unproven = [], 0
        if self.proof.around:
            self.wall_plans, self.unproven = self._planner.walls.plans_at(
                me, next(iter(self.proof.around)), self.proof.open_arcs()
            )

    def _count_obstructed(self, scan: ScanResult) -> int:
        """Return the number of sides and gaps here that are closed only by the body of a dead robot.

        No robot must look behind a dead robot that did not claim a frontier when it died. The same holds if a neighbour
        sees the body from the other side.
        """
        if not self._obstructed:
            return 0
        me = self.slot
        sides = {(*side.edge, side.sign) for side in self._planner.fence.sides}
        around = {(me, a) for _, a, _, gap in wedges(scan.views, scan.complex_, [me]) if gap >= 2.0 * VERTEX_BESIDE_RAD}
        return sum(
            (key[:3] in sides or (key[2] == 0 and key[:2] in around)) and not self._is_seen_past(body)
            for key, body in self._obstructed.items()
        )

    def _is_seen_past(self, body: int) -> bool:
        seen = self.seen.get(body)
        if body in self._finished or body in self.states or seen is None:
            return True
        here = seen.bearing_rad + (self.heading or 0.0)
        return any(
            each.node == body and angle_between(each.direction_rad, here) > BEHIND_RAD
            for state in self.mutual().values()
            for each in state.seen
        )

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

    def plan_from_base(self, direction_rad: float, hand: int) -> Plan:
        """Return the plan to follow a wall from the base's point, into an open arc of the base."""
        return Plan((0, 0, 0, WALLS), 0, direction_rad, self.parameters.hop_m, 0.0, (0,), walk=True, hand=hand)

    def note_attempt(self, plan: Plan) -> None:
        """Record that a plan is tried."""
        self._planner.note_attempt(plan)
        self.replan()

    def note_obstruction(self, plan: Plan, driven_m: float, body: int) -> None:
        """Record that a robot's body stopped a plan after `driven_m`: if it is dead, nobody may know what is behind it."""
        self._obstructed[plan.key] = body
        self.note_failure(plan, driven_m)

    def unblock(self, node: int) -> None:
        """Try again what had failed, if a robot was in the way that is alive again."""
        self._finished.pop(node, None)
        if node in self._obstructed.values():
            self.reopen()

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Record that a wall stopped a plan after `driven_m`."""
        self._planner.note_failure(plan, driven_m)
        self.replan()

    def note_felt(self, directions: Iterable[float]) -> None:
        """Record walls that a robot felt close to this slot, by their directions [rad]."""
        for each in directions:
            self._planner.walls.note_wall(self.slot, each)
        self.replan()

    def note_near(self, arcs: Iterable[tuple[float, float]]) -> None:
        """Record arcs (start, width) [rad] in which a robot followed a wall close to this slot."""
        self.proof.add_near(arcs)
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
        heading = self.heading
        seen: tuple[SeenRobot, ...] = ()
        if heading is not None:
            seen = tuple(
                SeenRobot(node, epoch, slot, wrapped(bearing + heading))
                for node, (epoch, slot, bearing) in sorted(self.seen.items())
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
        )
