"""Where to expand: which edges are frontier and which obstacle, who moves where, by which path, and who can be spared.

The decisions of Ramaithitima et al. 2015, sections III-A, III-B and III-D, on what robots reported; what was tried and
failed is remembered by place and side. A planner moves nobody.
"""

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

from msgspec import Struct

from zwerm.frontier.fence import SIXTY_RAD, Fence, Side, Views, fence, wedges
from zwerm.frontier.paths import Reach, reach
from zwerm.frontier.places import Places
from zwerm.simplicial import Edge, FlagComplex, edge, sparing

BASE: Final = 0

# Which ways a robot with a wide gap in what it sees may go, off the middle of the gap, and how far beside its neighbours.
VERTEX_TURNS_RAD: Final = tuple(math.radians(each) for each in (0, 60, -60))
# The same for the end of a single file, which has but this chance; it is told by a gap wider than END_RAD.
END_TURNS_RAD: Final = tuple(math.radians(each) for each in (0, 30, -30, 60, -60, 90, -90))
END_RAD: Final = math.radians(285.0)
VERTEX_BESIDE_RAD: Final = math.radians(75.0)
# A drive that a wall stopped says that much about the directions beside it.
BLOCKED_RAD: Final = math.radians(20.0)


class Parameters(Struct, frozen=True, forbid_unknown_fields=True):
    """What a scenario may set. `link_m` and `margin_m` are the robots'."""

    link_m: float = 1.0
    margin_m: float = 0.05
    clear_m: float = 0.8
    clear_vertex_m: float = 0.9
    near_wall_m: float = 0.3
    obstacle_cost: float = 3.0
    corner_margin_rad: float = 0.15
    redundancy_every: int = 10
    attempts_max: int = 2
    survey_ticks_max: int = 60
    drive_ticks_max: int = 300
    cycles_max: int = 2000


class Plan(NamedTuple):
    """One deployment: the robot at `mover` goes along `direction`, and the robots on the path follow."""

    key: tuple[int, ...]
    mover: int
    direction: float
    hop_m: float
    clear_m: float
    anchors: tuple[int, ...]
    path: tuple[int, ...] = ()


class Planner:
    """Plans over `places`. `frontier` and `obstacle` are edges between places, as of the last plan."""

    def __init__(self, rules: Parameters, places: Places) -> None:
        self.fence = Fence((), ())
        self.frontier: tuple[Edge, ...] = ()
        self.obstacle: tuple[Edge, ...] = ()
        self.redundant: list[int] = []
        self.cut_off = False
        self._rules = rules
        self._places = places
        self._views: Views = {}
        self._complex = FlagComplex({})
        self._closed: dict[tuple[int, ...], None] = {}
        self._failed: dict[tuple[tuple[int, ...], int], None] = {}
        self._attempts: dict[tuple[int, ...], int] = {}
        self._blocked: dict[int, list[float]] = {}

    def look(self, views: Views, complex_: FlagComplex) -> None:
        """Take what the places see now."""
        self._views, self._complex = views, complex_

    def note_attempt(self, plan: Plan) -> None:
        """Take note that a plan is being tried; the same side is not tried for ever."""
        self._attempts[plan.key] = self._attempts.get(plan.key, 0) + 1
        if self._attempts[plan.key] >= self._rules.attempts_max:
            self._closed[plan.key] = None

    def note_failure(self, plan: Plan, driven_m: float) -> None:
        """Take note that a wall was in the way after so far.

        One failure closes an edge's side, unless it was so near to one end that it says nothing about the other.
        """
        elsewhere = any((plan.key, end) in self._failed for end in plan.key[:2] if end != plan.mover)
        if driven_m > self._rules.near_wall_m or plan.key[2] == 0 or elsewhere:
            self._closed[plan.key] = None
        self._failed[plan.key, plan.mover] = None
        self._blocked.setdefault(plan.mover, []).append(plan.direction)

    def plan(self, pushes: int) -> Plan | None:
        """Return the cheapest deployment there is; edges first, since a robot between two others covers more."""
        found = self.fence = fence(self._views, self._complex, self._rules.corner_margin_rad)
        obstacle = dict.fromkeys(found.corners)
        plans: list[Plan] = []
        for side in found.sides:
            options = self._edge_plans(side)
            if not options:
                obstacle[side.edge] = None
            plans += options
        self.obstacle = tuple(sorted(obstacle))
        self.frontier = tuple(sorted({edge(*each.key[:2]) for each in plans}))
        if pushes and self._rules.redundancy_every and pushes % self._rules.redundancy_every == 0:
            self.spare()
        self.redundant = [place for place in self.redundant if place in self._places.occupant]
        sources = dict.fromkeys(self.redundant, -100.0) if self.redundant else {}
        ways = reach(self._complex, {BASE: 0.0, **sources}, obstacle, self._rules.obstacle_cost)
        best = self._cheapest(plans, ways) or self._cheapest(self._vertex_plans(), ways)
        self.cut_off = best is None and bool(plans)
        return best

    def _cheapest(self, plans: Iterable[Plan], ways: Reach) -> Plan | None:
        open_plans = [(ways.cost[plan.mover], plan.mover, plan.key, plan) for plan in plans if plan.mover in ways.cost]
        if not open_plans:
            return None
        plan = min(open_plans)[-1]
        return plan._replace(path=ways.path(plan.mover))

    def _edge_plans(self, side: Side) -> list[Plan]:
        """Return the ways to expand one side of an edge; none if it is an obstacle edge. Section III-A, i to iv."""
        key = (side.i, side.j, side.sign)
        if key in self._closed:
            return []
        hop = self._rules.link_m - self._rules.margin_m
        plans = []
        for mover, other, sign, near, far in (
            (side.i, side.j, side.sign, side.angle_i_rad, side.angle_j_rad),
            (side.j, side.i, -side.sign, side.angle_j_rad, side.angle_i_rad),
        ):
            if mover == BASE:
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
            if (key, mover) in self._failed or self._walled(mover, self._views[mover][other] + sign * near):
                continue
            clear = min(self._rules.clear_m, 0.85 * length)
            plans.append(Plan(key, mover, direction, length, clear, anchors))
        return plans

    def _vertex_plans(self) -> Iterable[Plan]:
        """Yield the ways on for robots with a wide gap in what they see: single files, and doors."""
        hop = self._rules.link_m - self._rules.margin_m
        for i, a, _, gap in wedges(self._views, self._complex):
            if i == BASE:
                continue
            end = gap > END_RAD
            for turn in END_TURNS_RAD if end else VERTEX_TURNS_RAD:
                # The bisector first; aside only as far as the gap is wide.
                direction = self._views[i][a] + gap / 2.0 + turn
                key = (i, a, 0, round(math.degrees(turn)))
                if gap / 2.0 - abs(turn) < VERTEX_BESIDE_RAD or key in self._closed or self._walled(i, direction):
                    continue
                if any(
                    _apart(each, direction) < (BLOCKED_RAD if end else SIXTY_RAD / 2.0)
                    for each in self._blocked.get(i, ())
                ):
                    continue
                yield Plan(key, i, direction, hop, self._rules.clear_vertex_m, (i,))

    def _walled(self, place: int, direction: float) -> bool:
        return any(_apart(each, direction) < SIXTY_RAD for each in self._places.walls.get(place, ()))

    def spare(self) -> None:
        """Look for redundant robots; section III-D."""
        fenced: dict[Edge, None] = dict.fromkeys((*self.fence.corners, *(side.edge for side in self.fence.sides)))
        for i, a, b, _ in wedges(self._views, self._complex):
            fenced[edge(i, a)] = fenced[edge(i, b)] = None
        missed_max = 1 + len(self._complex.vertices) // 50
        self.redundant = list(sparing(self._complex, fenced, (BASE,), missed_max).redundant)


def _apart(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))
