"""Requests to leave under every interleaving: no two neighbours leave together, and neither b0 nor b1 changes.

All connected graphs of up to five robots, and every two requesting robots (or one with two requests), up to symmetry.
"""

from collections.abc import Iterator
from itertools import combinations, combinations_with_replacement, permutations
from typing import Any

import networkx
import pytest
from interleavings import Budget, Explorer, Graph, Violation

from zwerm.agents.sensor_coverage.messages.locks import LockGrant, LockProtocolMessage, LockRequest
from zwerm.agents.sensor_coverage.protocols.component import Outgoing
from zwerm.agents.sensor_coverage.protocols.leave_lock import LeaveLock


def connected_graphs(largest: int, smallest: int = 2) -> list[Graph]:
    """Return one of every kind."""
    atlas = [each for each in networkx.graph_atlas_g() if smallest <= len(each) <= largest]
    return [{node: tuple(sorted(each[node])) for node in sorted(each)} for each in atlas if networkx.is_connected(each)]


def pairs(graph: Graph) -> Iterator[tuple[int, int]]:
    """Yield the pairs of robots that differ, ids of others aside: `first` is the one that does not yield."""
    edges = {(a, b) for a, listed in graph.items() for b in listed}
    symmetries = [
        each for each in permutations(sorted(graph)) if all((each[a], each[b]) in edges for a, b in sorted(edges))
    ]
    done: set[tuple[int, int]] = set()
    for first, second in combinations_with_replacement(sorted(graph), 2):
        if (first, second) not in done:
            done.update((each[first], each[second]) for each in symmetries)
            yield first, second


def explore(graphs: list[Graph], kind: type[LeaveLock] = LeaveLock, **budget: Any) -> tuple[int, int]:
    """Visit all states; return their number, and the number of those in which a robot left."""
    states = departures = 0
    for graph in graphs:
        for asks in pairs(graph):
            explorer = Explorer(graph, Budget(asks, **budget), kind)
            states += explorer.explore()
            departures += explorer.departures
    return states, departures


# --- with messages lost, late and copied, and memory lost -----------------------------------------------------------


def test_of_five_robots_no_two_neighbours_leave_together_and_no_departure_changes_b0_or_b1() -> None:
    states, departures = explore(connected_graphs(5))
    assert states > 10_000
    assert departures > 500


def test_no_departure_is_unsafe_when_locks_and_requests_expire() -> None:
    _, departures = explore(connected_graphs(3), ticks=2)
    assert departures > 100


def test_no_departure_is_unsafe_when_robots_lose_their_memory() -> None:
    _, departures = explore(connected_graphs(3), ticks=2, amnesias=1)
    assert departures > 500


def slots(robots: int) -> list[tuple[int, tuple[int, ...]]]:
    """Return the sets of robots that one robot may see after it was moved."""
    others = range(robots - 1)
    return [(robots - 1, each) for size in range(robots) for each in combinations(others, size)]


@pytest.mark.parametrize("slot", slots(3))
@pytest.mark.parametrize("comes", [False, True])
def test_no_departure_is_unsafe_when_one_robot_comes_or_is_moved(
    slot: tuple[int, tuple[int, ...]], comes: bool
) -> None:
    _, departures = explore(connected_graphs(3, 3), ticks=1, moving=slot, comes=comes)
    assert departures > 20


def test_no_departure_is_unsafe_when_one_of_four_robots_is_moved() -> None:
    _, departures = explore(connected_graphs(4, 4), moving=(3, (0, 1)))
    assert departures > 100


# --- when another node finds the robots that may leave ----------------------------------------------------------------


class Advised(LeaveLock):
    """Relies on lists from earlier advice that it may leave, and ignores all later messages and sightings."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._versions: tuple[tuple[int, int], ...] = ()

    def receive(self, sender: int, message: LockProtocolMessage, now_s: float) -> list[Outgoing]:
        sent = super().receive(sender, message, now_s)
        if self.redundant():
            self._versions = tuple((node, self._lists[node].version) for node in self._listed)
        return sent

    def request(self, now_s: float, versions: tuple[tuple[int, int], ...] | None = None) -> list[Outgoing]:
        return super().request(now_s, self._versions)


def test_no_departure_is_unsafe_when_robots_rely_on_advice_from_old_lists() -> None:
    _, departures = explore(connected_graphs(4), Advised)
    assert departures > 100
    _, moved = explore(connected_graphs(3, 3), Advised, ticks=1, moving=(2, (0,)))
    assert moved > 20


class Credulous(Advised):
    """Grants a lock for any version of its list."""

    def _answer(self, requester: int, request: LockRequest, now_s: float) -> list[Outgoing]:
        return super()._answer(requester, LockRequest(request.number, ((self._me, self._version),)), now_s)


def test_advice_from_old_lists_is_unsafe_if_neighbours_do_not_check_list_versions() -> None:
    with pytest.raises(Violation):
        explore(connected_graphs(4, 4), Credulous, moving=(3, (0, 2)))


# --- and each part of the protocol is needed ------------------------------------------------------------------------


class Unlocked(LeaveLock):
    """Leaves as soon as it is redundant by its lists, without locks."""

    def may_leave(self, now_s: float) -> bool:
        return self.wants


class Impatient(LeaveLock):
    """Does not wait for the last grant."""

    def may_leave(self, now_s: float) -> bool:
        request = self._request
        return request is not None and not self.locked(now_s) and len(request.granted) >= len(self._listed) - 1


class AnyVersion(LeaveLock):
    """Grants a lock for any version of its list."""

    def _answer(self, requester: int, request: LockRequest, now_s: float) -> list[Outgoing]:
        return super()._answer(requester, LockRequest(request.number, ((self._me, self._version),)), now_s)


class Late(LeaveLock):
    """Leaves at any time after its request."""

    def _may_still_act(self, request: Any, now_s: float) -> bool:
        return request.version == self._version


class Generous(LeaveLock):
    """Grants locks during its own request, and leaves nevertheless."""

    def _answer(self, requester: int, request: LockRequest, now_s: float) -> list[Outgoing]:
        own, self._request = self._request, None
        answer = super()._answer(requester, request, now_s)
        self._request = own
        return answer

    def _free_to_act(self, now_s: float) -> bool:
        return self._stands


class Fickle(LeaveLock):
    """Accepts a grant for any of its request numbers."""

    def receive(self, sender: int, message: LockProtocolMessage, now_s: float) -> list[Outgoing]:
        if self._request is not None and isinstance(message, LockGrant):
            return super().receive(sender, LockGrant(self._request.message.number), now_s)
        return super().receive(sender, message, now_s)


class Rash(LeaveLock):
    """Grants locks immediately after a restart."""

    def __init__(self, me: int, lease_s: float, now_s: float) -> None:
        super().__init__(me, lease_s, now_s)
        self._quiet_until_s = now_s


class Ghost(LeaveLock):
    """Grants locks after it has left."""

    def _answer(self, requester: int, request: LockRequest, now_s: float) -> list[Outgoing]:
        stands, self._stands = self._stands, True
        answer = super()._answer(requester, request, now_s)
        self._stands = stands
        return answer


class Blind(LeaveLock):
    """Leaves although it sees other robots than at its request."""

    def may_leave(self, now_s: float) -> bool:
        request = self._request
        return request is not None and not self.locked(now_s) and len(request.granted) == len(request.message.versions)


@pytest.mark.parametrize(
    ("kind", "robots", "budget"),
    [
        (Unlocked, 2, {}),
        (Impatient, 2, {}),
        (AnyVersion, 4, {"moving": (3, (0, 2))}),
        (Late, 2, {"ticks": 2, "moving": (1, ())}),
        (Generous, 2, {}),
        (Fickle, 2, {"moving": (1, ())}),
        (Rash, 3, {"ticks": 2, "amnesias": 1, "moving": (2, ())}),
        (Ghost, 4, {}),
        (Blind, 3, {"moving": (2, (0,)), "comes": True}),
    ],
)
def test_the_search_finds_a_violation_without_each_part_of_the_protocol(
    kind: type[LeaveLock], robots: int, budget: dict[str, Any]
) -> None:
    with pytest.raises(Violation):
        explore(connected_graphs(robots, robots), kind, **budget)
