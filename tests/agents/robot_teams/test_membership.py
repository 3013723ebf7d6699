"""Membership in all interleavings of small cases: views, division, merging and succession under loss and delay.

The test explores every order of these events, up to a depth. A robot's newest beacon, or an earlier one, reaches
another robot. A lead divides or merges its team. A robot dies. In every state what is promised is checked, and then
that a time without loss brings all living robots to agree.
"""

import copy
from itertools import pairwise

import pytest

from zwerm.agents.robot_teams.protocols.team_membership import TeamMembership, later
from zwerm.agents.robot_teams.protocols.team_messages import READY, Status, TeamBeacon, View

DT_S, SILENCE_S = 1.0, 3.0


class Team:
    """Some robots, the beacons that they sent, and the time."""

    def __init__(self, count: int, together: bool = True) -> None:
        self.robots = [TeamMembership(node, DT_S, SILENCE_S) for node in range(count)]
        self.old: list[TeamBeacon | None] = [None] * count
        self.dead: list[int] = []
        self.tick = 0
        if together:
            for sender in range(count):
                for receiver in range(count):
                    self.deliver(self.beacon(sender), receiver, near=False)
            for robot in self.robots:
                robot.meet_first(0)
            self.heal(2)

    def beacon(self, node: int) -> TeamBeacon:
        robot = self.robots[node]
        team = (robot.view.epoch, robot.view.lead)
        status = Status(node, self.tick, 0, 0, robot.view.epoch, 0, READY, None, False, False, None, None, None, team)
        return TeamBeacon(node, robot.outgoing(), robot.met(), (), (status,), 0, 0)

    def deliver(self, beacon: TeamBeacon, receiver: int, near: bool = True) -> None:
        if beacon.sender != receiver and receiver not in self.dead:
            self.robots[receiver].receive(beacon, self.tick, near)

    def pass_time(self) -> None:
        self.tick += 1
        for robot in self.robots:
            if robot.node not in self.dead:
                robot.poll(self.tick)

    def heal(self, rounds: int) -> None:
        """Let everybody hear everybody for some time."""
        for _ in range(rounds):
            beacons = [self.beacon(node) for node in self.living]
            for beacon in beacons:
                for receiver in self.living:
                    self.deliver(beacon, receiver, near=False)
            self.pass_time()

    @property
    def living(self) -> list[int]:
        return [node for node in range(len(self.robots)) if node not in self.dead]

    def views(self) -> list[View]:
        return [self.robots[node].view for node in self.living]

    def check(self) -> None:
        """Check what holds in every state."""
        for node in self.living:
            view = self.robots[node].view
            assert node in view.members
            assert view.lead in view.members
            assert list(view.members) == sorted(set(view.members))

    def check_agreement(self) -> None:
        """Check that every living robot has the view of all members of its team, all of them alive."""
        for node in self.living:
            view = self.robots[node].view
            assert all(member in self.living for member in view.members), (view, self.dead)
            assert all(self.robots[member].view == view for member in view.members), self.views()


def events(team: Team, dies: int | None) -> list[tuple[str, int, int]]:
    found: list[tuple[str, int, int]] = [("time", 0, 0)]
    for node in team.living:
        found += [("hear", node, other) for other in team.living if other != node]
        if team.old[node] is not None:
            found += [("late", node, other) for other in team.living if other != node]
        found.append(("keep", node, 0))
        robot = team.robots[node]
        if robot.leads and len(robot.view.members) > 1:
            found.append(("divide", node, 0))
        if robot.leads and robot.met():
            found.append(("merge", node, 0))
    if dies is not None and dies not in team.dead:
        found.append(("die", dies, 0))
    return found


def happen(team: Team, event: tuple[str, int, int]) -> Team:
    after = copy.deepcopy(team)
    kind, node, other = event
    before = [robot.view for robot in after.robots]
    if kind == "time":
        after.pass_time()
    elif kind == "hear":
        after.deliver(after.beacon(node), other)
    elif kind == "late":
        beacon = after.old[node]
        assert beacon is not None
        after.deliver(beacon, other)
    elif kind == "keep":
        after.old[node] = after.beacon(node)
    elif kind == "divide":
        members = after.robots[node].view.members
        after.robots[node].divide((members[:1], members[1:]), after.tick)
    elif kind == "merge":
        after.robots[node].merge(after.tick)
    else:
        after.dead.append(node)
    for robot, was in zip(after.robots, before, strict=True):
        assert robot.view == was or later(robot.view, was), "a view went back"
    return after


def signature(team: Team) -> object:
    return (
        tuple(team.views()),
        tuple(robot.met() for robot in team.robots),
        tuple(robot.outgoing() for robot in team.robots),
        tuple(beacon and beacon.views for beacon in team.old),
        tuple(team.dead),
        team.tick,
    )


def explore(team: Team, depth: int, dies: int | None = None) -> int:
    """Visit every state that up to `depth` events lead to, and return how many there are."""
    states, known, leaves = [team], {signature(team)}, 0
    for _ in range(depth):
        following = []
        for state in states:
            for event in events(state, dies):
                after = happen(state, event)
                after.check()
                mark = signature(after)
                if mark not in known:
                    known.add(mark)
                    following.append(after)
        states = following
    for state in states[:: max(1, len(states) // 400)]:
        leaves += 1
        state.heal(round(3 * SILENCE_S) + 30)
        state.check()
        state.check_agreement()
    assert leaves > 20
    return len(known)


def test_robots_within_radio_range_are_one_team() -> None:
    team = Team(4)
    assert {view.members for view in team.views()} == {(0, 1, 2, 3)}
    assert {view.lead for view in team.views()} == {0}


@pytest.mark.parametrize(("count", "depth"), [(2, 6), (3, 5)])
def test_a_team_agrees_again_after_lost_and_late_messages_and_any_decision(count: int, depth: int) -> None:
    assert explore(Team(count), depth) > 50


@pytest.mark.parametrize("dies", [0, 1, 2])
def test_a_team_agrees_again_after_any_robot_dies_at_any_time(dies: int) -> None:
    assert explore(Team(3), 4, dies) > 50


def test_teams_that_began_apart_agree_although_messages_are_lost_or_late() -> None:
    assert explore(Team(3, together=False), 4) > 50


def test_the_smallest_living_member_takes_the_place_of_a_silent_lead() -> None:
    team = Team(4)
    team.dead = [0]
    team.heal(round(SILENCE_S) + 3)
    assert {(view.lead, view.members) for view in team.views()} == {(1, (1, 2, 3))}


def test_two_silent_robots_are_dropped_and_a_third_leads() -> None:
    team = Team(4)
    team.dead = [0, 1]
    team.heal(2 * round(SILENCE_S) + 4)
    assert {(view.lead, view.members) for view in team.views()} == {(2, (2, 3))}


def test_divided_teams_do_not_meet_at_once_but_later() -> None:
    team = Team(2)
    team.robots[0].divide(((0,), (1,)), team.tick)
    team.heal(2)
    assert [view.members for view in team.views()] == [(0,), (1,)]
    team.deliver(team.beacon(1), 0, near=True)
    assert team.robots[0].met() == ()
    team.tick += 30
    team.deliver(team.beacon(1), 0, near=True)
    assert team.robots[0].merge(team.tick)
    team.heal(2)
    assert [view.members for view in team.views()] == [(0, 1), (0, 1)]


def test_only_the_smaller_lead_unites() -> None:
    team = Team(2, together=False)
    for sender in (0, 1):
        team.deliver(team.beacon(sender), 1 - sender, near=True)
    assert not team.robots[1].merge(0)
    assert team.robots[0].merge(0)


def test_views_are_ordered_by_epoch_then_the_smaller_lead_then_more_members() -> None:
    views = [View(1, 3, (3,)), View(1, 3, (3, 4)), View(1, 2, (2,)), View(2, 5, (5,)), View(2, 1, (1,))]
    assert all(later(after, before) for before, after in pairwise(views))
    assert not any(later(view, view) for view in views)
