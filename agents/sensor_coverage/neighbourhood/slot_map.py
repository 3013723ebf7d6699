"""The memory of one robot's slot, and how it passes from robot to robot."""

import cmath
from collections.abc import Callable
from typing import Final

from zwerm.agents.sensor_coverage.frontier.decisions import FrontierService
from zwerm.agents.sensor_coverage.frontier.directions import (
    Reference,
    add_wall,
    refined_reference,
    wrapped,
)
from zwerm.agents.sensor_coverage.frontier.plan import Plan
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE, Route
from zwerm.agents.sensor_coverage.messages.pushes import ReferenceBearing, SlotMemory
from zwerm.agents.sensor_coverage.neighbourhood.neighbour_table import NeighbourTable
from zwerm.agents.sensor_coverage.neighbourhood.slot_proof import SlotProof
from zwerm.agents.sensor_coverage.protocols.path_vector import PathVectorProtocol
from zwerm.maths.simplicial import Edge

# Cost of a route to a robot that does not know yet whether it is at the frontier. Other robots wait and do not push
# there.
DOUBT_COST: Final = 1_000.0

MakePlanner = Callable[[PlannerParameters, Slots], FrontierService]


class SlotMap(NeighbourTable):
    """One robot's slot: its references, walls, attempts and proof of coverage. `LocalMap` describes the other attributes."""

    def __init__(
        self, node: int, parameters: PlannerParameters, make_planner: MakePlanner, incarnation: int = 1
    ) -> None:
        super().__init__(node, incarnation)
        self.guests: tuple[int, ...] = ()
        self.parameters = parameters
        self.plans: list[Plan] = []
        self.gaps: list[Plan] = []
        self.wall_plans: list[Plan] = []
        self.unproven = 0
        self.proof = SlotProof()
        self.path_vectors = PathVectorProtocol()
        self.obstacle: dict[Edge, None] = {}
        self.obstructed = 0
        self._obstructed: dict[tuple[int, ...], int] = {}  # key of an attempt: the robot whose body stopped it
        self._finished: dict[int, None] = {}  # dead robots that claimed no frontier when they died
        self.plan_count = 0
        self._make_planner = make_planner
        self._references: dict[int, Reference] = {}
        self._learned: dict[int, tuple[int, ...]] = {}
        self._slots = Slots()
        self._planner = make_planner(parameters, self._slots)
        self._plan_basis: object = None
        self._led: tuple[int, int | None] | None = None  # (new slot, follower) of a push that failed

    # --- memory of the slot -------------------------------------------------------------------------------------------

    def learn_references(self) -> None:
        """Refine the reference directions to all slots whose robots see this robot too."""
        if self.heading is None or self.slot == NOWHERE:
            return
        for node, state in self.mutual().items():
            readings = self.epoch, self.samples, state.epoch, state.samples
            if self._learned.get(node) == readings:
                continue
            self._learned[node] = readings
            there, back = self.seen[node].bearing_rad + self.heading, self._back(node) or 0.0
            self._references[state.slot] = refined_reference(self._references.get(state.slot), there, back)

    def update_walls(self, bearings: tuple[float, ...]) -> None:
        """Remember the walls that this robot touches, by their bearings [rad]."""
        if self.heading is None or self.slot == NOWHERE:
            return
        walls = self._slots.walls.setdefault(self.slot, [])
        for bearing in bearings:
            if add_wall(walls, wrapped(bearing + self.heading)):
                self._plan_basis = None
                self.change()

    def memory(self) -> SlotMemory:
        """Return the memory of this slot, for its next occupant."""
        log, me = self._planner.attempt_log, self.slot
        references = []
        for slot, (mean, count) in sorted(self._references.items()):
            node = self.at(slot)
            if node is not None:
                references.append(ReferenceBearing(slot, node, cmath.phase(mean), count))
        return SlotMemory(
            me,
            tuple(references),
            tuple(self._slots.walls.get(me, ())),
            tuple(log.closed),
            tuple(key for key, slot in log.failed if slot == me),
            tuple(log.attempts.items()),
            tuple(log.blocked.get(me, ())),
            self.path_vectors.newest_claim(me),
            tuple(self._obstructed.items()),
            tuple(self._slots.felt.get(me, ())),
            tuple(self._planner.walls.tried.get(me, ())),
            self.proof.memory(),
        )

    def reopen(self) -> None:
        """Try again all that has failed: a robot is missing, and the obstacle of that time may be gone."""
        log = self._planner.attempt_log
        log.closed, log.failed, log.attempts = {}, {}, {}
        log.blocked.clear()
        self._planner.walls.tried.clear()
        self._obstructed = {}
        self.replan()

    def replan(self) -> None:
        """Make plans again, although neither the view nor a neighbour has changed."""
        self._plan_basis = None
        self.change()

    # --- robots that died or restarted --------------------------------------------------------------------------------

    def bury(self, node: int) -> None:
        """Forget a robot that is dead, and end the claims of its slot.

        Without it the gaps around this slot have other directions, so attempts at gaps do not count any more. The
        directions in which walls stopped drives remain.
        """
        slot = self._slot_of(node)
        if slot != NOWHERE and not self.states[node].moving and not self.path_vectors.is_claimed(slot):
            self._finished[node] = None
        self.path_vectors.forget(node, slot)
        log = self._planner.attempt_log
        for known in (log.closed, log.attempts):
            for key in [key for key in known if key[2] == 0]:
                del known[key]
        self._planner.walls.tried.clear()
        if node in self._obstructed.values():
            self.reopen()  # a drive that pushes its body finds out what is behind it
        self._plan_basis = None
        self.forget(node)

    def restarted(self, node: int) -> None:
        """Forget a robot that has lost its memory, and end the claims of its slot."""
        self.path_vectors.forget(node, self._slot_of(node))
        super().restarted(node)

    def _slot_of(self, node: int) -> int:
        state = self.states.get(node)
        return NOWHERE if state is None else state.slot

    # --- slots change hands -------------------------------------------------------------------------------------------

    def vacate(self) -> None:
        """Occupy no slot, and delete all that is known of the present one."""
        self.slot = NOWHERE
        self.redundant = False
        self._references.clear()
        self._learned.clear()
        self._slots = Slots()
        self._planner = self._make_planner(self.parameters, self._slots)
        self._drop_plans()
        self.proof = SlotProof()
        self._obstructed = {}
        self._plan_basis = None
        self._led = None
        self._handovers = {}
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
        for each in memory.references:
            self._references[each.slot] = cmath.rect(1.0, each.direction_rad), each.count
        self._slots.walls[me] = list(memory.walls)
        log = self._planner.attempt_log
        log.closed = dict.fromkeys(memory.closed)
        log.failed = dict.fromkeys((key, me) for key in memory.failed)
        log.attempts = dict(memory.attempts)
        log.blocked[me] = list(memory.blocked)
        self._obstructed = dict(memory.obstructed)
        self._slots.felt[me] = list(memory.felt)
        self._planner.walls.tried[me] = list(memory.explored)
        self.proof.inherit(memory.proved)

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
