"""Departures: the criterion compared with gudhi, and the rules of the locks one by one. All interleavings are in
test_interleavings.py."""

import importlib
from itertools import combinations
from types import ModuleType

import gudhi
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.agents.sensor_coverage.messages.locks import (
    LockDenial,
    LockGrant,
    LockProtocolMessage,
    LockRelease,
    LockRequest,
    NeighbourList,
)
from zwerm.agents.sensor_coverage.protocols.component import Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock

LEASE_S = 10.0
START_S = 100.0

Graph = dict[int, list[int]]


def swarm(graph: Graph) -> dict[int, LeaveLock]:
    """Return robots that stand there, and know each other's lists."""
    robots = {node: LeaveLock(node, LEASE_S, START_S - LEASE_S) for node in graph}
    for node, robot in robots.items():
        robot.update(graph[node], START_S)
    for node, robot in robots.items():
        for other in graph[node]:
            robot.receive(other, robots[other].neighbour_list(), START_S)
    return robots


def everyone(count: int) -> Graph:
    return {node: [other for other in range(count) if other != node] for node in range(count)}


def only(sent: list[Outgoing]) -> LockProtocolMessage:
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
    slot = np.random.Generator(np.random.Philox(seed)).random((count, 2))
    apart = np.hypot(*(slot[:, None] - slot[None, :]).transpose(2, 0, 1))
    return {node: [int(each) for each in np.flatnonzero(row < 0.4) if each != node] for node, row in enumerate(apart)}


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    count = draw(st.integers(1, 9))
    pairs = list(combinations(range(count), 2))
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    return {node: [b if a == node else a for a, b in chosen if node in (a, b)] for node in range(count)}


@settings(max_examples=150, deadline=None)
@given(st.one_of(graphs(), st.builds(discs, st.integers(0, 2**32), st.integers(4, 25))))
def test_a_departure_by_the_link_criterion_changes_no_betti_number(graph: Graph) -> None:
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
        ({0: []}, []),  # no robot is left
        (everyone(2), [0, 1]),
        ({0: [1], 1: [0, 2], 2: [1]}, [0, 2]),  # a chain breaks in the middle
        ({0: [1, 3], 1: [0, 2], 2: [1, 3], 3: [0, 2]}, []),  # a hole would open
        ({0: [1, 2, 3, 4], 1: [0, 2, 4], 2: [0, 1, 3], 3: [0, 2, 4], 4: [0, 1, 3]}, [1, 2, 3, 4]),  # all but the hub
        (everyone(4), [0, 1, 2, 3]),
    ],
)
def test_the_link_criterion_finds_the_redundant_robots_of_small_swarms(graph: Graph, redundant: list[int]) -> None:
    assert [node for node, robot in swarm(graph).items() if robot.redundant()] == redundant


def test_a_robot_stays_if_a_neighbours_list_is_unknown_or_does_not_name_it() -> None:
    robot = LeaveLock(0, LEASE_S, START_S - LEASE_S)
    robot.update([1, 2], START_S)
    robot.receive(1, NeighbourList(1, (0, 2)), START_S)
    assert not robot.redundant()
    robot.receive(2, NeighbourList(1, (1,)), START_S)
    assert not robot.redundant()
    robot.receive(2, NeighbourList(2, (0, 1)), START_S)
    assert robot.redundant()


def test_a_late_older_neighbour_list_is_ignored() -> None:
    robot = LeaveLock(0, LEASE_S, START_S - LEASE_S)
    robot.update([1], START_S)
    robot.receive(1, NeighbourList(5, ()), START_S)
    robot.receive(1, NeighbourList(4, (0,)), START_S)
    assert not robot.redundant()


# --- locks ----------------------------------------------------------------------------------------------------------


def test_a_robot_leaves_once_all_neighbours_have_granted_its_lock() -> None:
    robots = swarm(everyone(3))
    request = only(robots[0].request(START_S))
    for other in (1, 2):
        assert not robots[0].leave(START_S)
        (grant,) = robots[other].receive(0, request, START_S)
        assert grant == Outgoing(0, LockGrant(request.number))
        assert robots[other].locked(START_S)
        robots[0].receive(other, grant.message, START_S)
    assert robots[0].leave(START_S) == [Outgoing(None, LockRelease(request.number))]
    assert not robots[0].wants
    robots[1].receive(0, LockRelease(request.number), START_S)
    assert not robots[1].locked(START_S)


def test_a_repeated_lock_request_is_granted_again_without_a_longer_lease() -> None:
    robots = swarm(everyone(2))
    request = only(robots[0].request(START_S))
    for late_s in (0.0, 5.0):
        assert only(robots[1].receive(0, request, START_S + late_s)) == LockGrant(request.number)
    assert not robots[1].locked(START_S + LEASE_S)


def test_a_lock_request_that_arrives_after_its_release_locks_no_robot() -> None:
    robots = swarm(everyone(2))
    request = only(robots[0].request(START_S))
    (over,) = robots[0].give_up()
    robots[1].receive(0, over.message, START_S)
    assert robots[1].receive(0, request, START_S) == []
    assert not robots[1].locked(START_S)


def test_a_repeated_lock_request_names_the_neighbours_that_have_not_granted() -> None:
    robots = swarm(everyone(3))
    request = only(robots[0].request(START_S))
    robots[0].receive(2, only(robots[2].receive(0, request, START_S)), START_S)
    again = only(robots[0].request(START_S + 1.0))
    assert again == LockRequest(request.number, tuple(each for each in request.versions if each[0] == 1))
    robots[0].receive(1, only(robots[1].receive(0, again, START_S + 1.0)), START_S + 1.0)
    assert robots[0].may_leave(START_S + 1.0)
    assert robots[0].request(START_S + 1.0) == []


def test_a_neighbour_list_replaces_a_lost_lock_release() -> None:
    robots = swarm(everyone(2))
    robots[1].receive(0, only(robots[0].request(START_S)), START_S)
    robots[1].receive(0, robots[0].neighbour_list(), START_S)
    assert robots[1].locked(START_S)
    robots[0].give_up()
    robots[1].receive(0, robots[0].neighbour_list(), START_S)
    assert not robots[1].locked(START_S)


def test_a_robot_grants_no_second_lock_before_the_first_ends() -> None:
    robots = swarm({0: [1], 1: [0, 2], 2: [1]})
    first, second = only(robots[0].request(START_S)), only(robots[2].request(START_S))
    robots[1].receive(0, first, START_S)
    assert only(robots[1].receive(2, second, START_S + LEASE_S - 1e-6)) == LockDenial(second.number)
    assert only(robots[1].receive(2, second, START_S + LEASE_S)) == LockGrant(second.number)


def test_a_lock_request_expires_before_its_locks_and_is_withdrawn() -> None:
    robots = swarm(everyone(2))
    request = only(robots[0].request(START_S))
    robots[0].receive(1, only(robots[1].receive(0, request, START_S)), START_S)
    assert robots[0].may_leave(START_S + LEASE_S / 2.0 - 1e-6)
    assert not robots[0].may_leave(START_S + LEASE_S / 2.0)
    assert only(robots[0].request(START_S + LEASE_S / 2.0)) == LockRelease(request.number)
    assert only(robots[0].request(START_S + LEASE_S / 2.0)).number > request.number


def test_of_two_neighbours_that_request_locks_together_the_larger_id_yields() -> None:
    robots = swarm(everyone(2))
    asks = [only(robots[node].request(START_S)) for node in (0, 1)]
    assert robots[1].receive(0, asks[0], START_S) == [
        Outgoing(None, LockRelease(asks[1].number)),
        Outgoing(0, LockGrant(asks[0].number)),
    ]
    assert only(robots[0].receive(1, asks[1], START_S)) == LockDenial(asks[1].number)
    assert robots[0].wants
    assert not robots[1].wants


def test_a_lock_request_with_an_old_list_version_is_denied_with_the_new_list() -> None:
    robots = swarm(everyone(2))
    request = only(robots[0].request(START_S))
    robots[1].update([0, 7], START_S)
    assert robots[1].receive(0, request, START_S) == [
        Outgoing(0, LockDenial(request.number)),
        Outgoing(0, robots[1].neighbour_list()),
    ]
    robots[0].receive(1, LockDenial(request.number), START_S)
    assert not robots[0].wants


def test_a_robot_whose_view_changed_does_not_leave_by_earlier_grants() -> None:
    for seen in ([1, 7], []):
        robots = swarm(everyone(2))
        request = only(robots[0].request(START_S))
        robots[0].receive(1, only(robots[1].receive(0, request, START_S)), START_S)
        robots[0].update(seen, START_S)
        assert not robots[0].leave(START_S)
        assert only(robots[0].request(START_S)) == LockRelease(request.number)


def test_a_robot_that_left_or_moves_grants_no_lock_until_it_stands_again() -> None:
    robots = swarm(everyone(2))
    robots[1].depart()
    request = only(robots[0].request(START_S))
    assert only(robots[1].receive(0, request, START_S)) == LockDenial(request.number)
    robots[1].settle()
    assert only(robots[1].receive(0, request, START_S)) == LockGrant(request.number)


def test_a_robot_that_lost_its_memory_stands_still_and_grants_no_lock_for_one_lease() -> None:
    robots = swarm(everyone(2))
    request = only(robots[0].request(START_S))
    reborn = LeaveLock(1, LEASE_S, START_S)
    reborn.update([0], START_S)
    assert reborn.locked(START_S + LEASE_S - 1e-6)
    assert only(reborn.receive(0, request, START_S + LEASE_S - 1e-6)) == LockDenial(request.number)
    assert not reborn.locked(START_S + LEASE_S)
    assert not LeaveLock(1, LEASE_S, START_S, quiet_s=0.0).locked(START_S)


def test_a_robot_that_lost_its_memory_repeats_no_version_and_no_number() -> None:
    before, after = LeaveLock(0, LEASE_S, 0.0), LeaveLock(0, LEASE_S, START_S)
    for now_s, robot in ((1.0, before), (START_S, after)):
        for seen in ([1], [2], [1]):
            robot.update(seen, now_s)
    assert after.neighbour_list().listed == before.neighbour_list().listed
    assert after.neighbour_list().version > before.neighbour_list().version


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
def test_every_message_survives_the_wire(message: LockProtocolMessage) -> None:
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(message), type=LockProtocolMessage) == message


# --- with everything going wrong ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    """Return the benchmark, which imports another one."""
    return importlib.import_module("benchmarks.algorithms.bench_redundancy")


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
