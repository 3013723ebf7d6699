"""The barrier of a corridor in all interleavings of small cases: a robot hunts only once its predecessor's slice is swept.

The test explores every order of these events. A robot continues its work. Its newest status, or an earlier one, reaches
another robot. The predecessor dies. In every state the test checks the guarantee. It then lets the time pass after
which a silent member is dropped. Every living robot must then pass the barrier.
"""

import copy

import pytest

from zwerm.agents.robot_teams.mapping.facts import RIGHT, TOP, End
from zwerm.agents.robot_teams.protocols.corridor_mates import CorridorMates
from zwerm.agents.robot_teams.protocols.team_membership import TeamMembership
from zwerm.agents.robot_teams.protocols.team_messages import (
    HUNTS,
    READY,
    SWEEPS,
    TRAVELS,
    CorridorPlan,
    Status,
    TeamBeacon,
    View,
)

DT_S, SILENCE_S = 1.0, 3.0
ANCHOR = End(0, TOP, 5_000)


class Corridor:
    """Robots 0, 1, ... with one plan, of whom as many as `room` get a slice; `order` is lag to lead."""

    def __init__(self, count: int, room: int | None = None) -> None:
        self.view = View(2, 0, tuple(range(count)))
        self.plan = CorridorPlan(2, 1, ANCHOR, RIGHT, False, tuple(range(count)))
        self.members = [TeamMembership(node, DT_S, SILENCE_S) for node in range(count)]
        for member in self.members:
            member.view = self.view
            for node in range(count):
                member.roster.news_tick[node] = 0
        self.has_room = room
        self.phase = [TRAVELS] * count
        self.found_room: list[int | None] = [None] * count
        self.claims: list[int | None] = [None] * count
        self.hunting: list[int] = []
        self.swept: set[int] = set()
        self.old: list[TeamBeacon | None] = [None] * count
        self.dead: list[int] = []
        self.tick = 1
        self.beats = 0

    def mates(self, node: int) -> CorridorMates:
        return CorridorMates(self.plan, node, self.members[node], lambda k: False)

    def beacon(self, node: int) -> TeamBeacon:
        self.beats += 1
        plan, team = self.plan, (self.view.epoch, self.view.lead)
        status = Status(
            *(node, self.beats, 0, 0, plan.epoch, plan.number, self.phase[node], ANCHOR, False, False),
            *(self.claims[node], self.found_room[node], None, team),
        )
        return TeamBeacon(node, (self.members[node].view,), (), (), (status,), 0, 0)

    def deliver(self, beacon: TeamBeacon, receiver: int) -> None:
        if beacon.sender != receiver and receiver not in self.dead:
            self.members[receiver].receive(beacon, self.tick, near=False)

    @property
    def living(self) -> list[int]:
        return [node for node in range(len(self.phase)) if node not in self.dead]

    def work(self, node: int) -> None:
        """Take a slice, sweep it, and pass the barrier, as `Work.corridor` does; one step."""
        mates = self.mates(node)
        if self.phase[node] == TRAVELS:
            slot = mates.slot(self.found_room[node])
            if slot < 0:
                self.phase[node] = READY
            elif self.has_room is not None and slot >= self.has_room:
                self.found_room[node] = self.has_room
            else:
                self.claims[node], self.phase[node] = slot, SWEEPS
        elif self.phase[node] == SWEEPS:
            self.swept.add(node)
            self.phase[node] = HUNTS
        elif self.phase[node] == HUNTS and not mates.awaits_predecessor():
            self.hunting.append(node)
            self.phase[node] = READY
            before = node - 1
            spare = before >= 0 and self.phase[before] == READY and self.claims[before] is None
            dropped = before not in self.members[node].view.members
            assert before < 0 or before in self.swept or spare or dropped, "it hunted towards a slice that is not swept"

    def heal(self, rounds: int) -> None:
        for _ in range(rounds):
            self.tick += 1
            for node in self.living:
                self.members[node].poll(self.tick)
                self.work(node)
            for beacon in [self.beacon(node) for node in self.living]:
                for receiver in self.living:
                    self.deliver(beacon, receiver)


def events(corridor: Corridor, dies: int | None) -> list[tuple[str, int, int]]:
    found = [("work", node, 0) for node in corridor.living]
    for node in corridor.living:
        found.append(("keep", node, 0))
        for other in corridor.living:
            if other != node:
                found.append(("hear", node, other))
                if corridor.old[node] is not None:
                    found.append(("late", node, other))
    if dies is not None and dies not in corridor.dead:
        found.append(("die", dies, 0))
    return found


def happen(corridor: Corridor, event: tuple[str, int, int]) -> Corridor:
    after = copy.deepcopy(corridor)
    kind, node, other = event
    if kind == "work":
        after.work(node)
    elif kind == "keep":
        after.old[node] = after.beacon(node)
    elif kind == "hear":
        after.deliver(after.beacon(node), other)
    elif kind == "late":
        beacon = after.old[node]
        assert beacon is not None
        after.deliver(beacon, other)
    else:
        after.dead.append(node)
    return after


def signature(corridor: Corridor) -> object:
    received = [
        [(node, status.phase, status.claim, status.room) for node, status in sorted(member.roster.statuses.items())]
        for member in corridor.members
    ]
    old = [beacon and (beacon.statuses[0].phase, beacon.statuses[0].room) for beacon in corridor.old]
    return repr((corridor.phase, corridor.claims, corridor.found_room, received, old, corridor.dead))


def explore(corridor: Corridor, depth: int, dies: int | None = None) -> int:
    """Visit every state that up to `depth` events lead to; return how many there are."""
    states, known = [corridor], {signature(corridor)}
    everything = [corridor]
    for _ in range(depth):
        following = []
        for state in states:
            for event in events(state, dies):
                after = happen(state, event)
                mark = signature(after)
                if mark not in known:
                    known.add(mark)
                    following.append(after)
        states = following
        everything += states
    for state in everything[:: max(1, len(everything) // 300)]:
        state.heal(round(3 * SILENCE_S) + 6)
        assert all(state.phase[node] == READY for node in state.living), (state.phase, state.dead)
    return len(known)


@pytest.mark.parametrize(("count", "depth"), [(2, 7), (3, 4)])
def test_no_robot_hunts_before_its_predecessor_swept_although_messages_are_lost_or_late(count: int, depth: int) -> None:
    assert explore(Corridor(count), depth) > 200


@pytest.mark.parametrize("room", [1, 2])
def test_a_corridor_with_too_little_room_ends_for_all(room: int) -> None:
    assert explore(Corridor(3, room), 4) > 200


@pytest.mark.parametrize("dies", [0, 1])
def test_a_dead_predecessor_delays_no_robot_for_ever(dies: int) -> None:
    assert explore(Corridor(3), 4, dies) > 200


def test_with_the_predecessor_silent_and_not_dropped_the_robot_waits() -> None:
    """A negative control: without any message the barrier holds."""
    corridor = Corridor(2)
    for _ in range(20):
        corridor.work(1)
    assert corridor.phase[1] == HUNTS
    assert corridor.hunting == []


@pytest.mark.parametrize(("room", "slots"), [(None, [0, 1, 2]), (2, [-1, 0, 1]), (1, [-1, -1, 0])])
def test_robots_that_know_how_much_room_there_is_take_different_slices(room: int | None, slots: list[int]) -> None:
    corridor = Corridor(3)
    corridor.found_room[2] = room
    for node in range(3):
        corridor.deliver(corridor.beacon(2), node)
    assert [max(-1, corridor.mates(node).slot(corridor.found_room[node])) for node in range(3)] == slots
