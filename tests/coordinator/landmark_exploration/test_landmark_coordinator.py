"""The coordinator of landmark-based exploration by itself: it acknowledges uploads, and ignores what it cannot decode."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.cost_utility import Offer, cost_utility
from zwerm.agents.landmark_exploration.mapping.frontier_status import ABANDONED, CLEAR, REOPENED, TIMED_OUT, key_of
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing.exploration_tasks import ExplorationTask, landmark_bytes, read_task
from zwerm.agents.landmark_exploration.sharing.landmark_messages import Entries, TaskPart, TaskReport, Vector
from zwerm.agents.runtime.contract import Setup
from zwerm.coordinator.landmark_exploration import LandmarkCoordinator
from zwerm.wire.messages import Observation, Packet

ROBOTS = 3


def coordinator(incarnation: int = 1) -> LandmarkCoordinator:
    return LandmarkCoordinator(
        Setup(ROBOTS, "coordinator", 0.1, (), bytes(16), channels=("uplink",), incarnation=incarnation)
    )


def answers(node: LandmarkCoordinator, tick: int, *payloads: bytes) -> list[tuple[int | None, Vector]]:
    """Return the acknowledgements of a tick in which robot 1 has sent these payloads."""
    inbox = tuple(Packet("uplink", payload, 1) for payload in payloads)
    outbox = node.step(Observation(tick, 0.1 * tick, inbox)).outbox
    read = [(each.to, messages.read(each.payload)) for each in outbox]
    return [(to, message) for to, message in read if isinstance(message, Vector)]


def test_the_coordinator_acknowledges_the_number_of_entries_that_it_has() -> None:
    node = coordinator()
    upload = messages.write(Entries(7, 0, (b"a", b"b")))
    assert answers(node, 0, upload) == [(1, Vector(7, 8, (7, 2), ask=False))]
    assert answers(node, 1, upload) == [(1, Vector(7, 8, (7, 2), ask=False))], "a repeated upload"
    assert answers(node, 2) == []


def test_a_part_with_a_gap_before_it_is_not_acknowledged() -> None:
    node = coordinator()
    assert answers(node, 0, messages.write(Entries(7, 1, (b"b",)))) == [(1, Vector(7, 8, (7, 0), ask=False))]


def test_a_coordinator_without_memory_acknowledges_nothing_of_what_it_had() -> None:
    first, again = (messages.write(Entries(7, number, (b"a",))) for number in (0, 1))
    node = coordinator()
    answers(node, 0, first)
    assert answers(node, 1, again) == [(1, Vector(7, 8, (7, 2), ask=False))]
    assert answers(coordinator(incarnation=2), 2, again) == [(1, Vector(7, 8, (7, 0), ask=False))]


def test_bytes_of_any_kind_are_ignored() -> None:
    assert answers(coordinator(), 0, b"", b"\xff" * 40, messages.write(Entries(7, 0, (b"a",)))[:-1]) == []


@given(st.lists(st.sets(st.integers(0, 14), min_size=2, max_size=5), min_size=4, max_size=12), st.randoms())
@settings(max_examples=40)
def test_assignment_takes_the_best_pair_of_a_robot_and_a_frontier_again_and_again(
    some: list[set[int]], random: Any
) -> None:
    robots = 5
    node = LandmarkCoordinator(Setup(robots, "coordinator", 0.1, (), bytes(16), channels=("uplink",), incarnation=1))
    for number, landmarks in enumerate(some):
        seen = tuple(sorted(landmarks))
        node.map.observe(BearingSnapshot(seen, tuple(random.randrange(256) for _ in seen)), (number, 0))
    reports = [tuple(sorted(random.choice(some))) for _ in range(robots)]
    expected: dict[int, int] = {}
    offer, choose = Offer(node.map.frontiers, ()), cost_utility(10.0)
    while True:
        free = [robot for robot in range(robots) if robot not in expected]
        choices = [(choice, robot) for robot in free if (choice := choose(node.map.complex, reports[robot], offer))]
        if not choices:
            break
        best, robot = max(choices, key=lambda each: (each[0].gain, -each[1]))
        expected[robot] = best.key
        offer.take(best.key)
    inbox = tuple(
        Packet("uplink", messages.write(TaskReport(1, 0, 0, True, True, 0, landmark_bytes(report))), robot)
        for robot, report in enumerate(reports)
    )
    outbox = node.step(Observation(0, 0.0, inbox)).outbox
    assigned = {}
    for each in outbox:
        part = messages.read(each.payload)
        if isinstance(part, TaskPart) and each.to is not None and (key := read_task(part.bytes_).key) is not None:
            assigned[each.to] = key
    assert assigned == expected


@pytest.mark.parametrize("walks", [True, False])
def test_a_robot_that_no_path_leads_to_a_frontier_walks_or_waits(walks: bool) -> None:
    parameters = {"walk_if_cut_off": walks}
    node = LandmarkCoordinator(Setup(1, "coordinator", 0.1, (), bytes(16), channels=("uplink",), parameters=parameters))
    node.map.observe(BearingSnapshot((1, 2, 3), (0, 20, 40)))
    report = TaskReport(1, 0, 0, True, True, 0, landmark_bytes((7, 8)))
    outbox = node.step(Observation(0, 0.0, (Packet("uplink", messages.write(report), 0),))).outbox
    parts = [part for part in map(messages.read, [each.payload for each in outbox]) if isinstance(part, TaskPart)]
    assert [read_task(part.bytes_).walk for part in parts] == [True] * walks


def test_a_frontier_that_opens_goes_to_the_nearest_robot_although_that_one_waits() -> None:
    """A robot that found no free frontier waits before it is considered again. A frontier that opens ends this time."""
    node = coordinator()
    for first in range(1, 6):
        node.map.observe(BearingSnapshot((first, first + 1, first + 2), (0, 20, 40)), (first, 0))
    here, there = key_of(1, 2), key_of(6, 7)
    node.map.raise_all([key for key in node.map.frontiers.open if key not in (here, there)], CLEAR)
    node.map.raise_all([there], TIMED_OUT)

    def assigned(tick: int, reports: dict[int, tuple[int, ...]]) -> dict[int | None, int | None]:
        inbox = tuple(
            Packet("uplink", messages.write(TaskReport(1, 0, 0, True, True, 0, landmark_bytes(seen))), robot)
            for robot, seen in reports.items()
        )
        outbox = node.step(Observation(tick, 0.1 * tick, inbox)).outbox
        parts = [(each.to, messages.read(each.payload)) for each in outbox]
        return {to: read_task(part.bytes_).key for to, part in parts if isinstance(part, TaskPart)}

    assert assigned(0, {0: (1, 2, 3)}) == {0: here}
    assert assigned(1, {1: (5, 6, 7)}) == {}, "robot 1 finds no free frontier, and waits"
    node.map.raise_all([there], REOPENED)
    assert assigned(2, {2: (1, 2, 3)}) == {1: there}, "robot 2 is considered for the first time, but is far"


def test_a_timed_out_frontier_that_no_boundary_continues_is_explored_once_more_before_the_end() -> None:
    """Section IV-A: after the exploration the 1-skeleton is traced, and inconsistent frontiers are explored again."""
    node = LandmarkCoordinator(Setup(1, "coordinator", 0.1, (), bytes(16), channels=("uplink",)))
    node.map.observe(BearingSnapshot((1, 2, 3), (0, 85, 170)))
    left = key_of(2, 1)
    node.map.raise_all([key for key in node.map.frontiers.open if key != left], CLEAR)
    node.map.raise_all([left], TIMED_OUT)
    assert not node.map.frontiers.open

    def step(tick: int, of: tuple[int, int]) -> tuple[list[ExplorationTask], bool]:
        report = TaskReport(1, *of, True, True, 0, landmark_bytes((1, 2, 3)))
        command = node.step(Observation(tick, 0.1 * tick, (Packet("uplink", messages.write(report), 0),)))
        parts = [messages.read(each.payload) for each in command.outbox]
        return [read_task(part.bytes_) for part in parts if isinstance(part, TaskPart)], command.done

    assert step(0, (0, 0)) == ([], False), "the frontier is reopened"
    ((task,), done) = step(1, (0, 0))
    assert (task.key, task.status, done) == (left, ABANDONED, False)
    node.map.raise_all([left], ABANDONED)
    ((halt,), done) = step(2, (1, 1))
    assert (halt.key, halt.walk, done) == (None, False, False)
    assert step(3, (1, 2)) == ([], True)
