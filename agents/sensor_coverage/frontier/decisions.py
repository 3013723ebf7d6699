"""Decisions of a deployment, one interface each: frontier, path, redundancy, assignment, termination.

A central algorithm or an agreement among robots implements an interface, and the caller does not know which. All
interfaces refer to slots, and none of them moves a robot.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.frontier.fence import Fence
from zwerm.agents.sensor_coverage.frontier.paths import CheapestRoutes
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import FollowedStretch
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc, Walk, WallStep
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import NearWalls
from zwerm.agents.sensor_coverage.messages.pushes import LostSight, ProvedArc
from zwerm.maths.simplicial import Edge, FlagComplex

# Returns the cheapest routes from sources (slot: cost to start there) through a complex.
FindRoutes = Callable[[FlagComplex, Mapping[int, float]], CheapestRoutes]


class CoverageProof(Protocol):
    """Finds the open arcs of all slots where walls are followed."""

    def update(
        self,
        scan: ScanResult,
        walks: Sequence[Walk],
        touched: Mapping[int, Sequence[float]],
        near: Mapping[int, Sequence[NearArc]],
        in_touch: Mapping[int, Collection[int]],
        stays: Mapping[int, int],
        touched_by: Mapping[tuple[int, int], Sequence[float]],
    ) -> tuple[int, ...]:
        """Take in a scan, all walks, and by slot the directions [rad] of walls in touch and the arcs of walls close to it.

        `in_touch` has the slots whose robots are in touch, and `stays` the numbers of the robots' stays by slot.
        `touched_by` has the directions of walls in touch of all stays, by slot and number.

        Return the slots around which points of walks count no more, because a slot that saw them is gone.
        """

    def open_arcs(self) -> dict[int, list[Arc]]:
        """Return the arcs in which each slot is open, without the slots that are open in none."""


class SlotCoverageProof(Protocol):
    """Finds the open arcs of one slot, for the robot there, where walls are followed.

    `around` has the directions [rad] of the slots that share an edge with it. `for_neighbours` has (neighbouring slot, arc
    there) of what this slot proves for it.
    """

    around: Mapping[int, float]
    for_neighbours: list[tuple[int, ProvedArc]]

    @property
    def ready(self) -> bool:
        """True once the proof has a view of its slot."""

    @property
    def knows_walks(self) -> bool:
        """True once walks have closed an arc of the slot."""

    def update(self, slot: int, scan: ScanResult, touched: Iterable[float], in_touch: Collection[int] = ()) -> None:
        """Take in the slot's view and the complex around it, the directions [rad] of walls in touch, and the slots in touch."""

    def open_arcs(self) -> list[Arc]:
        """Return the arcs that nothing closes."""

    def pass_step(
        self,
        walk: int,
        earlier: WallStep | None,
        step: WallStep,
        stretch: FollowedStretch | None,
        hidden: Sequence[tuple[int, ...]] = (),
    ) -> bool:
        """Take in a step of a walk whose end this slot sees, and the step before; return whether the open arcs are smaller.

        `hidden` has the slots that saw the walk where this slot did not, until now.
        """

    def lose_sight(self, walk: int, number: int, witnesses: Iterable[int]) -> None:
        """Record that this slot does not see the point of a walk with this number, and which slots see it."""

    def extend(self, walk: int, stretch: FollowedStretch) -> bool:
        """Take in how far a stretch of wall was followed; return whether this slot saw a part of it, and it is news."""

    def end_walk(self, walk: int, last_number: int = 0, end: int = NOWHERE) -> None:
        """Keep the arcs that a walk has closed, but not its steps: it is over. The walking robot stands at the slot `end`."""

    def accept(self, proved: ProvedArc) -> bool:
        """Take in an arc that a neighbour has proved; return whether the open arcs are smaller."""

    def lose(self, *slots: int) -> None:
        """Forget the arcs of walks that one of these slots saw: its robot has died or left, and no robot takes it over."""

    def add_near(self, walls: NearWalls) -> None:
        """Add walls close to the slot that were followed."""

    def memory(self) -> tuple[ProvedArc, ...]:
        """Return the arcs that walks closed, for the slot's next occupant."""

    def edges(self) -> tuple[LostSight, ...]:
        """Return the edges of sight, for the slot's next occupant."""

    def inherit(self, memory: Iterable[ProvedArc], edges: Iterable[LostSight] = ()) -> None:
        """Take over the arcs that walks closed, and the edges of sight, from the slot's former occupant."""


class WallService(Protocol):
    """Finds where a robot must follow a wall. `tried` has the directions [rad] of attempts by slot, `probed` of probes."""

    tried: dict[int, list[float]]
    probed: dict[int, list[float]]

    def probes_at(self, slot: int, arcs: Iterable[Arc]) -> list[Plan]:
        """Return a plan for each arc of a slot that was not probed yet: to follow a wall close by, and return."""

    def plans_at(self, slot: int, beside: Mapping[int, float], arcs: Iterable[Arc]) -> tuple[list[Plan], int]:
        """Return a plan for each open arc of a slot that has attempts left, and the number of arcs that have none."""

    def forget(self) -> None:
        """Forget all attempts and probes."""


class FrontierService(Protocol):
    """Finds where the swarm can expand, and remembers failed attempts."""

    attempt_log: AttemptLog
    fence: Fence

    @property
    def walls(self) -> WallService:
        """Where a robot must follow a wall."""

    @property
    def frontier(self) -> tuple[Edge, ...]:
        """Edges that can be expanded, in the latest scan."""

    @property
    def obstacle(self) -> tuple[Edge, ...]:
        """Edges beside obstacles, in the latest scan."""

    def update(
        self,
        scan: ScanResult,
        edges: Iterable[Edge] | None = None,
        open_arcs: Mapping[int, Sequence[Arc]] | None = None,
    ) -> None:
        """Take a new scan; consider only `edges` if they are given, with the open arcs of slots once walls were followed."""

    def plans(self) -> Iterable[Sequence[Plan]]:
        """Yield groups of possible deployments by falling priority; use a group only if no earlier one has a path."""

    def next_plan(self, failed: Plan) -> Plan | None:
        """Return the plan to carry out at once after one of this slot that a wall stopped, by the latest scan, or None."""

    def boundary_edges(self) -> tuple[Edge, ...]:
        """Return edges that contain a closed chain around all uncovered space."""

    def note_attempt(self, plan: Plan) -> None:
        """Record that a plan is tried."""

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Record that a wall stopped the plan's mover after `driven_m`."""


class PathService(Protocol):
    """Finds the routes along which robots push."""

    def routes(
        self,
        complex_: FlagComplex,
        sources: Mapping[int, float],
        obstacle: Collection[Edge],
        shut: Collection[int] = (),
    ) -> CheapestRoutes:
        """Return the cheapest routes from `sources` (slot: cost to start there); edges of `obstacle` cost more.

        A route may begin at a slot in `shut` but does not lead through one.
        """


class RedundancyService(Protocol):
    """Finds robots that coverage does not need."""

    def redundant(self, scan: ScanResult, boundary_edges: Collection[Edge]) -> tuple[int, ...]:
        """Return slots that can all be vacated together without uncovering anything."""


class AssignmentService(Protocol):
    """Chooses the deployments of one cycle."""

    def assign(
        self, plans: Iterable[Sequence[Plan]], scan: ScanResult, sources: Mapping[int, float], find_routes: FindRoutes
    ) -> tuple[Plan, ...]:
        """Return the plans to carry out concurrently, with their paths; an empty tuple if no plan has a path."""


class TerminationService(Protocol):
    """Decides when the deployment ends."""

    def judge(self, assigned: bool, frontier: bool) -> str:
        """Return the outcome, or an empty string while the deployment goes on.

        `assigned`: a deployment was found in this cycle. `frontier`: frontier edges are left.
        """


class Services(NamedTuple):
    """One implementation of each interface."""

    frontier: FrontierService
    paths: PathService
    redundancy: RedundancyService
    assignment: AssignmentService
    termination: TerminationService
