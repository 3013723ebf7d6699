"""The route to the frontier, on networks that lose, delay, copy and reorder messages."""

from collections.abc import Iterable
from itertools import combinations

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from zwerm.agents.sensor_coverage.frontier.paths import cheapest_routes
from zwerm.agents.sensor_coverage.messages.beacons import PathVector, Route
from zwerm.agents.sensor_coverage.messages.peers import read, write
from zwerm.agents.sensor_coverage.protocols.path_vector import RENEW_TICKS, PathVectorProtocol
from zwerm.maths.simplicial import Edge, FlagComplex, edge

OBSTACLE_COST = 3.0


class Network:
    """Robots at places of the same numbers (1 and up), edges with their weights, and all messages in flight."""

    def __init__(
        self, count: int, weights: dict[Edge, float], kind: type[PathVectorProtocol] = PathVectorProtocol
    ) -> None:
        self.weights = dict(weights)
        self.robots = {slot: kind() for slot in range(1, count + 1)}
        self.told = dict.fromkeys(self.robots, 0)
        self.roots: dict[int, None] = {}
        self.under_way: list[tuple[int, int, PathVector]] = []
        self.tick = 0

    def beside(self, slot: int) -> dict[int, float]:
        return {other: self.weights[edge(slot, other)] for other in self.robots if edge(slot, other) in self.weights}

    def tell(self, slot: int) -> None:
        robot = self.robots[slot]
        self.tick += 1
        robot.choose(slot, 0.0 if slot in self.roots else None, self.beside(slot), self.tick)
        self.told[slot] += 1
        way = PathVector(self.told[slot], slot, robot.route, robot.ended)
        self.under_way += [(slot, other, way) for other in self.beside(slot)]

    def deliver(self, sender: int, receiver: int, way: PathVector) -> None:
        if edge(sender, receiver) in self.weights:
            self.robots[receiver].receive(sender, way)

    def round(self, slots: Iterable[int]) -> None:
        """Let all robots send their routes, without loss."""
        for slot in slots:
            self.tell(slot)
        arrived, self.under_way = self.under_way, []
        for each in arrived:
            self.deliver(*each)

    def costs(self) -> dict[int, float]:
        return {slot: robot.route.cost for slot, robot in self.robots.items() if robot.route is not None}

    def true_costs(self) -> dict[int, float]:
        lists = {slot: list(self.beside(slot)) for slot in self.robots}
        obstacle = [each for each, weight in self.weights.items() if weight > 1.0]
        return cheapest_routes(FlagComplex(lists), dict.fromkeys(self.roots, 0.0), obstacle, OBSTACLE_COST).cost


def line(count: int) -> dict[Edge, float]:
    return {(n, n + 1): 1.0 for n in range(1, count)}


def grid(side: int) -> dict[Edge, float]:
    return {
        (a + 1, b + 1): OBSTACLE_COST if (a + b) % 5 == 0 else 1.0
        for a, b in combinations(range(side * side), 2)
        if abs(a // side - b // side) + abs(a % side - b % side) == 1
    }


def settled(network: Network, rounds: int) -> Network:
    for _ in range(rounds):
        network.round(network.robots)
    return network


# --- with messages lost, late and repeated --------------------------------------------------------------------------


class Lossy(RuleBasedStateMachine):
    """Messages are lost, delayed, copied and delivered in any order; edges and roots change; robots lose their memory."""

    @initialize(data=st.data(), count=st.integers(2, 6))
    def build(self, data: st.DataObject, count: int) -> None:
        self.pairs = list(combinations(range(1, count + 1), 2))
        chosen = data.draw(st.lists(st.sampled_from(self.pairs), unique=True))
        self.network = Network(count, {pair: data.draw(st.sampled_from((1.0, OBSTACLE_COST))) for pair in chosen})

    def a_place(self, data: st.DataObject) -> int:
        return data.draw(st.integers(1, len(self.network.robots)))

    @rule(data=st.data())
    def tell(self, data: st.DataObject) -> None:
        self.network.tell(self.a_place(data))

    @precondition(lambda self: self.network.under_way)
    @rule(data=st.data(), copies=st.integers(0, 2))
    def deliver_lose_or_copy(self, data: st.DataObject, copies: int) -> None:
        under_way = self.network.under_way
        number = data.draw(st.integers(0, len(under_way) - 1))
        if copies > 0:
            self.network.deliver(*under_way[number])
        if copies < 2:
            under_way.pop(number)

    @rule(data=st.data())
    def toggle_a_root(self, data: st.DataObject) -> None:
        slot, roots = self.a_place(data), self.network.roots
        if slot in roots:
            del roots[slot]
        else:
            roots[slot] = None

    @rule(data=st.data(), weight=st.sampled_from((0.0, 1.0, OBSTACLE_COST)))
    def change_an_edge(self, data: st.DataObject, weight: float) -> None:
        pair = data.draw(st.sampled_from(self.pairs))
        if weight:
            self.network.weights[pair] = weight
        else:
            self.network.weights.pop(pair, None)

    @rule(data=st.data())
    def forget_all_ways(self, data: st.DataObject) -> None:
        self.network.robots[self.a_place(data)] = PathVectorProtocol()

    @invariant()
    def no_way_comes_by_a_place_twice_so_nobody_counts_further_than_there_are_places(self) -> None:
        for slot, robot in self.network.robots.items():
            if robot.route is not None:
                assert robot.route.slots[0] == slot
                assert len(set(robot.route.slots)) == len(robot.route.slots) <= len(self.network.robots)
                assert robot.route.cost <= OBSTACLE_COST * (len(robot.route.slots) - 1)

    def teardown(self) -> None:
        """After the last loss, routes become the shortest of the graph, and stay so."""
        if not hasattr(self, "network"):
            return
        network = settled(self.network, rounds=2 * len(self.network.robots) + 1)
        for _ in range(3):
            network.round(reversed(network.robots))
            assert network.costs() == network.true_costs()
            for robot in network.robots.values():
                if robot.route is not None:
                    hops = zip(robot.route.slots, robot.route.slots[1:], strict=False)
                    assert robot.route.cost == sum(network.weights[edge(*hop)] for hop in hops)
                    assert robot.route.slots[-1] in network.roots


Lossy.TestCase.settings = settings(
    max_examples=150, stateful_step_count=40, deadline=None, suppress_health_check=list(HealthCheck)
)
TestAnyFiniteSequenceOfFaults = Lossy.TestCase


# --- a root that is cut off -----------------------------------------------------------------------------------------


class Gullible(PathVectorProtocol):
    """A negative control, plain distance vector: accepts routes through its own slot, up to a length."""

    def choose(self, slot: int, cost: float | None, weights: dict[int, float], tick: int) -> None:  # type: ignore[override]
        best = None if cost is None else Route(cost, (slot,))
        for beside, weight in weights.items():
            way = self._routes.get(beside)
            if way is not None and way.cost < 99.0 and (best is None or way.cost + weight < best.cost):
                best = Route(way.cost + weight, (slot, *way.slots))
        self.route = best


def after_the_cut(kind: type[PathVectorProtocol], loss: float, delay: int, seed: int, rounds: int = 400) -> list[float]:
    """Disconnect a settled grid's only root; return the costs sent from then on until no robot sends any."""
    random = np.random.Generator(np.random.Philox(seed))
    network = Network(16, grid(4), kind)
    network.roots[1] = None
    settled(network, 12)
    assert network.costs() == network.true_costs()
    network.weights = {pair: weight for pair, weight in network.weights.items() if 1 not in pair}
    told: list[float] = []
    queue: list[tuple[int, tuple[int, int, PathVector]]] = []
    for now in range(rounds):
        for slot in random.permutation(range(2, 17)).tolist():
            network.tell(slot)
        queue += [(now + int(random.integers(0, delay + 1)), e) for e in network.under_way if random.random() >= loss]
        network.under_way = []
        for _, each in [each for each in queue if each[0] <= now]:
            network.deliver(*each)
        queue = [each for each in queue if each[0] > now]
        costs = [cost for slot, cost in network.costs().items() if slot != 1]
        if not costs:
            return told
        told += costs
    return told


@pytest.mark.parametrize(("loss", "delay"), [(0.0, 0), (0.3, 2), (0.6, 3), (0.9, 0)])
def test_after_the_frontier_is_cut_off_routes_end_and_costs_stay_bounded_by_the_slots(loss: float, delay: int) -> None:
    for seed in range(3):
        told = after_the_cut(PathVectorProtocol, loss, delay, seed)
        assert len(told) < 400 * 15, "it ends"
        assert max(told, default=0.0) <= 15 * OBSTACLE_COST


def test_a_distance_vector_without_slots_counts_to_infinity() -> None:
    assert max(after_the_cut(Gullible, 0.0, 0, seed=1, rounds=100)) > 15 * OBSTACLE_COST


@pytest.mark.parametrize("weights", [line(3), {(1, 2): 1.0, (1, 3): 1.0, (2, 3): 1.0}])
def test_two_robots_do_not_route_through_each_other_when_the_frontier_goes(weights: dict[Edge, float]) -> None:
    network = Network(3, weights)
    network.roots[1] = None
    settled(network, 4)
    network.weights = {pair: weight for pair, weight in weights.items() if 1 not in pair}
    settled(network, 2)
    assert network.robots[2].route is network.robots[3].route is None


# --- what is believed -----------------------------------------------------------------------------------------------


def test_a_route_along_an_obstacle_edge_costs_more() -> None:
    network = Network(4, {(1, 2): 1.0, (2, 3): 1.0, (1, 4): 1.0, (3, 4): OBSTACLE_COST})
    network.roots[1] = None
    settled(network, 4)
    assert network.robots[3].route == Route(2.0, (3, 2, 1), claim=1)


def test_of_equal_routes_the_one_to_the_smallest_slot_wins_and_then_the_one_through_the_smallest() -> None:
    robot = PathVectorProtocol()
    for slot, root in ((5, 4), (3, 4), (2, 7), (1, 8)):
        robot.receive(slot, PathVector(1, slot, Route(1.0, (slot, root), 5)))
    robot.choose(9, None, dict.fromkeys((5, 3, 2, 1), 1.0), 9)
    assert robot.route == Route(2.0, (9, 3, 4), 5)


def test_no_route_leads_through_the_base() -> None:
    robot = PathVectorProtocol()
    robot.receive(0, PathVector(1, 0, Route(1.0, (0, 7), 5)))
    robot.choose(9, None, {0: 1.0}, 9)
    assert robot.route is None


def test_routes_lead_to_the_nearest_frontier_robot_and_to_the_other_once_it_ends_its_claim() -> None:
    network = Network(5, line(5))
    network.roots.update({1: None, 5: None})
    settled(network, 5)
    assert network.costs() == {1: 0.0, 2: 1.0, 3: 2.0, 4: 1.0, 5: 0.0}
    del network.roots[5]
    settled(network, 6)
    assert network.costs() == {1: 0.0, 2: 1.0, 3: 2.0, 4: 3.0, 5: 4.0}


def test_a_late_older_path_vector_and_a_copy_change_nothing() -> None:
    robot = PathVectorProtocol()
    robot.receive(4, PathVector(7, 1, Route(0.0, (1,), 5)))
    version = robot.version
    robot.receive(4, PathVector(6, 1, None))
    robot.receive(4, PathVector(7, 1, None))
    robot.choose(2, None, {1: 1.0}, 9)
    assert robot.route == Route(1.0, (2, 1), 5)
    assert robot.version == version


def test_a_route_belongs_to_a_slot_and_outlives_its_occupant() -> None:
    robot = PathVectorProtocol()
    robot.receive(4, PathVector(7, 1, Route(1.0, (1, 5), 5)))
    robot.receive(4, PathVector(8, 6, None))  # it has gone on, and tells of another place
    robot.choose(2, None, {1: 1.0, 6: 1.0}, 9)
    assert robot.route == Route(2.0, (2, 1, 5), 5)
    robot.take_over(1, None)
    assert robot.route == Route(1.0, (1, 5), 5)
    robot.receive(9, PathVector(1, 1, None))  # the robot that stands there now
    robot.choose(2, None, {1: 1.0, 6: 1.0}, 9)
    assert robot.route is None


def test_all_routes_to_a_slot_end_when_it_is_announced_as_ended() -> None:
    robot = PathVectorProtocol()
    robot.receive(4, PathVector(1, 4, Route(1.0, (4, 7), 5)))
    robot.receive(3, PathVector(1, 3, Route(2.0, (3, 5, 7), 5)))
    robot.receive(4, PathVector(2, 4, None, ended=((7, 8),)))
    robot.choose(2, None, {3: 1.0, 4: 1.0}, 9)
    assert robot.route is None
    assert robot.ended == ((7, 8),)
    robot.receive(3, PathVector(2, 3, Route(2.0, (3, 5, 7), 10)))  # it is again
    robot.choose(2, None, {3: 1.0, 4: 1.0}, 11)
    assert robot.route == Route(3.0, (2, 3, 5, 7), 10)


def test_a_new_frontier_claim_of_a_robot_ends_its_earlier_claim() -> None:
    robot = PathVectorProtocol()
    robot.choose(2, 0.0, {}, 5)
    robot.choose(2, 0.0, {}, 6)
    assert robot.route == Route(0.0, (2,), 1)
    robot.claim(2, 1000.0, 7)
    assert (robot.route, robot.ended) == (Route(1000.0, (2,), 2), ((2, 1),))
    robot.choose(2, None, {}, 9)
    assert (robot.route, robot.ended) == (None, ((2, 2),))


def test_a_claim_is_renewed_after_a_time_of_the_robots_own_clock() -> None:
    robot = PathVectorProtocol()
    for tick, claim in ((10_000, 1), (10_000 + RENEW_TICKS, 1), (10_001 + RENEW_TICKS, 2)):
        robot.choose(2, 0.0, {}, tick)
        assert robot.route == Route(0.0, (2,), claim)


def test_claims_of_a_slot_go_on_counting_with_its_next_occupant() -> None:
    follower, other = PathVectorProtocol(), PathVectorProtocol()
    other.receive(4, PathVector(2, 2, None, ended=((2, 8),)))  # the follower has not received that
    follower.take_over(2, None, claims=8)
    follower.choose(2, 0.0, {}, 1)
    other.receive(6, PathVector(1, 2, follower.route))
    other.choose(3, None, {2: 1.0}, 1)
    assert other.route == Route(1.0, (3, 2), 9)


@pytest.mark.parametrize("rumour", [PathVector(7, 3, None, ended=((2, 8),)), PathVector(7, 3, Route(1.0, (3, 2), 8))])
@pytest.mark.parametrize("cost", [0.0, None])
def test_a_robot_overrules_a_newer_claim_of_its_slot_that_is_not_its_own(
    rumour: PathVector, cost: float | None
) -> None:
    """An earlier occupant made it, or a former incarnation; no clock tells which is newer."""
    robot, other = PathVectorProtocol(), PathVectorProtocol()
    robot.choose(2, 0.0, {}, 5)
    for each in (robot, other):
        each.receive(3, rumour)
    robot.choose(2, cost, {}, 6)
    other.receive(4, PathVector(9, 2, robot.route, robot.ended))
    other.choose(5, None, {2: 1.0, 3: 1.0}, 6)
    assert other.route == (None if cost is None else Route(1.0, (5, 2), 9))


def test_the_claim_of_a_neighbour_that_is_dead_or_lost_its_memory_ends() -> None:
    robot, other = PathVectorProtocol(), PathVectorProtocol()
    robot.receive(4, PathVector(7, 2, Route(0.0, (2,), 5)))
    other.receive(1, PathVector(1, 3, Route(1.0, (3, 2), 5)))
    robot.forget(4, 2)
    other.receive(1, PathVector(2, 6, None, robot.ended))
    for each in (robot, other):
        each.choose(9, None, {2: 1.0, 3: 1.0}, 9)
        assert each.route is None
    robot.receive(4, PathVector(1, 2, Route(0.0, (2,), 6)))  # its next incarnation counts from the start
    robot.choose(9, None, {2: 1.0}, 9)
    assert robot.route == Route(1.0, (9, 2), 6)


def test_a_path_vector_survives_the_wire() -> None:
    for way in (PathVector(1, 2, Route(4.5, (2, 3), 7), ((4, 5),)), PathVector(1, 2, None)):
        assert read(write(way)) == way
