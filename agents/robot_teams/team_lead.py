"""The lead of a team: it unites its team with others, divides it, and gives free members corridors. No radio, no motion.

A robot that leads its team runs it, and so does a coordinator, for all robots.
"""

from collections.abc import Sequence
from typing import Final

from zwerm.agents.robot_teams.mapping.facts import PASSES
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.planning import (
    FAR,
    LINK,
    Task,
    assign,
    division,
    finder,
    free_members,
    latest_plans,
    open_tasks,
    without_busy,
)
from zwerm.agents.robot_teams.protocols.team_membership import TeamMembership
from zwerm.agents.robot_teams.protocols.team_messages import CorridorPlan
from zwerm.agents.robot_teams.virtual_frontier import TeamFrontier

# Time that a team waits until the team whose lead has the smaller id unites the two [s].
MERGE_WAIT_S: Final = 30.0
# Time in which a robot does not take a task again at which it found nothing new [s].
SKIP_S: Final = 30.0
# Times without a new corridor after which free robots take tasks at any distance, and then in cells where others work [s].
FAR_AFTER_S: Final = 20.0
ANY_AFTER_S: Final = 60.0


def findings(slice_map: SliceMap, membership: TeamMembership) -> dict[str, float | bool]:
    """Return the results of a map and a team, as named numbers for observers."""
    certificate, facts = slice_map.certificate, slice_map.facts
    return {
        "ends": certificate.ends,
        "ends_without_mate": len(certificate.ends_without_mate),
        "open_ports": len(certificate.open_ports),
        "critical_points": len({arc.ports for arc in facts.arcs if arc.kind != PASSES}),
        "virtual_frontier_cuts": len(facts.cuts),
        "wrecks": len({void.wreck.node for void in slice_map.voids}),
        "divisions": membership.divisions,
        "merges": membership.merges,
    }


class TeamLead:
    """The plans of one team, as its lead makes them and its members follow them."""

    def __init__(
        self,
        slice_map: SliceMap,
        membership: TeamMembership,
        dt_s: float,
        *,
        divide: bool,
        merge: bool,
        one_corridor: bool,
        join_m: float,
        virtual_frontier: bool = False,
    ) -> None:
        self.plans: tuple[CorridorPlan, ...] = ()
        self._map, self._membership, self._dt_s = slice_map, membership, dt_s
        self._divide, self._merge, self._one_corridor = divide, merge, one_corridor
        self._join_mm = round(1000.0 * join_m)
        self._skip: dict[tuple[Task, int], int] = {}
        self._judged: dict[int, CorridorPlan] = {}
        self._digests: dict[int, int] = {}
        self._made_tick = 0
        self._frontiers = TeamFrontier(slice_map) if virtual_frontier else None

    def begin(self, tick: int) -> None:
        """Start again in another view: plans hold within one view."""
        self._judged.clear()
        self._digests.clear()
        self._made_tick = tick
        if self._frontiers is not None:
            self._frontiers.drop()
        self.plans = tuple([plan for plan in self.plans if plan.epoch == self._membership.view.epoch])

    def follow(self, plans: Sequence[CorridorPlan]) -> None:
        """Take over the plans of the lead, as a member repeats them."""
        view = self._membership.view
        known = dict.fromkeys((*self.plans, *[plan for plan in plans if plan.epoch == view.epoch]))
        self.plans = tuple(dict.fromkeys(latest_plans(tuple(known), view).values()))

    def decide(self, tick: int) -> bool:
        """Unite with teams that were met, divide, or assign tasks to free members; return whether all robots must be
        informed."""
        membership, dt_s = self._membership, self._dt_s
        view, statuses = membership.view, membership.roster.statuses
        free = free_members(view, self.plans, statuses)
        if not free:
            return False
        if self._merge and membership.met():
            if len(free) == len(view.members) and membership.merge(tick):
                return True
            if membership.merges_soon(tick, round(MERGE_WAIT_S / dt_s)):
                return False
        if self._map.certificate.complete:
            return False
        if self._divides(free, tick):
            return True
        self._skip = {task: since for task, since in self._skip.items() if (tick - since) * dt_s < SKIP_S}
        # If no task could be assigned for some time, robots take far tasks too, and then those in reserved cells.
        idle_s = (tick - self._made_tick) * dt_s
        join_mm = self._join_mm if idle_s < FAR_AFTER_S else FAR
        plans = self.plans if idle_s < ANY_AFTER_S else without_busy(self.plans, free)
        frontiers = self._frontiers
        skip = dict(self._skip)
        if frontiers is not None:
            later = [task for task in open_tasks(self._map) if frontiers.is_reserved(task.end)]
            skip |= {(task, node): tick for task in later for node in free}
        made = assign(self._map, view, self.plans, plans, statuses, skip, self._one_corridor, join_mm)
        if frontiers is not None:
            made = [frontiers.limited(plan) for plan in made]
        if not made:
            if frontiers is not None and len(free) == len(view.members):
                frontiers.drop()
            return False
        self._made_tick = tick
        self.plans = (*dict.fromkeys(latest_plans(self.plans, view).values()), *made)
        for plan in made:
            self._digests[plan.number] = self._map.facts.digest
        return True

    def _divides(self, free: Sequence[int], tick: int) -> bool:
        """Evaluate every corridor that has just ended: whether it gave new facts, and whether the team divides."""
        membership = self._membership
        view, statuses = membership.view, membership.roster.statuses
        for plan in dict.fromkeys(latest_plans(self.plans, view).values()):
            if plan.number in self._judged or any(node not in free for node in plan.order):
                continue
            self._judged[plan.number] = plan
            if self._digests.pop(plan.number, None) == self._map.facts.digest:
                # Another robot may succeed: a robot that waits there may have blocked the one that failed.
                task = Task(plan.anchor, plan.direction, plan.own_slice)
                self._skip |= {(task, node): tick for node in plan.order}
            if self._frontiers is not None:
                self._frontiers.judge(plan)
            index = finder(plan.order, statuses) if self._divide and plan.anchor.side != LINK else None
            groups = None if index is None else division(view, plan.order, index)
            if groups is not None:
                membership.divide(groups, tick)
                self.plans = ()
                return True
        return False
