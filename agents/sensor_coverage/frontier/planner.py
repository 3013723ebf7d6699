"""Where to expand: which edges are frontier and which obstacle, and who could move where.

The decisions of Ramaithitima et al. 2015, section III-A, on what robots reported; what was tried and failed is remembered
by place and side. A planner moves nobody.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Annotated, Final

from msgspec import Meta, Struct

from zwerm.agents.sensor_coverage.frontier.attempt_log import AttemptLog
from zwerm.agents.sensor_coverage.frontier.fence import SIXTY_RAD, Fence, Side, fence, wedges
from zwerm.agents.sensor_coverage.frontier.holes import holes, is_bare, sides
from zwerm.agents.sensor_coverage.frontier.services import Plan, ScanResult
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.maths.simplicial import Edge, FlagComplex, edge

# Which ways a robot with a wide gap in what it sees may go, off the middle of the gap, and how far beside its neighbours.
VERTEX_TURNS_RAD: Final = tuple(math.radians(each) for each in (0, 60, -60, 30, -30))
# The same for the end of a single file, which has but this chance; it is told by a gap wider than END_RAD.
END_TURNS_RAD: Final = tuple(math.radians(each) for each in (0, 30, -30, 60, -60, 90, -90))
END_RAD: Final = math.radians(285.0)
VERTEX_BESIDE_RAD: Final = math.radians(75.0)
# What tells keys of bridges and last attempts from those of gaps, whose turns are numbered.
BRIDGE: Final = 100
LAST: Final = 200
# A drive that a wall stopped says that much about the directions beside it.
BLOCKED_RAD: Final = math.radians(20.0)


Length = Annotated[float, Meta(gt=0.0, le=1000.0)]
Count = Annotated[int, Meta(ge=1)]


class PlannerParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """What a scenario may set. `link_m` and `margin_m` are the robots'; nothing is over before `watch_until_s`."""

    link_m: Length = 1.0
    margin_m: Length = 0.05
    clear_m: Length = 0.8
    clear_vertex_m: Length = 0.9
    clear_end_m: Length = 0.6
    near_wall_m: Length = 0.3
    obstacle_cost: Annotated[float, Meta(ge=1.0, le=1000.0)] = 3.0
    corner_margin_rad: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.15
    redundancy_every: Annotated[int, Meta(ge=0)] = 10
    attempts_max: Count = 2
    pushes_max: Count = 100
    survey_ticks_max: Count = 80
    drive_ticks_max: Count = 300
    cycles_max: Count = 2000
    watch_until_s: Annotated[float, Meta(ge=0.0)] = 0.0

    def __post_init__(self) -> None:
        """Refuse a margin that leaves no link."""
        if self.margin_m >= self.link_m:
            raise ValueError("expected margin_m < link_m")


class Planner:
    """The frontier by the rules of the paper, over `places`."""

    def __init__(self, rules: PlannerParameters, places: Slots) -> None:
        self.tried = AttemptLog(rules.attempts_max, rules.near_wall_m, places.blocked)
        self.fence = Fence((), ())
        self.frontier: tuple[Edge, ...] = ()
        self.obstacle: tuple[Edge, ...] = ()
        self._rules = rules
        self._places = places
        self._views, self._complex, self._bases = ScanResult({}, FlagComplex({}), ())
        self._plans: list[Plan] = []

    def look(self, picture: ScanResult, edges: Iterable[Edge] | None = None) -> None:
        """Take what the places see now, and find the fence, or what `edges` have of it."""
        self._views, self._complex, self._bases = picture
        found = self.fence = fence(self._views, self._complex, self._rules.corner_margin_rad, edges)
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
        """Yield the deployments there could be; edges first, since a robot between two others covers more."""
        yield [*self._bridges(), *self._plans]
        yield list(self._vertex_plans())
        into_holes = list(self._hole_plans())
        self.frontier = self.frontier or tuple(sorted({edge(*each.key[:2]) for each in into_holes}))
        yield into_holes
        yield list(self._last_plans())

    def note_attempt(self, plan: Plan) -> None:
        """Take note that a plan is being tried."""
        self.tried.note_attempt(plan)

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Take note that a wall was in the way after so far."""
        self.tried.note_failure(plan, driven_m)

    def rim(self) -> tuple[Edge, ...]:
        """Return the fence and the edges of all wedges: with those, it is closed."""
        fenced: dict[Edge, None] = dict.fromkeys((*self.fence.corners, *(side.edge for side in self.fence.sides)))
        for i, a, b, _ in wedges(self._views, self._complex):
            fenced[edge(i, a)] = fenced[edge(i, b)] = None
        return tuple(fenced)

    def _bridges(self) -> Iterator[Plan]:
        """Yield the ways to places that were in sight once, and are in another piece of the complex now."""
        pieces = self._complex.components()
        piece = {place: number for number, each in enumerate(pieces) for place in each}
        for mover in self._complex.vertices if len(pieces) > 1 else ():
            for other, direction in self._places.known_from(mover):
                key = (mover, other, 0, BRIDGE)
                elsewhere = other in piece and piece[other] != piece[mover]  # who has left the complex is in no piece
                if mover not in self._bases and elsewhere and key not in self.tried.closed:
                    hop, clear = self._rules.link_m - self._rules.margin_m, self._rules.near_wall_m
                    yield Plan(key, mover, direction, hop, clear, (mover,))

    def _hole_plans(self) -> Iterator[Plan]:
        """Yield the ways into holes in which nobody met anything: a corner is no wall, nor is an attempt without one."""
        for hole in holes(self._views, self._complex):
            if is_bare(hole, self._views, self._complex, self._met):
                for side in sides(hole):
                    yield from self._edge_plans(side, (side.i, side.j, side.sign, len(hole)), wary=False)

    def _met(self, place: int) -> Iterator[float]:
        yield from self._places.walls.get(place, ())
        yield from self.tried.blocked.get(place, ())

    def _edge_plans(self, side: Side, key: tuple[int, ...], wary: bool = True) -> list[Plan]:
        """Return the ways to expand one side of an edge; none if it is an obstacle edge. Section III-A, i to iv.

        `wary`: a wall beside the way will do to stay.
        """
        if key in self.tried.closed:
            return []
        hop = self._rules.link_m - self._rules.margin_m
        plans = []
        for mover, other, sign, near, far in (
            (side.i, side.j, side.sign, side.angle_i_rad, side.angle_j_rad),
            (side.j, side.i, -side.sign, side.angle_j_rad, side.angle_i_rad),
        ):
            if mover in self._bases:
                continue
            towards = self._places.direction(mover, other)
            if towards is None:
                towards = self._views[mover][other]
            angle, length = near, hop
            anchors: tuple[int, ...] = (mover, other)
            if far < near - 1e-9:  # bisected at the other end: keep that end's angle and distance
                angle, length, anchors = math.pi / 2.0 - far / 2.0, 2.0 * hop * math.sin(far / 2.0), (other,)
            elif near < SIXTY_RAD - 1e-9:
                anchors = (mover,)
            direction = towards + sign * angle
            if (key, mover) in self.tried.failed:
                continue
            if wary and self._walled(mover, self._views[mover][other] + sign * near):
                continue
            clear = min(self._rules.clear_m, 0.85 * length)
            plans.append(Plan(key, mover, direction, length, clear, anchors))
        return plans

    def _vertex_plans(self) -> Iterable[Plan]:
        """Yield the ways on for robots with a wide gap in what they see: single files, and doors."""
        hop = self._rules.link_m - self._rules.margin_m
        movers = [each for each in self._complex.vertices if each not in self._bases]
        for i, a, _, gap in wedges(self._views, self._complex, movers):
            end = gap > END_RAD
            for number, turn in enumerate(END_TURNS_RAD if end else VERTEX_TURNS_RAD):
                # The bisector first; aside only as far as the gap is wide.
                direction = self._views[i][a] + gap / 2.0 + turn
                key = (i, a, 0, number)
                if gap / 2.0 - abs(turn) < VERTEX_BESIDE_RAD or key in self.tried.closed or self._walled(i, direction):
                    continue
                if any(_apart(each, direction) < BLOCKED_RAD for each in self.tried.blocked.get(i, ())):
                    continue
                yield Plan(key, i, direction, hop, self._rules.clear_vertex_m, (i,))

    def _last_plans(self) -> Iterator[Plan]:
        """Yield what is left where nothing else is: ways on from stations, and around corners from ends of single files."""
        hop = self._rules.link_m - self._rules.margin_m
        for i, a, _, gap in wedges(self._views, self._complex):
            station = i in self._bases
            if not station and len(self._complex.neighbours[i]) > 1:
                continue
            clear = self._rules.clear_vertex_m if station else self._rules.clear_end_m
            for number, turn in enumerate(END_TURNS_RAD):
                direction = self._views[i][a] + gap / 2.0 + turn
                key = (i, a, 0, LAST + number)
                beside = gap / 2.0 - abs(turn) < VERTEX_BESIDE_RAD
                if not beside and key not in self.tried.closed and not self._walled(i, direction):
                    yield Plan(key, i, direction, hop, clear, (i,))

    def _walled(self, place: int, direction: float) -> bool:
        return any(_apart(each, direction) < SIXTY_RAD for each in self._places.walls.get(place, ()))


def _apart(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))
