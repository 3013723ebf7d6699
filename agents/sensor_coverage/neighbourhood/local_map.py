"""What a robot knows of the places around its own, and where it could expand: the planner's rules, over one neighbourhood.

A robot plans only for the edges at itself, and only as their mover.
"""

import cmath
import math
from itertools import islice
from typing import Final

from zwerm.agents.sensor_coverage.frontier.planner import Planner, PlannerParameters
from zwerm.agents.sensor_coverage.frontier.services import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import REFERENCE_OFF_RAD, REFERENCE_WEIGHT, Slots
from zwerm.agents.sensor_coverage.messages.peers import (
    NOWHERE,
    UNSAID,
    ReferenceBearing,
    Route,
    SeenRobot,
    SlotMemory,
    StateBeacon,
)
from zwerm.agents.sensor_coverage.neighbourhood import attempt_exchange as trying
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable
from zwerm.agents.sensor_coverage.protocols.path_vector import PathVectorProtocol
from zwerm.maths.simplicial import Edge, FlagComplex, edge

# A robot that does not know yet whether it is at the frontier is not to be gone to, but waited for.
DOUBT_COST: Final = 1_000.0

# Robots at gaps expand when no edge can be expanded anywhere, and nobody is in doubt: their routes cost that much more.
GAP_COST: Final = 10_000.0


class LocalMap(NeighbourTable):
    """One robot's neighbourhood. `looks` counts its plans."""

    def __init__(self, node: int, rules: PlannerParameters) -> None:
        super().__init__(node)
        self.rules = rules
        self.plans: list[Plan] = []
        self.gaps: list[Plan] = []
        self.gradient = PathVectorProtocol()
        self.obstacle: dict[Edge, None] = {}
        self.looks = 0
        self._references: dict[int, tuple[complex, int]] = {}
        self._learned: dict[int, tuple[int, ...]] = {}
        self._places = Slots()
        self._planner = Planner(rules, self._places)
        self._looked: object = None
        self._apart: tuple[int, int | None] | None = None

    # --- what is remembered of a place ------------------------------------------------------------------------------

    def learn_references(self) -> None:
        """Let remembered directions follow what both ends see, slowly: else errors would walk at random."""
        if self.heading is None or self.place == NOWHERE:
            return
        for node, state in self.mutual().items():
            looks = self.epoch, self.samples, state.epoch, state.samples
            if self._learned.get(node) == looks:
                continue
            self._learned[node] = looks
            back = self._back(node) or 0.0
            now = cmath.exp(1j * (self.seen[node].bearing_rad + self.heading)) + cmath.exp(1j * (back + math.pi))
            now /= abs(now) or 1.0
            mean, count = self._references.get(state.place, (now, 0))
            if abs(cmath.phase(now / mean)) > REFERENCE_OFF_RAD:
                mean, count = now, 0
            mean += max(1.0 / (count + 1), REFERENCE_WEIGHT) * (now - mean)
            self._references[state.place] = mean / (abs(mean) or 1.0), count + 1

    def touch(self, bearings: tuple[float, ...]) -> None:
        """Remember walls at this place."""
        if self.heading is None or self.place == NOWHERE:
            return
        walls = self._places.walls.setdefault(self.place, [])
        for bearing in bearings:
            direction = math.remainder(bearing + self.heading, math.tau)
            if all(abs(math.remainder(each - direction, math.tau)) > 0.2 for each in walls):
                walls.append(direction)
                self._looked = None
                self.change()

    def onward(self) -> int | None:
        """Return the neighbour that is next on the way to the frontier, if it is there; None at the frontier itself."""
        if self.route is None or not self.leads or len(self.route.places) < 2:
            return None
        return next((node for node, s in self.mutual().items() if s.place == self.route.places[1]), None)

    # --- where to expand --------------------------------------------------------------------------------------------

    def plan(self) -> None:
        """Find out where this robot could expand, if anything has changed."""
        mutual = self.mutual()
        picture_of = (
            self.place,
            self.epoch,
            self.samples,
            [(n, s.epoch, s.seen, s.tries, s.could) for n, s in mutual.items()],
        )
        if self.place == NOWHERE or self.spare or self.heading is None or picture_of == self._looked:
            return
        self._looked = picture_of
        self.looks += 1
        me = self.place
        picture = self.picture()
        trying.hear(self._planner.tried, me, mutual.values(), self.rules.attempts_max)
        for place, (mean, _) in self._references.items():
            self._places.remember(me, place, cmath.phase(mean))
        self._planner.look(picture, [each for each in picture.complex_.edges if me in each])
        self.plans, self.gaps = islice(self._planner.plans(), 2)  # holes are nothing that a robot alone can tell
        could = {
            (edge(me, state.place), sign) for state in mutual.values() for other, sign in state.could if other == me
        }
        could |= {(edge(*each.key[:2]), each.key[2]) for each in self.plans}
        found = self._planner.fence
        self.obstacle = dict.fromkeys(
            (*found.corners, *(side.edge for side in found.sides if (side.edge, side.sign) not in could))
        )

    @property
    def looked(self) -> object:
        """What the plans were last made of: another object whenever they were made anew."""
        return self._looked

    def picture(self) -> ScanResult:
        """Return what is known of the places around: what this robot and its neighbours see, from its own place."""
        me, mutual, heading = self.place, self.mutual(), self.heading or 0.0
        views = {me: {state.place: self.seen[node].bearing_rad + heading for node, state in sorted(mutual.items())}}
        for state in mutual.values():
            views[state.place] = {s.place: s.direction_rad for s in state.seen if s.place != NOWHERE}
        near = tuple(views)
        for place in near:
            for other, direction in views[place].items():
                if other not in near:  # two hops away: all that is known of it is who sees it
                    views.setdefault(other, {})[place] = direction + math.pi
        complex_ = FlagComplex(views)
        return ScanResult(views, complex_, tuple(each for each in complex_.vertices if each != me or me == 0))

    def rim(self) -> tuple[int, ...]:
        """Return the places to which an edge of the rim leads from here, as of the last plan."""
        return tuple(b if a == self.place else a for a, b in self._planner.rim() if self.place in (a, b))

    def note_attempt(self, plan: Plan) -> None:
        """Take note that a plan is being tried."""
        self._planner.note_attempt(plan)
        self._looked = None
        self.change()

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Take note that it failed."""
        self._planner.note_failure(plan, driven_m)
        self._looked = None
        self.change()

    def stay(self, fresh: int, follower: int | None) -> None:
        """Take note that this robot led a push and stays: the place `fresh` is nobody's, and `follower` should not come."""
        self._apart = fresh, follower

    def part(self) -> None:
        """Take the name that is nobody's, if the follower came all the same: no two hold one place for long."""
        if self._apart is not None:
            fresh, follower = self._apart
            state = None if follower is None else self.states.get(follower)
            if state is not None and state.place == self.place:
                self.found(fresh)

    def best(self) -> Plan | None:
        """Return the plan to carry out here."""
        wanted = self.plans or self.gaps
        return min(wanted, key=lambda each: each.key) if wanted else None

    @property
    def route(self) -> Route | None:
        """The way to the frontier, as far as this robot knows."""
        return self.gradient.route

    @property
    def to_gap(self) -> bool:
        """Whether the way to the frontier is one to a gap."""
        return self.route is not None and self.route.cost >= GAP_COST

    @property
    def leads(self) -> bool:
        """Whether there is a way to a frontier, and none to anybody in doubt before that."""
        return self.route is not None and not DOUBT_COST <= self.route.cost < GAP_COST

    def doubt(self, tick: int) -> None:
        """Let nobody believe that there is no frontier, or none but gaps, while this robot does not know."""
        if self.place not in (0, NOWHERE) and (self.route is None or self.route.cost >= GAP_COST):
            self.gradient.claim(self.place, DOUBT_COST, tick)

    def find_route(self, tick: int) -> None:
        """Choose the way to the frontier by what neighbours say of theirs."""
        at = self.place not in (0, NOWHERE)
        cost = 0.0 if at and self.plans else GAP_COST if at and self.gaps else None
        dear = self.rules.obstacle_cost
        weights = {
            state.place: dear if edge(self.place, state.place) in self.obstacle else 1.0
            for state in self.mutual().values()
        }
        self.gradient.choose(self.place, cost, weights, tick)

    # --- what this robot says ---------------------------------------------------------------------------------------

    def state(self, waiting: bool) -> StateBeacon:
        """Return what to tell everyone, but for numbers, the way, and how far the base is."""
        heading = self.heading
        seen: tuple[SeenRobot, ...] = ()
        if heading is not None:
            seen = tuple(
                SeenRobot(node, epoch, place, math.remainder(bearing + heading, math.tau))
                for node, (epoch, place, bearing) in sorted(self.seen.items())
            )
        return StateBeacon(
            0,
            self.place,
            self.epoch,
            self.moving,
            waiting,
            self.samples,
            seen,
            trying.tell(self._planner.tried, self.place),
            tuple(sorted({(trying.other_end(each.key, self.place), each.key[2]) for each in self.plans})),
            UNSAID,
            self.spare,
        )

    # --- places change hands ----------------------------------------------------------------------------------------

    def memory(self) -> SlotMemory:
        """Return what is to be known of this place by who comes next."""
        tried, me = self._planner.tried, self.place
        references = []
        for place, (mean, count) in sorted(self._references.items()):
            node = self.at(place)
            if node is not None:
                references.append(ReferenceBearing(place, node, cmath.phase(mean), count))
        return SlotMemory(
            me,
            tuple(references),
            tuple(self._places.walls.get(me, ())),
            tuple(tried.closed),
            tuple(key for key, place in tried.failed if place == me),
            tuple(tried.attempts.items()),
            tuple(tried.blocked.get(me, ())),
        )

    def leave(self) -> None:
        """Forget all that is known of the place."""
        self.place = NOWHERE
        self.spare = False
        self._references.clear()
        self._learned.clear()
        self._places = Slots()
        self._planner = Planner(self.rules, self._places)
        self.plans, self.gaps, self.obstacle = [], [], {}
        self._looked = None
        self._apart = None
        self._awaited = {}
        self.change()

    def stand_down(self) -> None:
        """Leave the complex, and stay in body."""
        self.spare = True
        self.plans, self.gaps, self.obstacle = [], [], {}
        self.change()

    def found(self, place: int) -> None:
        """Be the first at a place."""
        self.leave()
        self.place = place
        self.gradient.take_over(place, Route(DOUBT_COST, (place,)))

    def enter(self, memory: SlotMemory) -> None:
        """Take a place over."""
        self.found(memory.place)
        me = self.place
        for each in memory.references:
            self._references[each.place] = cmath.rect(1.0, each.direction_rad), each.count
        self._places.walls[me] = list(memory.walls)
        tried = self._planner.tried
        tried.closed = dict.fromkeys(memory.closed)
        tried.failed = dict.fromkeys((key, me) for key in memory.failed)
        tried.attempts = dict(memory.attempts)
        tried.blocked[me] = list(memory.blocked)
