"""Who may leave: the criterion against gudhi, and the locks one by one. All interleavings are in test_interleavings.py."""

import importlib
import sys
from itertools import combinations
from types import ModuleType

import gudhi
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import ROOT

from zwerm.agents.sensor_coverage.protocols.leave_lock import (
    LeaveLock,
    LockDenial,
    LockGrant,
    LockMessage,
    LockRelease,
    LockRequest,
    Message,
    NeighbourList,
)

LEASE_S = 10.0
START_S = 100.0

Graph = dict[int, list[int]]


def swarm(graph: Graph) -> dict[int, LeaveLock]:
    """Return robots that stand there, and know each other's lists."""
    robots = {node: LeaveLock(node, LEASE_S, START_S - LEASE_S) for node in graph}
    for node, robot in robots.items():
        robot.see(graph[node], START_S)
    for node, robot in robots.items():
        for other in graph[node]:
            robot.hear(other, robots[other].tell(), START_S)
    return robots


def everyone(count: int) -> Graph:
    return {node: [other for other in range(count) if other != node] for node in range(count)}


def only(sent: list[LockMessage]) -> Message:
    (each,) = sent
    return each.message


# --- the criterion --------------------------------------------------------------------------------------------------


def gudhi_betti(graph: Graph) -> list[int]:
    """b0 and b1 of the whole flag complex, up to tetrahedra."""
    tree = gudhi.SimplexTree()
    for node, listed in graph.items():
        tree.insert([node])
        for other in listed:
            tree.insert([node, other])
    tree.expansion(3)
    tree.compute_persistence(homology_coeff_field=2, persistence_dim_max=True)
    return [*tree.betti_numbers(), 0, 0][:2]


def discs(seed: int, count: int) -> Graph:
    """Robots at random that see each other within a range."""
    place = np.random.Generator(np.random.Philox(seed)).random((count, 2))
    apart = np.hypot(*(place[:, None] - place[None, :]).transpose(2, 0, 1))
    return {node: [int(each) for each in np.flatnonzero(row < 0.4) if each != node] for node, row in enumerate(apart)}


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    count = draw(st.integers(1, 9))
    pairs = list(combinations(range(count), 2))
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    return {node: [b if a == node else a for a, b in chosen if node in (a, b)] for node in range(count)}


@settings(max_examples=150, deadline=None)
@given(st.one_of(graphs(), st.builds(discs, st.integers(0, 2**32), st.integers(4, 25))))
def test_who_leaves_by_the_criterion_leaves_the_betti_numbers_as_they_were(graph: Graph) -> None:
    before = gudhi_betti(graph)
    for node, robot in swarm(graph).items():
        if robot.redundant():
            left = {
                other: [each for each in listed if each != node] for other, listed in graph.items() if other != node
            }
            assert gudhi_betti(left) == before


@pytest.mark.parametrize(
    ("graph", "redundant"),
    [
        ({0: []}, []),  # nobody is left
        (everyone(2), [0, 1]),
        ({0: [1], 1: [0, 2], 2: [1]}, [0, 2]),  # a chain breaks in the middle
        ({0: [1, 3], 1: [0, 2], 2: [1, 3], 3: [0, 2]}, []),  # a hole would open
        ({0: [1, 2, 3, 4], 1: [0, 2, 4], 2: [0, 1, 3], 3: [0, 2, 4], 4: [0, 1, 3]}, [1, 2, 3, 4]),  # all but the hub
        (everyone(4), [0, 1, 2, 3]),
    ],
)
def test_who_is_redundant_in_small_swarms(graph: Graph, redundant: list[int]) -> None:
    assert [node for node, robot in swarm(graph).items() if robot.redundant()] == redundant


def test_a_neighbour_whose_list_is_not_known_or_does_not_name_the_robot_makes_it_stay() -> None:
    robot = LeaveLock(0, LEASE_S, START_S - LEASE_S)
    robot.see([1, 2], START_S)
    robot.hear(1, NeighbourList(1, (0, 2)), START_S)
    assert not robot.redundant()
    robot.hear(2, NeighbourList(1, (1,)), START_S)
    assert not robot.redundant()
    robot.hear(2, NeighbourList(2, (0, 1)), START_S)
    assert robot.redundant()


def test_an_older_list_that_comes_late_says_nothing() -> None:
    robot = LeaveLock(0, LEASE_S, START_S - LEASE_S)
    robot.see([1], START_S)
    robot.hear(1, NeighbourList(5, ()), START_S)
    robot.hear(1, NeighbourList(4, (0,)), START_S)
    assert not robot.redundant()


# --- locks ----------------------------------------------------------------------------------------------------------


def test_a_robot_leaves_once_all_have_granted() -> None:
    robots = swarm(everyone(3))
    ask = only(robots[0].ask(START_S))
    for other in (1, 2):
        assert not robots[0].leave(START_S)
        (grant,) = robots[other].hear(0, ask, START_S)
        assert grant == LockMessage(0, LockGrant(ask.number))
        assert robots[other].locked(START_S)
        robots[0].hear(other, grant.message, START_S)
    assert robots[0].leave(START_S) == [LockMessage(None, LockRelease(ask.number))]
    assert not robots[0].wants
    robots[1].hear(0, LockRelease(ask.number), START_S)
    assert not robots[1].locked(START_S)


def test_a_copy_of_an_ask_is_granted_again_and_holds_no_longer() -> None:
    robots = swarm(everyone(2))
    ask = only(robots[0].ask(START_S))
    for late_s in (0.0, 5.0):
        assert only(robots[1].hear(0, ask, START_S + late_s)) == LockGrant(ask.number)
    assert not robots[1].locked(START_S + LEASE_S)


def test_an_ask_that_arrives_after_it_is_over_locks_nobody() -> None:
    robots = swarm(everyone(2))
    ask = only(robots[0].ask(START_S))
    (over,) = robots[0].give_up()
    robots[1].hear(0, over.message, START_S)
    assert robots[1].hear(0, ask, START_S) == []
    assert not robots[1].locked(START_S)


def test_who_asks_again_asks_those_that_have_not_granted() -> None:
    robots = swarm(everyone(3))
    ask = only(robots[0].ask(START_S))
    robots[0].hear(2, only(robots[2].hear(0, ask, START_S)), START_S)
    again = only(robots[0].ask(START_S + 1.0))
    assert again == LockRequest(ask.number, tuple(each for each in ask.versions if each[0] == 1))
    robots[0].hear(1, only(robots[1].hear(0, again, START_S + 1.0)), START_S + 1.0)
    assert robots[0].may_leave(START_S + 1.0)
    assert robots[0].ask(START_S + 1.0) == []


def test_a_list_tells_that_a_wish_is_over_where_that_was_lost() -> None:
    robots = swarm(everyone(2))
    robots[1].hear(0, only(robots[0].ask(START_S)), START_S)
    robots[1].hear(0, robots[0].tell(), START_S)
    assert robots[1].locked(START_S)
    robots[0].give_up()
    robots[1].hear(0, robots[0].tell(), START_S)
    assert not robots[1].locked(START_S)


def test_a_lock_is_granted_to_nobody_else_until_it_ends() -> None:
    robots = swarm({0: [1], 1: [0, 2], 2: [1]})
    first, second = only(robots[0].ask(START_S)), only(robots[2].ask(START_S))
    robots[1].hear(0, first, START_S)
    assert only(robots[1].hear(2, second, START_S + LEASE_S - 1e-6)) == LockDenial(second.number)
    assert only(robots[1].hear(2, second, START_S + LEASE_S)) == LockGrant(second.number)


def test_a_wish_ends_long_before_the_locks_and_is_given_up() -> None:
    robots = swarm(everyone(2))
    ask = only(robots[0].ask(START_S))
    robots[0].hear(1, only(robots[1].hear(0, ask, START_S)), START_S)
    assert robots[0].may_leave(START_S + LEASE_S / 2.0 - 1e-6)
    assert not robots[0].may_leave(START_S + LEASE_S / 2.0)
    assert only(robots[0].ask(START_S + LEASE_S / 2.0)) == LockRelease(ask.number)
    assert only(robots[0].ask(START_S + LEASE_S / 2.0)).number > ask.number


def test_of_two_neighbours_that_ask_at_once_the_larger_id_yields() -> None:
    robots = swarm(everyone(2))
    asks = [only(robots[node].ask(START_S)) for node in (0, 1)]
    assert robots[1].hear(0, asks[0], START_S) == [
        LockMessage(None, LockRelease(asks[1].number)),
        LockMessage(0, LockGrant(asks[0].number)),
    ]
    assert only(robots[0].hear(1, asks[1], START_S)) == LockDenial(asks[1].number)
    assert robots[0].wants
    assert not robots[1].wants


def test_an_ask_upon_an_old_list_is_denied_and_the_new_one_told() -> None:
    robots = swarm(everyone(2))
    ask = only(robots[0].ask(START_S))
    robots[1].see([0, 7], START_S)
    assert robots[1].hear(0, ask, START_S) == [LockMessage(0, LockDenial(ask.number)), LockMessage(0, robots[1].tell())]
    robots[0].hear(1, LockDenial(ask.number), START_S)
    assert not robots[0].wants


def test_who_sees_somebody_come_or_go_does_not_leave_upon_the_grants_it_has() -> None:
    for seen in ([1, 7], []):
        robots = swarm(everyone(2))
        ask = only(robots[0].ask(START_S))
        robots[0].hear(1, only(robots[1].hear(0, ask, START_S)), START_S)
        robots[0].see(seen, START_S)
        assert not robots[0].leave(START_S)
        assert only(robots[0].ask(START_S)) == LockRelease(ask.number)


def test_who_has_left_or_moves_grants_nothing_until_it_stands_again() -> None:
    robots = swarm(everyone(2))
    robots[1].depart()
    ask = only(robots[0].ask(START_S))
    assert only(robots[1].hear(0, ask, START_S)) == LockDenial(ask.number)
    robots[1].settle()
    assert only(robots[1].hear(0, ask, START_S)) == LockGrant(ask.number)


def test_a_robot_that_lost_its_memory_stands_still_and_grants_nothing_for_a_lease() -> None:
    robots = swarm(everyone(2))
    ask = only(robots[0].ask(START_S))
    reborn = LeaveLock(1, LEASE_S, START_S)
    reborn.see([0], START_S)
    assert reborn.locked(START_S + LEASE_S - 1e-6)
    assert only(reborn.hear(0, ask, START_S + LEASE_S - 1e-6)) == LockDenial(ask.number)
    assert not reborn.locked(START_S + LEASE_S)
    assert not LeaveLock(1, LEASE_S, START_S, quiet_s=0.0).locked(START_S)


def test_a_robot_that_lost_its_memory_repeats_no_version_and_no_number() -> None:
    before, after = LeaveLock(0, LEASE_S, 0.0), LeaveLock(0, LEASE_S, START_S)
    for now_s, robot in ((1.0, before), (START_S, after)):
        for seen in ([1], [2], [1]):
            robot.see(seen, now_s)
    assert after.tell().listed == before.tell().listed
    assert after.tell().version > before.tell().version


@pytest.mark.parametrize(
    "message",
    [
        NeighbourList(3, (1, 2), 4),
        NeighbourList(3, ()),
        LockRequest(7, ((1, 3), (2, 5))),
        LockGrant(7),
        LockDenial(7),
        LockRelease(7),
    ],
)
def test_every_message_survives_the_wire(message: Message) -> None:
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(message), type=Message) == message


# --- with everything going wrong ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    """Return the benchmark, which imports another one."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        return importlib.import_module("bench_redundancy")
    finally:
        sys.path.remove(str(ROOT / "benchmarks"))


@pytest.mark.parametrize("loss", [0.1, 0.4])
def test_no_departure_among_crashes_moves_and_lost_messages_changes_b0_or_b1(bench: ModuleType, loss: float) -> None:
    troubled = bench.Troubled(24, seed=1, loss=loss)
    troubled.run(200)
    assert troubled.departures > 10
    assert troubled.violations == 0


def test_without_locks_the_checker_sees_harm_done(bench: ModuleType) -> None:
    troubled = bench.Troubled(24, seed=1, loss=0.3, kind=bench.Unlocked)
    troubled.run(400)
    assert troubled.violations > 0
