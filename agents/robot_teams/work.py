"""One robot's work: to travel along what is known, to find its slice of a corridor, to sweep it, and to hunt for critical points.

The work is written as generators: each yields a manoeuvre, or None to wait a tick, and is resumed when the manoeuvre is done.
They add what they find to the map, and keep `at`, the end where the robot stands.
"""

from collections.abc import Callable, Generator
from typing import Final

from zwerm.agents.robot_teams.facts import TOP, Arc, End, Segment
from zwerm.agents.robot_teams.manoeuvres import Approach, Grid, Manoeuvre, Seek, Sweep, Trace
from zwerm.agents.robot_teams.messages import HUNTS, READY, SWEEPS, TRAVELS, Plan
from zwerm.agents.robot_teams.senses import Senses
from zwerm.agents.robot_teams.slice_map import SliceMap

Story = Generator[Manoeuvre | None, None, None]

# A journey or a hunt that takes more steps than this has lost its way.
STEPS_MAX: Final = 400
# A robot farther than this from its end approaches it first [m].
AT_END_M: Final = 0.06


class Lost(Exception):
    """A manoeuvre failed, or led elsewhere than the map says."""


class Work:
    """What one robot does and where it stands. `sense` gives its newest senses."""

    def __init__(self, slice_map: SliceMap, grid: Grid, step_m: float, sense: Callable[[], Senses]) -> None:
        self.map = slice_map
        self.at: End | None = None
        self.phase = TRAVELS
        self.found = False
        self.spare = False
        self.failures = 0
        self._grid = grid
        self._step_m = step_m
        self._sense = sense

    # --- finding itself -----------------------------------------------------------------------------------------------

    def localise(self) -> Story:
        """Find an end from anywhere: go to a slice and up to its upper end; sweep it if it is new."""
        self.at = None
        seek = Seek(self._grid)
        yield seek
        up = Sweep(seek.slice, TOP, self._grid, self._step_m)
        yield up
        if up.end is None:
            raise Lost
        known = self.map.end(up.end)
        if known is not None:
            self.at = known
            return
        self.at = up.end
        yield from self.sweep()

    # --- single steps -------------------------------------------------------------------------------------------------

    def sweep(self) -> Story:
        """Sweep the slice from the end where the robot is to the other end."""
        start = self.at
        if start is None:
            raise Lost
        yield from self._approach(start)
        sweep = Sweep(start.slice, -start.side, self._grid, self._step_m, start)
        yield sweep
        end = sweep.end
        if end is None:
            raise Lost
        low, high = sorted((start.y_mm, end.y_mm))
        self.map.add(Segment(start.slice, low, high))
        self.at = self.map.end(end)

    def trace(self, direction: int) -> Generator[Manoeuvre | None, None, Arc]:
        """Follow the boundary from the end where the robot is to the next; return the arc."""
        start = self.at
        if start is None:
            raise Lost
        senses = self._sense()
        depth = (senses.x_m - self._grid.x_m(start.slice)) * direction
        if not -AT_END_M < depth < 0.6 or abs(senses.y_m - start.y_mm / 1000.0) > 0.6:
            yield from self._approach(start)
        trace = Trace(start, direction, self._grid)
        yield trace
        arc, end = trace.arc, trace.end
        if end is None:
            raise Lost
        if arc is None:
            # A robot hid the end: the arc stays open, and the robot goes on if the end is known.
            self.at = self.map.end(end)
            raise Lost
        self.map.add(arc)
        self.at = self.map.end(end)
        return arc

    def travel(self, stop: End) -> Story:
        """Go to a known end by the shortest known way."""
        for _ in range(STEPS_MAX):
            start = None if self.at is None else self.map.end(self.at)
            goal = self.map.end(stop)
            if start is None or goal is None:
                raise Lost
            self.at = start
            if start == goal:
                return
            route = self.map.route(start, goal)
            if route is None:
                raise Lost
            step = route[0][1]
            if step.direction == 0:
                yield from self.sweep()
            else:
                yield from self.trace(step.direction)
        raise Lost

    def _approach(self, end: End) -> Story:
        senses = self._sense()
        dx, dy = senses.x_m - self._grid.x_m(end.slice), senses.y_m - end.y_mm / 1000.0
        if dx * dx + dy * dy > AT_END_M**2:
            yield Approach(end, self._grid)

    # --- a corridor ---------------------------------------------------------------------------------------------------

    def corridor(self, plan: Plan, slot: int, passed: Callable[[int], bool], swept: Callable[[int], bool]) -> Story:
        """Take slice `slot` of a corridor (0 for the lag), sweep it, and hunt back to the predecessor's slice.

        `passed(i)` tells whether the robot of slice i has swept it, `swept(i)` whether one need not wait for that any more.
        """
        self.found = self.spare = False
        self.phase = TRAVELS
        direction = plan.direction
        yield from self.travel(plan.anchor)
        if not (yield from self._take_slot(plan, slot, passed)):
            self.spare = True
            return
        self.phase = SWEEPS
        mine = self.at
        assert mine is not None
        if self.map.mate(mine) is None:
            yield from self.sweep()
        self.phase = HUNTS
        while slot > 0 and not swept(slot - 1):
            yield None
        yield from self._hunt(mine.slice, direction)

    def _take_slot(self, plan: Plan, slot: int, passed: Callable[[int], bool]) -> Generator[Manoeuvre | None, None, bool]:
        """Trace forward, one slice a robot; tell whether there is a slice left for this one."""
        direction = plan.direction
        skip = slot if plan.own_slice else slot + 1
        at = self.at
        assert at is not None
        if plan.own_slice and slot == 0:
            return True
        for index in range(skip):
            at = self.at
            if at is None:
                raise Lost
            arc = yield from self.trace(direction)
            if arc.stop.slice == arc.start.slice:
                return False
            holder = index + 1 if plan.own_slice else index
            at = self.at
            if at is not None and self.map.mate(at) is not None and not (holder < slot and passed(holder)):
                return False
        return True

    def _hunt(self, k: int, direction: int) -> Story:
        """Walk round the slab behind slice k, sweeping what is new, until the end reached is swept.

        Fig. 4 (i) and (ii) of the paper are both this loop.
        """
        for _ in range(STEPS_MAX):
            at = self.at
            if at is None:
                raise Lost
            into = -direction if at.slice == k else direction
            if self.map.arc(at, into) is not None:
                return
            yield from self.trace(into)
            at = self.at
            if at is None:
                raise Lost
            if self.map.mate(at) is not None:
                return
            if at.slice == k:
                self.found = True
            yield from self.sweep()
        raise Lost


__all__ = ["READY", "Lost", "Work"]
