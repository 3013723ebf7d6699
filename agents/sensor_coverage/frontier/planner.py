"""The frontier planner: which edges are frontier or obstacle, and which robot could drive where.

Section III-A of Ramaithitima et al. 2015, on the bearings that robots reported. Failed attempts are remembered by slot
and side. The planner moves no robot.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Final

from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.frontier.decisions import CoverageProof
from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.frontier.fence import SIXTY_RAD, VERTEX_BESIDE_RAD, Fence, Side, fence, wedges
from zwerm.agents.sensor_coverage.frontier.holes import holes, is_bare, sides
from zwerm.agents.sensor_coverage.frontier.plan import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_plans import WallPlans
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, overlap
from zwerm.maths.simplicial import Edge, FlagComplex, edge

# Directions to try into a wide gap around one robot, as offsets from the bisector of the gap.
VERTEX_TURNS_RAD: Final = tuple(math.radians(each) for each in (0, 60, -60, 30, -30))
# The same for the end of a single file of robots, whose gap is wider than END_RAD. It has more offsets, because no
# other robot can expand there.
END_TURNS_RAD: Final = tuple(math.radians(each) for each in (0, 30, -30, 60, -60, 90, -90))
END_RAD: Final = math.radians(285.0)
# Last element of the keys of bridges and of last attempts. Keys of gaps end with the number of the offset, which is
# smaller; those of ends of single files are counted from END_FIRST, because they name other directions.
END_FIRST: Final = 20
BRIDGE: Final = 100
LAST: Final = 200
# A drive that a wall stopped also rules out directions within this angle.
BLOCKED_RAD: Final = math.radians(20.0)
# Where walls are followed, a robot stays beside an edge only if it has driven this fraction of its hop: a followed wall needs
# no robot between it and the lattice.
WHOLE_HOP: Final = 0.98

# A scan, the edges to consider, and the open arcs, as `Planner.update` takes them.
_Update = tuple[ScanResult, Iterable[Edge] | None, Mapping[int, Sequence[Arc]] | None]
_NOTHING: Final = ScanResult({}, FlagComplex({}), ())


class Planner:
    """The frontier service by the rules of the paper, on the memory in `slots`."""

    def __init__(self, parameters: PlannerParameters, slots: Slots, proof: CoverageProof | None = None) -> None:
        """`proof` is that of all slots, with a coordinator. Without one each robot has the proof of its own slot."""
        self.attempt_log = AttemptLog(parameters.attempts_max, parameters.near_wall_m, slots.blocked)
        self.fence = Fence((), ())
        self.frontier: tuple[Edge, ...] = ()
        self.obstacle: tuple[Edge, ...] = ()
        self._parameters = parameters
        self.walls = WallPlans(parameters, slots, proof)
        self._slots = slots
        self._follows_walls = parameters.walls == "followed"
        self._open: Mapping[int, Sequence[Arc]] | None = None  # the open arcs of all slots, once walls were followed
        self._latest: _Update = (_NOTHING, None, None)  # what the latest plans were made of
        self._views, self._complex, self._bases = _NOTHING
        self._plans: list[Plan] = []

    def update(
        self,
        scan: ScanResult,
        edges: Iterable[Edge] | None = None,
        open_arcs: Mapping[int, Sequence[Arc]] | None = None,
    ) -> None:
        """Take a new scan, and find the fence, or the part of it on `edges`. Algorithm 3.

        `open_arcs` has those of the slots that are known without a coordinator, once walls were followed there.
        """
        self._latest = scan, edges, open_arcs
        self._views, self._complex, self._bases = scan
        knows_all = self._follows_walls and edges is None
        self._open = self.walls.open_arcs(scan) if knows_all and self._slots.walks else open_arcs
        found = self.fence = fence(self._views, self._complex, self._parameters.corner_margin_rad, edges)
        obstacle = dict.fromkeys(found.corners)
        self._plans = []
        for side in found.sides:
            options = self._edge_plans(side, (side.i, side.j, side.sign))
            if not options:
                obstacle[side.edge] = None
            self._plans += options
        self.obstacle = tuple(sorted(obstacle))
        self.frontier = tuple(sorted({edge(*each.key[:2]) for each in self._plans}))

    def plans(self) -> Iterator[list[Plan]]:
        """Yield groups of possible deployments by falling priority.

        Edges come first, because a robot between two others covers more than a robot at a gap.
        """
        yield [*self._bridges(), *self._plans]
        yield list(self._vertex_plans())
        into_holes = list(self._hole_plans())
        self.frontier = self.frontier or tuple(sorted({edge(*each.key[:2]) for each in into_holes}))
        yield into_holes
        yield list(self._last_plans())
        if self._follows_walls:
            along_walls = list(self.walls.plans(ScanResult(self._views, self._complex, self._bases)))
            self.frontier = self.frontier or tuple(sorted({edge(*each.key[:2]) for each in along_walls}))
            yield along_walls

    def next_plan(self, failed: Plan) -> Plan | None:
        """Return the plan to carry out at once after one of this slot that a wall stopped, by the latest scan, or None.

        It leads into the same gap, or beside the same edge: for another edge, a neighbour may have a better plan.
        """
        self.update(*self._latest)
        edges, gaps = islice(self.plans(), 2)
        same = [each for each in (edges if failed.key[2] else gaps) if each.key[:2] == failed.key[:2]]
        return min(same, key=lambda each: each.key, default=None)

    def note_attempt(self, plan: Plan) -> None:
        """Record that a plan is tried."""
        if plan.walk:
            self.walls.note_attempt(plan)
        else:
            self.attempt_log.note_attempt(plan.key)

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Record that a wall stopped the plan's mover after `driven_m`."""
        self.attempt_log.note_failure(plan.key, plan.mover, plan.direction, driven_m)

    def boundary_edges(self) -> tuple[Edge, ...]:
        """Return the fence and the edges of all wedges; together they contain a closed chain."""
        fenced: dict[Edge, None] = dict.fromkeys((*self.fence.corners, *(side.edge for side in self.fence.sides)))
        for i, a, b, _ in wedges(self._views, self._complex):
            fenced[edge(i, a)] = fenced[edge(i, b)] = None
        return tuple(fenced)

    # --- possible deployments, by falling priority -------------------------------------------------------------------

    def _edge_plans(self, side: Side, key: tuple[int, ...], walls_matter: bool = True) -> list[Plan]:
        """Return the plans to expand one side of an edge; none if it is an obstacle edge. Section III-A, i to iv.

        With `walls_matter` a wall beside the direction excludes a mover, and a side that is proved to be closed the edge.
        """
        if key in self.attempt_log.closed:
            return []
        hop = self._parameters.hop_m
        ends = (
            (side.i, side.j, side.sign, side.angle_i_rad, side.angle_j_rad),
            (side.j, side.i, -side.sign, side.angle_j_rad, side.angle_i_rad),
        )
        if walls_matter and not any(
            self._is_open(slot, self._views[slot][other], sign * near) for slot, other, sign, near, _ in ends
        ):
            return []
        plans = []
        for mover, other, sign, near, far in ends:
            if mover in self._bases:
                continue
            towards = self._slots.direction(mover, other)
            if towards is None:
                towards = self._views[mover][other]
            angle, length = near, hop
            anchors: tuple[int, ...] = (mover, other)
            if far < near - 1e-9:  # the other end has the bisected angle: keep its angle and its distance
                angle, length, anchors = math.pi / 2.0 - far / 2.0, 2.0 * hop * math.sin(far / 2.0), (other,)
            elif near < SIXTY_RAD - 1e-9:
                anchors = (mover,)
            direction = towards + sign * angle
            if (key, mover) in self.attempt_log.failed:
                continue
            if walls_matter and self._walled(mover, self._views[mover][other] + sign * near):
                continue
            clear = min(self._parameters.clear_m, 0.85 * length)
            if self._follows_walls:
                clear = WHOLE_HOP * length
            plans.append(Plan(key, mover, direction, length, clear, anchors))
        return plans

    def _bridges(self) -> Iterator[Plan]:
        """Yield plans towards slots that were visible once and are in another component of the complex now."""
        pieces = self._complex.components()
        piece = {slot: number for number, each in enumerate(pieces) for slot in each}
        for mover in self._complex.vertices if len(pieces) > 1 else ():
            for other, direction in self._slots.known_from(mover):
                key = (mover, other, 0, BRIDGE)
                elsewhere = other in piece and piece[other] != piece[mover]  # a robot that left is in no component
                if mover not in self._bases and elsewhere and key not in self.attempt_log.closed:
                    yield Plan(key, mover, direction, self._parameters.hop_m, self._parameters.near_wall_m, (mover,))

    def _vertex_plans(self) -> Iterable[Plan]:
        """Yield plans for robots with a wide gap between neighbours: ends of single files, and doors."""
        hop = self._parameters.hop_m
        movers = [each for each in self._complex.vertices if each not in self._bases]
        for i, a, _, gap in wedges(self._views, self._complex, movers):
            end = gap > END_RAD
            for number, turn in enumerate(END_TURNS_RAD if end else VERTEX_TURNS_RAD):
                direction = self._views[i][a] + gap / 2.0 + turn
                key = (i, a, 0, END_FIRST + number if end else number)
                narrow = gap / 2.0 - abs(turn) < VERTEX_BESIDE_RAD
                if narrow or key in self.attempt_log.closed or self._is_shut(i, direction):
                    continue
                if any(angle_between(each, direction) < BLOCKED_RAD for each in self.attempt_log.blocked.get(i, ())):
                    continue
                yield Plan(key, i, direction, hop, self._parameters.clear_vertex_m, (i,))

    def _hole_plans(self) -> Iterator[Plan]:
        """Yield plans into holes in which no robot met an obstacle. A corner or a failed attempt is no obstacle."""
        for hole in holes(self._views, self._complex):
            if is_bare(hole, self._views, self._complex, self._met):
                for side in sides(hole):
                    yield from self._edge_plans(side, (side.i, side.j, side.sign, len(hole)), walls_matter=False)

    def _last_plans(self) -> Iterator[Plan]:
        """Yield plans of the lowest priority: from stations, and around corners from the ends of single files."""
        hop = self._parameters.hop_m
        for i, a, _, gap in wedges(self._views, self._complex):
            station = i in self._bases
            if not station and len(self._complex.neighbours[i]) > 1:
                continue
            clear = self._parameters.clear_vertex_m if station else self._parameters.clear_end_m
            for number, turn in enumerate(END_TURNS_RAD):
                direction = self._views[i][a] + gap / 2.0 + turn
                key = (i, a, 0, LAST + number)
                narrow = gap / 2.0 - abs(turn) < VERTEX_BESIDE_RAD
                if not narrow and key not in self.attempt_log.closed and not self._is_shut(i, direction):
                    yield Plan(key, i, direction, hop, clear, (i,))

    # --- obstacles ----------------------------------------------------------------------------------------------------

    def _met(self, slot: int) -> Iterator[float]:
        """Yield the directions in which the robot at a slot touched a wall or was stopped by one."""
        yield from self._slots.walls.get(slot, ())
        yield from self.attempt_log.blocked.get(slot, ())

    def _walled(self, slot: int, direction: float) -> bool:
        return any(angle_between(each, direction) < SIXTY_RAD for each in self._slots.walls.get(slot, ()))

    def _is_shut(self, slot: int, direction: float) -> bool:
        """Return whether a wall is beside a direction [rad], or what is around it is proved to be closed."""
        return self._walled(slot, direction) or not self._is_open(slot, direction - BLOCKED_RAD, 2.0 * BLOCKED_RAD)

    def _is_open(self, slot: int, direction: float, turn_rad: float) -> bool:
        """Return whether some direction [rad] between this one and `turn_rad` to its left is not proved to be closed."""
        if self._open is None:
            return True
        sector = Arc(direction + min(turn_rad, 0.0), abs(turn_rad))
        return any(overlap(sector, each) > 0.0 for each in self._open.get(slot, ()))
