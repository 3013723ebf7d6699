"""One robot's work: travel along known ways, find a slice of a corridor, sweep it, and hunt for critical points.

The work is written as generators: each yields a manoeuvre, or None to wait a tick, and is resumed when the manoeuvre is done.
They add their findings to the map, and keep `at`, the end where the robot stands.
"""

from collections.abc import Callable, Generator
from typing import Final, Protocol

from zwerm.agents.robot_teams.mapping.facts import LEFT, RIGHT, End, Fact, FrontierCut, SweptSegment
from zwerm.agents.robot_teams.mapping.slice_map import ACROSS, TOLERANCE_MM, SliceMap
from zwerm.agents.robot_teams.motion.manoeuvres import (
    Approach,
    BoundaryTrace,
    Manoeuvre,
    Parked,
    Seek,
    SliceGrid,
    SliceSweep,
)
from zwerm.agents.robot_teams.motion.senses import Senses
from zwerm.agents.robot_teams.protocols.team_messages import HUNTS, SWEEPS, TRAVELS, CorridorPlan

Activity = Generator[Manoeuvre | None, None, None]

# Largest number of steps of a journey or a hunt. Beyond it, the robot has lost its position in the map.
STEPS_MAX: Final = 400
# Largest number of steps of a journey that may lead elsewhere than the map says.
ASTRAY_MAX: Final = 3
# An end of the same slice that is nearer than this may be approached where no way leads to it [mm].
STRAIGHT_MM: Final = 1_500
# A robot farther than this from its end approaches it first [m].
AT_END_M: Final = 0.06


# A frontier nearer than this to where a sweep begins does not end it [mm].
CUT_MM: Final = 300


class NoRoute(Exception):
    """No known way leads to the end."""


class Lost(Exception):
    """A manoeuvre failed, or led elsewhere than the map says."""


class Mates(Protocol):
    """A robot's knowledge of its teammates in a corridor."""

    def slot(self, room: int | None) -> int:
        """Return the slice of the corridor that this robot takes, given the number of robots it found room for;
        negative for none."""

    def claimed(self, k: int) -> bool:
        """Return whether a teammate takes slice k in this corridor."""

    def sweeping(self, k: int) -> bool:
        """Return whether another robot is sweeping slice k now."""

    def awaits_predecessor(self) -> bool:
        """Return whether the predecessor has not swept its slice yet."""


class Work:
    """The activity and the place of one robot. `sense` returns its newest senses."""

    def __init__(
        self, slice_map: SliceMap, grid: SliceGrid, step_m: float, sense: Callable[[], Senses], parked: Parked
    ) -> None:
        self.map = slice_map
        self.at: End | None = None
        self.phase = TRAVELS
        self.found = False
        self.spare = False
        self.claim: int | None = None
        self.room: int | None = None
        self.sweeping: int | None = None
        self.failures = 0
        self.found_facts: list[Fact] = []
        self._uncertain: dict[tuple[End, int], End] = {}
        self._grid = grid
        self._step_m = step_m
        self._sense = sense
        self._parked = parked

    # --- finding a first end ------------------------------------------------------------------------------------------

    def localise(self, side: int, swept_by_others: Callable[[int], bool]) -> Activity:
        """Find an end from anywhere: go to a slice and along it to its end on `side`; sweep it if it is new."""
        self.at = self.sweeping = None
        seek = Seek(self._grid)
        yield seek
        self.sweeping = seek.slice
        up = SliceSweep(seek.slice, side, self._grid, self._step_m, self._parked)
        yield up
        if up.end is None:
            raise Lost
        known = self.map.end(up.end)
        if known is not None:
            self.at, self.sweeping = known, None
            return
        # The formation's first corridor: join the own end to the predecessor's, come back, and sweep.
        start = self.at = up.end
        if not self.map.arcs_known and (yield from self.trace(LEFT)):
            yield from self.travel(start)
        yield from self.sweep()
        yield from self._hunt(up.slice, RIGHT, swept_by_others)

    def link(self, direction: int, swept_by_others: Callable[[int], bool]) -> Activity:
        """Walk back to the predecessor's slice. This joins the maps of robots that began apart."""
        self.found = self.spare = False
        self.phase = HUNTS
        at = self.at
        if at is None:
            raise Lost
        yield from self._hunt(at.slice, direction, swept_by_others)

    # --- single steps -------------------------------------------------------------------------------------------------

    def sweep(self, frontier_mm: int | None = None) -> Activity:
        """Sweep the slice from the end where the robot is to the other end, or to a virtual frontier in between."""
        start = self.at
        if start is None:
            raise Lost
        yield from self._approach(start)
        ahead = frontier_mm is not None and (start.y_mm - frontier_mm) * start.side > CUT_MM
        limit_mm = frontier_mm if ahead else None
        sweep = SliceSweep(start.slice, -start.side, self._grid, self._step_m, self._parked, limit_mm)
        self.sweeping = start.slice
        yield sweep
        self.sweeping = None
        end = sweep.end
        if end is None:
            raise Lost
        low, high = sorted((start.y_mm, end.y_mm))
        if self._is_new(start, 0, end, bool(sweep.wrecks)):
            self._note(SweptSegment(start.slice, low, high, tuple(sweep.wrecks)))
            if sweep.is_cut:
                self._note(FrontierCut(end.slice, end.y_mm))
        self.at = self.map.end(end)

    def trace(self, direction: int) -> Generator[Manoeuvre | None, None, bool]:
        """Follow the boundary from the end where the robot is to the next; return whether that is on another slice."""
        start = self.at
        if start is None:
            raise Lost
        senses = self._sense()
        depth = (senses.x_m - self._grid.x_m(start.slice)) * direction
        if abs(depth) > 0.6 or abs(senses.y_m - start.y_mm / 1000.0) > 0.6:
            yield from self._approach(start)
        trace = BoundaryTrace(start, direction, self._grid, self._parked)
        yield trace
        arc, end = trace.arc, trace.end
        if end is None:
            raise Lost
        # If a robot hid the end there is no fact: the arc stays open, and the robot goes on if the end is known. An arc that is
        # not certain becomes a fact when it is traced again to the same end: a robot that stands there may stay for ever.
        if arc is not None and self._is_new(start, direction, end, bool(arc.wrecks)):
            before = self._uncertain.pop((start, direction), None)
            if trace.certain or (before is not None and _is_same(before, end)):
                self._note(arc)
            else:
                self._uncertain[start, direction] = end
        self.at = self.map.end(end)
        if self.at is None:
            raise Lost
        return end.slice != start.slice

    def travel(self, stop: End) -> Activity:
        """Go to a known end by the shortest known way, without the steps that led elsewhere before.

        If a wall is almost parallel to a slice, robots measure its end far apart, and there may be no way to one of
        these ends. The robot then goes straight to an end near by on the same slice.
        """
        astray: dict[tuple[End, int], None] = {}
        for _ in range(STEPS_MAX):
            start = self.here
            goal = self.map.end(stop)
            if start is None or goal is None:
                raise Lost
            self.at = start
            if start == goal:
                return
            route = self.map.route(start, goal, astray) if len(astray) <= ASTRAY_MAX else None
            if route is None:
                yield from self._go_straight(start, goal)
                return
            step = route[0][1]
            if step.direction == ACROSS:
                self.at = step.stop
            elif step.direction == 0:
                yield from self.sweep(step.stop.y_mm if self.map.is_virtual(step.stop) else None)
            else:
                yield from self.trace(step.direction)
            if self.here != self.map.end(step.stop):
                astray[start, step.direction] = None
        raise NoRoute

    def _go_straight(self, start: End, goal: End) -> Activity:
        if start.slice != goal.slice or abs(start.y_mm - goal.y_mm) > STRAIGHT_MM:
            raise NoRoute
        yield from self._go_to(goal)
        self.at = goal

    def _is_new(self, start: End, direction: int, stop: End, beside_wreck: bool) -> bool:
        """Return whether no such way is known, or, beside a wreck, none that leads to `stop`."""
        known = self.map.end(start)
        if known is None:
            return True
        way = self.map.arc(known, direction) if direction else self.map.mate(known)
        found = self.map.end(stop)
        differs = way is not None and way.stop != found and (beside_wreck or self.map.is_virtual(way.stop))
        return way is None or (not direction and found is None) or differs

    def _note(self, fact: Fact) -> None:
        if self.map.add(fact):
            self.found_facts.append(fact)

    @property
    def here(self) -> End | None:
        """The known end at which the robot stands, or from which it set out; None if its position in the map is lost."""
        return None if self.at is None else self.map.end(self.at)

    def _approach(self, end: End) -> Activity:
        senses = self._sense()
        dx, dy = senses.x_m - self._grid.x_m(end.slice), senses.y_m - end.y_mm / 1000.0
        if dx * dx + dy * dy > AT_END_M**2:
            yield from self._go_to(end)

    def _go_to(self, end: End) -> Activity:
        approach = Approach(end, self._grid, self._parked)
        yield approach
        if approach.hidden:
            raise Lost

    def approach_again(self) -> Activity:
        """Go back to the end where the robot last was: a wreck that was found since may divide the two."""
        at = self.here
        if at is None:
            raise Lost
        yield from self._go_to(at)
        yield None

    # --- a corridor ---------------------------------------------------------------------------------------------------

    def corridor(self, plan: CorridorPlan, mates: "Mates") -> Activity:
        """Take a slice of a corridor, sweep it, and hunt back to the predecessor's slice."""
        self.found = self.spare = False
        self.claim = self.room = None
        self.phase = TRAVELS
        try:
            yield from self.travel(plan.anchor)
        except NoRoute:
            self.spare = True
            return
        if not (yield from self._take_slot(plan, mates)):
            self.spare = True
            return
        mine = self.at
        if mine is None:
            raise Lost
        self.phase, self.claim = SWEEPS, mine.slice
        if self.map.mate(mine) is None:
            yield from self.sweep(plan.frontier_mm)
        self.phase = HUNTS
        while mates.awaits_predecessor():
            yield None
        yield from self._hunt(mine.slice, plan.direction, mates.sweeping, plan.frontier_mm)

    def _take_slot(self, plan: CorridorPlan, mates: "Mates") -> Generator[Manoeuvre | None, None, bool]:
        """Trace forward, one slice a robot; return whether there is a slice for this one.

        The robot that finds no more room reports the number of robots with room. Then the robots in front take these slices.
        """
        at = self.at
        if at is None:
            raise Lost
        ends = [at] if plan.own_slice else []
        while True:
            wanted = mates.slot(self.room)
            if wanted < 0:
                return False
            if wanted < len(ends):
                if self.at != ends[wanted]:
                    try:
                        yield from self.travel(ends[wanted])
                    except NoRoute:
                        return False
                return True
            passes = yield from self.trace(plan.direction)
            at = self.at
            if at is None:
                raise Lost
            if not passes or (self.map.mate(at) is not None and not mates.claimed(at.slice)):
                self.room = len(ends)
            else:
                ends.append(at)

    def _hunt(
        self, k: int, direction: int, swept_by_others: Callable[[int], bool], frontier_mm: int | None = None
    ) -> Activity:
        """Walk round the slab behind slice k, and sweep new segments, until the reached end is swept.

        Fig. 4 (i) and (ii) of the paper are both this loop.
        """
        for _ in range(STEPS_MAX):
            at = self.at
            if at is None:
                raise Lost
            into = -direction if at.slice == k else direction
            if self.map.arc(at, into) is not None or self.map.is_virtual(at):
                return
            yield from self.trace(into)
            at = self.at
            if at is None:
                raise Lost
            while self.map.mate(at) is None and swept_by_others(at.slice):
                yield None
                at = self.map.end(at) or at
            self.at = at
            if self.map.mate(at) is not None:
                return
            if at.slice == k:
                self.found = True
            yield from self.sweep(frontier_mm)
        raise Lost


def _is_same(one: End, other: End) -> bool:
    return (one.slice, one.side) == (other.slice, other.side) and abs(one.y_mm - other.y_mm) <= TOLERANCE_MM
