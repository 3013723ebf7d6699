"""The virtual frontier of a team: it covers one side of the space beyond an obstacle, and leaves the other side for later.

Latimer et al. 2002, section 3.3, Fig. 5. At a forward convex critical point the cell ahead is divided along a line from the
point, perpendicular to the slices. The team's sweeps end at the line as at a wall. The line ends at the first slice on which
an obstacle crosses it. It belongs to one view of one team. A merge or a division drops it, and a team without other
work drops it too. The space left for later is open in the map: the ends beyond the line lack a mate.
"""

from typing import Final, NamedTuple

import msgspec

from zwerm.agents.robot_teams.mapping.facts import CONVEX, End, FrontierCut, TracedArc
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.protocols.team_messages import CorridorPlan

# A corridor whose anchor is nearer than this to the line is not cut [mm].
NEAR_MM: Final = 300


class Frontier(NamedTuple):
    """The line at height `y_mm`, from slice `first` on in x-direction `direction`."""

    y_mm: int
    first: int
    direction: int


class TeamFrontier:
    """The frontier of one team, as its lead keeps it."""

    def __init__(self, slice_map: SliceMap) -> None:
        self.frontier: Frontier | None = None
        self._map = slice_map
        self._seen: dict[TracedArc, None] = {}

    def drop(self) -> None:
        """Drop the frontier."""
        self.frontier = None

    def is_reserved(self, end: End) -> bool:
        """Return whether an end lies beyond the frontier, and so is left for later."""
        return self.frontier is not None and end.y_mm == self.frontier.y_mm and self._map.is_virtual(end)

    def limited(self, plan: CorridorPlan) -> CorridorPlan:
        """Return a new plan with the frontier at which its sweeps end, if it lies beyond the critical point."""
        line = self.frontier
        if line is None or plan.direction != line.direction or self._map.is_virtual(plan.anchor):
            return plan
        ahead = (_slices(plan)[0] - line.first) * line.direction >= 0
        if not ahead or abs(plan.anchor.y_mm - line.y_mm) < NEAR_MM:
            return plan
        return msgspec.structs.replace(plan, frontier_mm=line.y_mm)

    def judge(self, plan: CorridorPlan) -> None:
        """Update the frontier at the end of a plan: an obstacle may have crossed it, or a critical point may begin one."""
        facts = self._map.facts
        line = self.frontier
        if line is not None and plan.frontier_mm == line.y_mm:
            swept = {segment.slice for segment in facts.segments}
            if any(k in swept and FrontierCut(k, line.y_mm) not in facts for k in _slices(plan)):
                self.frontier = None
        new = [arc for arc in facts.arcs if arc.kind == CONVEX and arc not in self._seen]
        self._seen.update(dict.fromkeys(new))
        forward = [arc for arc in new if arc.direction == plan.direction]
        if forward and self.frontier is None:
            arc = min(forward, key=lambda each: (abs(each.start.y_mm - plan.anchor.y_mm), each))
            self.frontier = Frontier(arc.y_mm, arc.start.slice + arc.direction, arc.direction)


def _slices(plan: CorridorPlan) -> list[int]:
    first = plan.anchor.slice + (0 if plan.own_slice else plan.direction)
    return [first + plan.direction * place for place in range(len(plan.order))]
