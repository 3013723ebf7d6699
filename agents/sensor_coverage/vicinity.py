"""What a robot knows of the places around its own, and where it could expand: the planner's rules, over one neighbourhood.

Robots tell each other what they see in one frame, that of the base: each knows its heading from reciprocal bearings, and who
comes out of the depot sees what the base sees. Every sighting names the drive since which it holds, so that a robot knows
whether two views belong together. A robot plans only for the edges at itself, and only as their mover.
"""

import cmath
import math
from collections.abc import Mapping
from itertools import islice
from typing import Final, NamedTuple

import msgspec

from zwerm.agents.sensor_coverage.words import NOWHERE, Memory, Reference, Route, Seen, State, Try
from zwerm.frontier.places import REFERENCE_OFF_RAD, REFERENCE_WEIGHT, Places
from zwerm.frontier.planner import Parameters, Planner
from zwerm.frontier.services import Picture, Plan
from zwerm.simplicial import Edge, FlagComplex, edge

# Robots at gaps expand when no edge can be expanded anywhere: their routes cost that much more.
GAP_COST: Final = 1000.0

# A robot that does not know yet whether it is at the frontier is not to be gone to, but waited for.
DOUBT_COST: Final = 10_000.0

# How long a place may be on its way from one robot to the next [ticks].
AWAIT_TICKS: Final = 80


class Sighting(NamedTuple):
    """A robot as this one sees it: since which of its drives (-1: not known yet), at which place, and the bearing."""

    epoch: int
    place: int
    bearing_rad: float


class Vicinity:
    """One robot's neighbourhood. `place` is where it stands, `heading` its own in the base's frame, once known."""

    def __init__(self, node: int, rules: Parameters) -> None:
        self.node = node
        self.rules = rules
        self.place = NOWHERE
        self.epoch = 0
        self.moving = False
        self.heading: float | None = None
        self.samples = 0
        self.states: dict[int, State] = {}
        self.heard: dict[int, int] = {}  # node: tick
        self.seen: dict[int, Sighting] = {}
        self.plans: list[Plan] = []
        self.gaps: list[Plan] = []
        self.route: Route | None = None
        self.obstacle: dict[Edge, None] = {}
        self._references: dict[int, tuple[complex, int]] = {}
        self._learned: dict[int, tuple[int, ...]] = {}
        self._headings = 0
        self._places = Places()
        self._planner = Planner(rules, self._places)
        self._looked: object = None
        self._awaited: dict[int, int] = {}  # places beside this one that change hands, and since when

    # --- what others say --------------------------------------------------------------------------------------------

    def hear(self, sender: int, state: State, tick: int) -> bool:
        """Take in a neighbour's state; tell whether its bearing so far holds no more."""
        known = self.states.get(sender)
        self.heard[sender] = tick
        if known is not None and state.number <= known.number:
            return False
        self.states[sender] = state
        if state.place in self._awaited and not state.moving:
            del self._awaited[state.place]
        left = known is not None and (state.moving or known.place != state.place)
        if known is not None and left and known.place != NOWHERE and not known.moving and sender in self.seen:
            self._awaited[known.place] = tick
        sighting = self.seen.get(sender)
        if sighting is not None and not state.moving and sighting.epoch in (-1, state.epoch):
            self.seen[sender] = Sighting(state.epoch, state.place, sighting.bearing_rad)
        if state.place != NOWHERE:
            for node, each in self.states.items():
                if node != sender and each.place == state.place:  # who leads a push has left it to its follower
                    self.states[node] = _elsewhere(each)
        if known is None:
            return state.samples == 0
        return bool(state.epoch != known.epoch or (known.moving and not state.moving))

    def forget(self, node: int) -> None:
        """Forget a robot that is dead or far away."""
        self.states.pop(node, None)
        self.heard.pop(node, None)

    def at(self, place: int) -> int | None:
        """Return who stands at a place, as far as this robot has heard."""
        if place == self.place:
            return self.node
        return next((node for node, state in self.states.items() if state.place == place), None)

    def go(self) -> None:
        """Begin a drive: what was seen holds no more."""
        self.epoch += 1
        self.moving = True
        self.samples = 0
        self.seen = {}

    # --- what this robot sees ---------------------------------------------------------------------------------------

    def look(self, bearings: Mapping[int, float]) -> None:
        """Take what this robot sees, averaged."""
        self.seen = {}
        for node, bearing in bearings.items():
            state = self.states.get(node)
            if state is None or state.moving:
                self.seen[node] = Sighting(-1, NOWHERE, bearing)
            else:
                self.seen[node] = Sighting(state.epoch, state.place, bearing)
        self.samples += 1
        self._learn_heading()

    def _learn_heading(self) -> None:
        """Refine the heading by reciprocal bearings."""
        if self.place in (0, NOWHERE) or self.heading is None:  # on top of the base there is no bearing to it
            return
        off = 0j
        for node, (_, _, bearing) in self.seen.items():
            back = self._back(node)
            if back is not None:
                off += cmath.exp(1j * (back + math.pi - self.heading - bearing))
        if off:
            self.heading += cmath.phase(off) / min(self._headings + 1, 20)
            self._headings += 1

    def find_heading(self) -> None:
        """Take the heading from the base, if this robot stands there: it sees what the base sees."""
        base = next((state for state in self.states.values() if state.place == 0), None)
        if base is None or self.heading is not None or not self.samples:
            return
        there = {each.node: each for each in base.seen if each.place != NOWHERE}
        off = 0j
        for node, (epoch, _, bearing) in self.seen.items():
            if node in there and epoch == there[node].epoch != -1:
                off += cmath.exp(1j * (there[node].direction_rad - bearing))
        if off or not there:
            self.heading = cmath.phase(off) if off else 0.0

    def _back(self, node: int) -> float | None:
        """Return the direction in which a neighbour sees this robot where it stands now."""
        state = self.states.get(node)
        if state is None or state.moving or state.place == NOWHERE:
            return None
        if node not in self.seen or self.seen[node].epoch != state.epoch:
            return None
        return next((s.direction_rad for s in state.seen if s.node == self.node and s.epoch == self.epoch), None)

    def mutual(self) -> dict[int, State]:
        """Return the robots with a place that see this one and are seen by it, both since they last moved."""
        return {node: self.states[node] for node in self.seen if self._back(node) is not None}

    def stale(self, sight: Mapping[int, float]) -> list[int]:
        """Return the robots in sight whose word is missing, or does not fit what this robot sees; it should wait for them."""
        found = []
        for node in sight:
            state = self.states.get(node)
            if state is None or (state.place != NOWHERE and self._back(node) is None):
                found.append(node)
        mutual = self.mutual()
        for node, state in mutual.items():
            if any(s.node in mutual and s.epoch != mutual[s.node].epoch for s in state.seen):
                found.append(node)
        return found

    def changing(self, sight: Mapping[int, float], tick: int) -> bool:
        """Tell whether robots around are on their way: what this robot sees is then no picture of places."""
        self._awaited = {place: since for place, since in self._awaited.items() if tick - since < AWAIT_TICKS}
        return bool(self._awaited) or bool(self.stale(sight))

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
        if self.place == NOWHERE or self.heading is None or picture_of == self._looked:
            return
        self._looked = picture_of
        me, heading = self.place, self.heading
        views = {me: {state.place: self.seen[node].bearing_rad + heading for node, state in sorted(mutual.items())}}
        for state in mutual.values():
            views[state.place] = {s.place: s.direction_rad for s in state.seen if s.place != NOWHERE}
        near = tuple(views)
        for place in near:
            for other, direction in views[place].items():
                if other not in near:  # two hops away: all that is known of it is who sees it
                    views.setdefault(other, {})[place] = direction + math.pi
        complex_ = FlagComplex(views)
        self._recall(mutual)
        bases = tuple(each for each in complex_.vertices if each != me or me == 0)
        mine = [each for each in complex_.edges if me in each]
        self._planner.look(Picture(views, complex_, bases), mine)
        self.plans, self.gaps = islice(self._planner.plans(), 2)  # holes are nothing that a robot alone can tell
        could = {
            (edge(me, state.place), sign) for state in mutual.values() for other, sign in state.could if other == me
        }
        could |= {(edge(*each.key[:2]), each.key[2]) for each in self.plans}
        found = self._planner.fence
        self.obstacle = dict.fromkeys(
            (*found.corners, *(side.edge for side in found.sides if (side.edge, side.sign) not in could))
        )

    def _recall(self, mutual: Mapping[int, State]) -> None:
        """Let the planner know what neighbours tried at common edges, and what directions are remembered."""
        tried, me = self._planner.tried, self.place
        for state in mutual.values():
            for each in state.tries:
                if each.other == me:
                    key = (*edge(me, state.place), each.sign)
                    if each.failed:
                        tried.failed[key, state.place] = None
                    if each.closed or each.attempts + tried.attempts.get(key, 0) >= self.rules.attempts_max:
                        tried.closed[key] = None
        for place, (mean, _) in self._references.items():
            self._places.remember(me, place, cmath.phase(mean))

    def note_attempt(self, plan: Plan) -> None:
        """Take note that a plan is being tried."""
        self._planner.note_attempt(plan)
        self._looked = None

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Take note that it failed."""
        self._planner.note_failure(plan, driven_m)
        self._looked = None

    def best(self) -> Plan | None:
        """Return the plan to carry out here."""
        wanted = self.plans or self.gaps
        return min(wanted, key=lambda each: each.key) if wanted else None

    def doubt(self) -> None:
        """Let nobody believe that there is no frontier, while this robot does not know."""
        if self.route is None and self.place not in (0, NOWHERE):
            self.route = Route(DOUBT_COST, (self.place,))

    @property
    def leads(self) -> bool:
        """Whether there is a way to a frontier."""
        return self.route is not None and self.route.cost < DOUBT_COST

    def find_route(self) -> None:
        """Choose the way to the frontier by what neighbours say of theirs; nobody's way leads through here again."""
        best: tuple[float, tuple[int, ...]] | None = None
        if self.place not in (0, NOWHERE) and (self.plans or self.gaps):
            best = (0.0 if self.plans else GAP_COST), (self.place,)
        for state in self.mutual().values():
            if state.route is None or self.place in state.route.places or state.place == 0:
                continue
            weight = self.rules.obstacle_cost if edge(self.place, state.place) in self.obstacle else 1.0
            found = state.route.cost + weight, (self.place, *state.route.places)
            if best is None or (found[0], found[1][-1], found[1]) < (best[0], best[1][-1], best[1]):
                best = found
        self.route = None if best is None else Route(*best)

    # --- what this robot says ---------------------------------------------------------------------------------------

    def state(self, number: int, waiting: bool) -> State:
        """Return what to tell everyone."""
        heading = self.heading
        seen: tuple[Seen, ...] = ()
        if heading is not None:
            seen = tuple(
                Seen(node, epoch, place, math.remainder(bearing + heading, math.tau))
                for node, (epoch, place, bearing) in sorted(self.seen.items())
            )
        return State(
            number,
            self.place,
            self.epoch,
            self.moving,
            waiting,
            self.samples,
            seen,
            self._tries(),
            tuple(sorted({(_other(each.key, self.place), each.key[2]) for each in self.plans})),
            self.route,
        )

    def _tries(self) -> tuple[Try, ...]:
        tried, me = self._planner.tried, self.place
        keys = dict.fromkeys((*tried.attempts, *tried.closed, *(key for key, _ in tried.failed)))
        return tuple(
            Try(_other(key, me), key[2], tried.attempts.get(key, 0), (key, me) in tried.failed, key in tried.closed)
            for key in sorted(keys)
            if len(key) == 3
        )

    # --- places change hands ----------------------------------------------------------------------------------------

    def memory(self) -> Memory:
        """Return what is to be known of this place by who comes next."""
        tried, me = self._planner.tried, self.place
        references = []
        for place, (mean, count) in sorted(self._references.items()):
            node = self.at(place)
            if node is not None:
                references.append(Reference(place, node, cmath.phase(mean), count))
        return Memory(
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
        self._references.clear()
        self._learned.clear()
        self._places = Places()
        self._planner = Planner(self.rules, self._places)
        self.plans, self.gaps, self.obstacle = [], [], {}
        self._looked = None
        self._awaited = {}

    def enter(self, memory: Memory) -> None:
        """Take a place over."""
        self.leave()
        me = self.place = memory.place
        for each in memory.references:
            self._references[each.place] = cmath.rect(1.0, each.direction_rad), each.count
        self._places.walls[me] = list(memory.walls)
        tried = self._planner.tried
        tried.closed = dict.fromkeys(memory.closed)
        tried.failed = dict.fromkeys((key, me) for key in memory.failed)
        tried.attempts = dict(memory.attempts)
        tried.blocked[me] = list(memory.blocked)


def _elsewhere(state: State) -> State:
    return msgspec.structs.replace(state, place=NOWHERE)


def _other(key: tuple[int, ...], me: int) -> int:
    return key[1] if key[0] == me else key[0]
