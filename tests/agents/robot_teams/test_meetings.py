"""Two teams that meet, as in section 3.5 of the paper: they share their maps, end their corridors, and merge.

Every test lets two robots, each the lead of its own team, send beacons to each other and decide. The hall has ten slices.
"""

from collections.abc import Sequence

import pytest

from zwerm.agents.robot_teams.mapping.facts import BOTTOM, LEFT, RIGHT, TOP, End, Fact, SweptSegment, TracedArc
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.planning import open_tasks
from zwerm.agents.robot_teams.protocols.fact_exchange import FactExchange
from zwerm.agents.robot_teams.protocols.team_membership import TeamMembership
from zwerm.agents.robot_teams.protocols.team_messages import READY, SWEEPS, CorridorPlan, Status, TeamBeacon
from zwerm.agents.robot_teams.team_lead import TeamLead

DT_S, SILENCE_S = 0.25, 6.0
HEIGHT_MM = 5_000
LAST = 9
# Ticks in which two teams that stay together exchange all facts.
EXCHANGE_TICKS = 20


def arc(start: End, direction: int, stop: End) -> TracedArc:
    return TracedArc(start, direction, stop, 950, 0, 0)


def top(k: int) -> End:
    return End(k, TOP, HEIGHT_MM)


def covered(slices: Sequence[int]) -> list[Fact]:
    """Return the facts of neighbouring slices, ascending, with the arcs between them and at the ends of the hall."""
    facts: list[Fact] = [SweptSegment(k, 0, HEIGHT_MM) for k in slices]
    for k in slices[:-1]:
        facts += [arc(top(k), RIGHT, top(k + 1)), arc(End(k, BOTTOM, 0), RIGHT, End(k + 1, BOTTOM, 0))]
    if 0 in slices:
        facts.append(arc(top(0), LEFT, End(0, BOTTOM, 0)))
    if LAST in slices:
        facts.append(arc(top(LAST), RIGHT, End(LAST, BOTTOM, 0)))
    return facts


class Robot:
    """A robot that leads a team of its own, with what it knows and the corridor that it works on."""

    def __init__(self, node: int, slices: Sequence[int], at: End, direction: int) -> None:
        self.node, self.at = node, at
        self.map = SliceMap()
        self.map.merge(covered(slices))
        self.membership = TeamMembership(node, DT_S, SILENCE_S)
        self.exchange = FactExchange(self.map, DT_S)
        self.lead = TeamLead(
            self.map, self.membership, DT_S, divide=True, merge=True, one_corridor=False, join_m=1_000.0
        )
        self.plan = CorridorPlan(1, 1, at, direction, False, (node,))
        self.lead.plans = (self.plan,)
        self.busy = True
        self.view = self.membership.view

    def status(self, tick: int) -> Status:
        view = self.membership.view
        epoch, number = (self.plan.epoch, self.plan.number) if self.busy or view.epoch == 1 else (view.epoch, 0)
        phase = SWEEPS if self.busy else READY
        team = (view.epoch, view.lead)
        return Status(
            self.node, tick, 0, 0, epoch, number, phase, self.at, False, False, None, None, self.at.slice, team
        )

    def beacon(self, tick: int) -> TeamBeacon:
        parts = self.exchange.outgoing(tick)
        facts, membership = self.map.facts, self.membership
        statuses = (self.status(tick), *membership.others())
        views, met, plans = membership.outgoing(), membership.met(), self.lead.plans
        return TeamBeacon(self.node, views, met, plans, statuses, facts.digest, len(facts), *parts)

    def receive(self, beacon: TeamBeacon, tick: int, near: bool) -> None:
        self.membership.receive(beacon, tick, near)
        if near or self.membership.accepts(beacon.sender):
            self.exchange.receive(beacon, tick)

    def decide(self, tick: int) -> None:
        membership = self.membership
        membership.poll(tick)
        if membership.view != self.view:
            self.view = membership.view
            self.lead.begin(tick)
        if membership.leads:
            membership.roster.statuses[self.node] = self.status(tick)
            membership.roster.news_tick[self.node] = tick
            self.lead.decide(tick)


def together(robots: Sequence[Robot], first: int, ticks: int, near: bool = True) -> None:
    """Let the robots hear each other and decide, from tick `first` on."""
    for tick in range(first, first + ticks):
        beacons = [robot.beacon(tick) for robot in robots]
        for robot in robots:
            for beacon in beacons:
                if beacon.sender != robot.node:
                    robot.receive(beacon, tick, near)
        for robot in robots:
            robot.decide(tick)


def merged(one: Robot, other: Robot) -> tuple[CorridorPlan, ...]:
    """Let two robots meet at work and then end their corridors; return the plans of the team that they form."""
    robots = one, other
    together(robots, 1, EXCHANGE_TICKS)
    assert [robot.membership.view.members for robot in robots] == [(one.node,), (other.node,)], "not at work any more"
    assert one.map.facts.digest == other.map.facts.digest
    one.busy = other.busy = False
    together(robots, 1 + EXCHANGE_TICKS, EXCHANGE_TICKS)
    view = one.membership.view
    assert view == other.membership.view
    assert view.members == (one.node, other.node)
    return tuple([plan for plan in one.lead.plans if plan.epoch == view.epoch])


def test_teams_that_sweep_towards_each_other_have_completed_the_cell() -> None:
    left, right = Robot(0, range(5), top(4), RIGHT), Robot(1, range(5, LAST + 1), top(5), LEFT)
    assert not left.map.certificate.complete
    # The hunt at the end of a corridor traces the boundary between the two parts.
    left.map.merge([arc(top(4), RIGHT, top(5)), arc(End(4, BOTTOM, 0), RIGHT, End(5, BOTTOM, 0))])
    assert merged(left, right) == ()
    assert left.map.certificate.complete
    assert right.map.certificate.complete


def test_teams_that_sweep_in_one_direction_go_on_together_where_the_first_of_them_was() -> None:
    behind, ahead = Robot(0, range(4), top(3), RIGHT), Robot(1, range(7), top(6), RIGHT)
    plans = merged(behind, ahead)
    assert {(plan.anchor.slice, plan.direction) for plan in plans} == {(6, RIGHT)}


def test_teams_on_their_way_to_open_cells_choose_anew_among_all_that_is_open() -> None:
    """Both know the middle of the hall; nothing to the left and to the right of it is swept."""
    one, other = Robot(0, range(3, 7), top(3), LEFT), Robot(1, range(3, 7), top(6), RIGHT)
    plans = merged(one, other)
    assert sorted((plan.anchor.slice, plan.direction, plan.order) for plan in plans) == [
        (3, LEFT, (0,)),
        (6, RIGHT, (1,)),
    ]


def test_a_team_that_sweeps_what_a_passing_team_knows_leaves_it_and_joins() -> None:
    sweeping, passing = Robot(0, range(2), top(1), RIGHT), Robot(1, range(8), top(7), RIGHT)
    assert {task.end.slice for task in open_tasks(sweeping.map)} == {1}
    plans = merged(sweeping, passing)
    assert {plan.anchor.slice for plan in plans} == {7}


@pytest.mark.parametrize("busy", [0, 1])
def test_a_robot_ends_its_corridor_before_it_takes_a_plan_of_the_merged_team(busy: int) -> None:
    robots = Robot(0, range(4), top(3), RIGHT), Robot(1, range(7), top(6), RIGHT)
    together(robots, 1, EXCHANGE_TICKS)
    robots[1 - busy].busy = False
    together(robots, 1 + EXCHANGE_TICKS, EXCHANGE_TICKS)
    united = robots[0].membership.view.members == (0, 1)
    assert united == (busy == 1), "the team with the smaller lead unites the two at the end of its own corridor"
    epoch = robots[0].membership.view.epoch
    assert all(busy not in plan.order for plan in robots[0].lead.plans if united and plan.epoch == epoch)


def test_teams_within_radio_range_that_are_far_apart_do_not_join() -> None:
    """A negative control: only a meeting unites, and only then are maps shared."""
    robots = Robot(0, range(4), top(3), RIGHT), Robot(1, range(7), top(6), RIGHT)
    for robot in robots:
        robot.busy = False
    together(robots, 1, 2 * EXCHANGE_TICKS, near=False)
    assert [robot.membership.view.members for robot in robots] == [(0,), (1,)]
    assert robots[0].map.facts.digest != robots[1].map.facts.digest
