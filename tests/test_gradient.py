"""The hop gradient, on networks that lose, delay, copy and reorder what robots say."""

from collections.abc import Iterable
from itertools import combinations

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from zwerm.agents.sensor_coverage.gradient import Advert, Gradient
from zwerm.frontier.paths import reach
from zwerm.simplicial import Edge, FlagComplex, edge

OBSTACLE_COST = 3.0
CAP = 12.0
EXPIRY_S = 8.0


class Network:
    """Robots, the edges between them with their weights, and every advert that is under way."""

    def __init__(self, count: int, weights: dict[Edge, float], kind: type[Gradient] = Gradient) -> None:
        self.weights = dict(weights)
        self.robots = [kind(node, CAP, EXPIRY_S) for node in range(count)]
        self.roots: dict[int, None] = {}
        self.under_way: list[tuple[int, int, Advert]] = []
        self.now_s = 0.0

    def neighbours(self, node: int) -> list[int]:
        return [other for other in range(len(self.robots)) if edge(node, other) in self.weights and other != node]

    def advertise(self, node: int) -> None:
        advert = self.robots[node].advert(self.now_s, node in self.roots)
        self.under_way += [(node, other, advert) for other in self.neighbours(node)]

    def deliver(self, sender: int, receiver: int, advert: Advert) -> None:
        weight = self.weights.get(edge(sender, receiver))
        if weight is not None:
            self.robots[receiver].hear(sender, advert, weight, self.now_s)

    def cut(self, i: int, j: int) -> None:
        self.weights.pop(edge(i, j), None)
        self.robots[i].lose(j, self.now_s)
        self.robots[j].lose(i, self.now_s)

    def round(self, nodes: Iterable[int]) -> None:
        """Let everyone say something, and hear it a second later: in any order, but nothing is lost."""
        for node in nodes:
            self.advertise(node)
        self.now_s += 1.0
        arrived, self.under_way = self.under_way, []
        for each in arrived:
            self.deliver(*each)

    def true_distances(self) -> list[float | None]:
        lists = {node: self.neighbours(node) for node in range(len(self.robots))}
        obstacle = [each for each, weight in self.weights.items() if weight > 1.0]
        cost = reach(FlagComplex(lists), dict.fromkeys(self.roots, 0.0), obstacle, OBSTACLE_COST).cost
        return [cost[node] if cost.get(node, CAP + 1.0) <= CAP else None for node in range(len(self.robots))]

    def has_loop(self) -> bool:
        """Tell whether following next hops leads back to where one was."""
        for start in range(len(self.robots)):
            passed, node = [start], self.robots[start].next_hop
            while node is not None:
                if node in passed:
                    return True
                passed.append(node)
                node = self.robots[node].next_hop
        return False


def line(count: int) -> dict[Edge, float]:
    return {(n, n + 1): 1.0 for n in range(count - 1)}


def grid(side: int) -> dict[Edge, float]:
    nodes = range(side * side)
    return {
        (a, b): OBSTACLE_COST if (a + b) % 5 == 0 else 1.0
        for a, b in combinations(nodes, 2)
        if abs(a // side - b // side) + abs(a % side - b % side) == 1
    }


def settled(network: Network, rounds: int) -> Network:
    for _ in range(rounds):
        network.round(range(len(network.robots)))
    return network


# --- whatever happens to its messages -------------------------------------------------------------------------------


class Lossy(RuleBasedStateMachine):
    """Adverts are lost, kept, copied, delivered in any order; edges and roots come and go; robots lose their memory."""

    @initialize(data=st.data(), count=st.integers(2, 6))
    def build(self, data: st.DataObject, count: int) -> None:
        pairs = list(combinations(range(count), 2))
        chosen = data.draw(st.lists(st.sampled_from(pairs), unique=True))
        weights = {pair: data.draw(st.sampled_from((1.0, OBSTACLE_COST))) for pair in chosen}
        self.network = Network(count, weights)
        self.pairs = pairs

    def a_node(self, data: st.DataObject) -> int:
        return data.draw(st.integers(0, len(self.network.robots) - 1))

    @rule(data=st.data())
    def advertise(self, data: st.DataObject) -> None:
        self.network.advertise(self.a_node(data))

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
        node = self.a_node(data)
        if node in self.network.roots:
            del self.network.roots[node]
        else:
            self.network.roots[node] = None

    @rule(data=st.data(), weight=st.sampled_from((0.0, 1.0, OBSTACLE_COST)))
    def change_an_edge(self, data: st.DataObject, weight: float) -> None:
        pair = data.draw(st.sampled_from(self.pairs))
        if weight:
            self.network.weights[pair] = weight
        else:
            self.network.cut(*pair)

    @rule(data=st.data())
    def lose_a_memory(self, data: st.DataObject) -> None:
        node = self.a_node(data)
        self.network.robots[node] = Gradient(node, CAP, EXPIRY_S)

    @rule(data=st.data(), root=st.integers(0, 7), sequence=st.integers(0, 9), distance=st.integers(0, 9))
    def say_something_wrong(self, data: st.DataObject, root: int, sequence: int, distance: int) -> None:
        """A damaged advert, of a root that may not exist."""
        receiver, sender = data.draw(st.sampled_from(self.pairs))
        self.network.deliver(sender, receiver, Advert(sequence, root, 1_000 * sequence, float(distance)))

    @rule(seconds=st.sampled_from((0.5, 3.0, EXPIRY_S)))
    def wait(self, seconds: float) -> None:
        self.network.now_s += seconds

    @invariant()
    def nobody_counts_beyond_the_cap(self) -> None:
        distances = [robot.distance for robot in self.network.robots]
        assert all(each is None or 0.0 <= each <= CAP for each in distances)

    def teardown(self) -> None:
        """Once nothing is lost any more, distances become those of the graph, and every hop leads nearer."""
        if not hasattr(self, "network"):
            return
        network = settled(self.network, rounds=3 * int(EXPIRY_S) + len(self.network.robots))
        expected = network.true_distances()
        for _ in range(2 * int(EXPIRY_S)):  # and they stay so, through renewals
            network.round(reversed(range(len(network.robots))))
            assert [robot.distance for robot in network.robots] == expected
            for node, robot in enumerate(network.robots):
                if expected[node] is not None and expected[node] > 0.0:
                    assert robot.next_hop is not None
                    rest = expected[node] - network.weights[edge(node, robot.next_hop)]
                    assert network.robots[robot.next_hop].distance == rest
                    assert robot.root in network.roots


Lossy.TestCase.settings = settings(
    max_examples=150, stateful_step_count=40, deadline=None, suppress_health_check=list(HealthCheck)
)
TestAnyFiniteSequenceOfFaults = Lossy.TestCase


# --- a root that is cut off -----------------------------------------------------------------------------------------


class Gullible(Gradient):
    """Believes whoever is nearest: plain distance vector, as a control."""

    def _feasible(self, advert: Advert, now_s: float) -> bool:
        return advert.root is not None


def settled_grid(kind: type[Gradient]) -> Network:
    network = Network(16, grid(4), kind)
    network.roots[0] = None
    return settled(network, 12)


def after_the_cut(kind: type[Gradient], loss: float, delay_s: int, seed: int) -> tuple[list[float], int]:
    """Cut a settled grid's only root off; return the distances told later, and the seconds until nobody tells any."""
    random = np.random.Generator(np.random.Philox(seed))
    network = settled_grid(kind)
    assert [robot.distance for robot in network.robots] == network.true_distances()
    for other in network.neighbours(0):
        network.cut(0, other)
    told: list[float] = []
    queue: list[tuple[float, tuple[int, int, Advert]]] = []
    for second in range(int(CAP * (EXPIRY_S + delay_s)) + 1):
        for node in random.permutation(range(1, 16)):
            network.advertise(int(node))
        kept = [each for each in network.under_way if random.random() >= loss]
        queue += [(network.now_s + 1 + random.integers(0, delay_s + 1), each) for each in kept]
        network.under_way = []
        network.now_s += 1.0
        for at_s, each in queue:
            if at_s <= network.now_s:
                network.deliver(*each)
        queue = [each for each in queue if each[0] > network.now_s]
        distances = [robot.distance for robot in network.robots[1:]]
        if all(each is None for each in (*distances, *(advert.root for _, (_, _, advert) in queue))):
            return told, second
        told += [each for each in distances if each is not None]
    raise AssertionError(f"still told: {distances}")


@pytest.mark.parametrize(("loss", "delay_s"), [(0.0, 0), (0.3, 2), (0.6, 3), (0.9, 0)])
def test_after_its_root_is_cut_off_a_gradient_ends_and_counts_no_further_than_the_cap(
    loss: float, delay_s: int
) -> None:
    for seed in range(5):
        told, _ = after_the_cut(Gradient, loss, delay_s, seed)
        assert max(told, default=0.0) <= CAP


def test_over_a_perfect_radio_the_end_is_told_as_fast_as_the_way_is_long_and_nothing_counts_up() -> None:
    told, seconds = after_the_cut(Gradient, 0.0, 0, seed=1)
    assert max(told) < CAP
    assert seconds <= max(each for each in settled_grid(Gradient).true_distances() if each is not None)


def test_without_the_feasibility_condition_robots_count_up_to_the_cap() -> None:
    told, _ = after_the_cut(Gullible, 0.0, 0, seed=1)
    assert max(told) == CAP


def test_who_is_left_without_a_way_takes_a_longer_one_at_the_next_renewal() -> None:
    """Robot 2 told 2; what robot 3 tells is 3, and only new word of the root makes that safe to follow."""
    network = Network(6, {(0, 1): 1.0, (1, 2): 1.0, (2, 3): 1.0, (3, 4): 1.0, (4, 5): 1.0, (0, 5): 1.0})
    network.robots = [Gradient(node, CAP, expiry_s=100.0, renew_s=3.0) for node in range(6)]
    network.roots[0] = None
    settled(network, 6)
    network.cut(1, 2)
    assert (network.robots[2].distance, network.robots[3].distance) == (None, 3.0)
    settled(network, 3 + 6)
    assert (network.robots[2].distance, network.robots[3].distance) == (4.0, 3.0)


def test_who_goes_a_longer_way_than_it_told_still_does_not_follow_its_followers() -> None:
    robot = Gradient(1, CAP, EXPIRY_S)
    robot.hear(0, Advert(1, 0, 5, 1.0), 1.0, 0.0)
    assert robot.advert(0.0, False).distance == 2.0
    robot.hear(0, Advert(2, 0, 5, 1.0), OBSTACLE_COST, 0.1)  # a wall was found beside the edge
    assert robot.advert(0.2, False).distance == 4.0
    robot.hear(7, Advert(1, 0, 5, 3.0), 1.0, 0.3)  # it heard the first, and follows
    robot.lose(0, 0.4)
    assert robot.next_hop is None


def test_who_was_a_root_does_not_follow_word_of_itself() -> None:
    robot = Gradient(1, CAP, EXPIRY_S)
    told = robot.advert(0.0, True)
    robot.hear(2, Advert(1, 1, told.sequence, 1.0), 1.0, 0.1)
    robot.advert(0.2, False)
    assert robot.distance is None


@pytest.mark.parametrize("weights", [line(3), {(0, 1): 1.0, (0, 2): 1.0, (1, 2): 1.0}])
def test_two_robots_do_not_point_at_each_other_when_their_root_goes(weights: dict[Edge, float]) -> None:
    network = Network(3, weights)
    network.roots[0] = None
    settled(network, 4)
    network.cut(0, 1)
    network.cut(0, 2)
    assert network.robots[1].next_hop is None  # and not 2, which still tells a distance
    assert not network.has_loop()


def test_a_loop_between_two_roots_dissolves_as_soon_as_word_of_each_root_has_gone_around_it() -> None:
    """Robot 1 goes to root 0 by 2, robot 2 to root 3 by 1: each by what the other said before."""
    one, two = Gradient(1, CAP, EXPIRY_S), Gradient(2, CAP, EXPIRY_S)
    one.hear(2, Advert(1, 0, 5, 1.0), 1.0, 0.0)
    two.hear(1, Advert(1, 3, 5, 1.0), 1.0, 0.0)
    assert (one.next_hop, two.next_hop) == (2, 1)
    for number in (2, 3):
        of_one, of_two = one.advert(0.5, False), two.advert(0.5, False)
        one.hear(2, msgspec.structs.replace(of_two, number=number), 1.0, 0.5)
        two.hear(1, msgspec.structs.replace(of_one, number=number), 1.0, 0.5)
    assert (one.next_hop, two.next_hop) == (None, None)


# --- what is believed -----------------------------------------------------------------------------------------------


def test_a_way_along_an_obstacle_costs_more() -> None:
    network = Network(4, {(0, 1): 1.0, (1, 2): 1.0, (0, 3): 1.0, (2, 3): OBSTACLE_COST})
    network.roots[0] = None
    settled(network, 4)
    assert (network.robots[2].distance, network.robots[2].next_hop) == (2.0, 1)


def test_a_short_slow_way_wins_over_a_long_fast_one() -> None:
    """Over the obstacle it is one hop; word of each renewal comes that way first."""
    network = Network(4, {(0, 1): OBSTACLE_COST, (0, 2): 1.0, (1, 2): 1.0, (1, 3): 1.0})
    network.roots[0] = None
    for _ in range(40):
        network.round((3, 2, 1, 0))
        if network.now_s > 4.0:
            assert network.robots[1].next_hop == 2
            assert network.robots[3].distance == 3.0


def test_of_equal_ways_that_to_the_smallest_root_and_by_the_smallest_neighbour_wins() -> None:
    robot = Gradient(9, CAP, EXPIRY_S)
    for sender, root in ((5, 4), (3, 4), (2, 7), (1, 8)):
        robot.hear(sender, Advert(1, root, 1, 1.0), 1.0, 0.0)
    assert (robot.root, robot.next_hop) == (4, 3)


def test_the_nearest_of_two_roots_is_told_and_who_stops_being_one_tells_the_other() -> None:
    network = Network(5, line(5))
    network.roots.update({0: None, 4: None})
    settled(network, 5)
    assert [robot.distance for robot in network.robots] == [0.0, 1.0, 2.0, 1.0, 0.0]
    assert [robot.root for robot in network.robots] == [0, 0, 0, 4, 4]
    del network.roots[4]
    settled(network, 6)
    assert [robot.distance for robot in network.robots] == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_an_older_advert_that_comes_late_and_a_copy_change_nothing() -> None:
    robot = Gradient(1, CAP, EXPIRY_S)
    robot.hear(0, Advert(7, 0, 3, 0.0), 1.0, 0.0)
    robot.hear(0, Advert(6, None, 0, 0.0), 1.0, 0.1)
    assert robot.distance == 1.0
    robot.hear(0, Advert(7, 0, 3, 0.0), 1.0, EXPIRY_S - 0.1)  # a copy does not make it last
    robot.advert(EXPIRY_S, False)
    assert robot.distance is None


def test_what_has_expired_is_not_chosen_when_something_else_is_heard() -> None:
    robot = Gradient(1, CAP, EXPIRY_S)
    robot.hear(0, Advert(1, 0, 5, 0.0), 1.0, 0.0)
    robot.hear(2, Advert(1, 0, 5, 4.0), 1.0, EXPIRY_S)
    assert robot.next_hop == 2


def test_a_promise_upon_a_damaged_advert_is_forgotten() -> None:
    robot = Gradient(1, CAP, EXPIRY_S)
    robot.hear(0, Advert(1, 0, 10**9, 0.0), 1.0, 0.0)
    robot.advert(0.0, False)
    robot.hear(0, Advert(2, 0, 5, 0.0), 1.0, 1.0)
    assert robot.distance is None
    robot.hear(0, Advert(3, 0, 6, 0.0), 1.0, EXPIRY_S)
    assert robot.distance == 1.0


def test_a_root_that_lost_its_memory_is_believed_once_it_heard_of_itself() -> None:
    network = Network(3, line(3))
    network.roots[0] = None
    settled(network, 40)
    network.robots[0] = Gradient(0, CAP, EXPIRY_S)
    settled(network, int(EXPIRY_S) + 4)
    assert [robot.distance for robot in network.robots] == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    "wrong", [[-1, 0, 1, 1.0], [1, -2, 1, 1.0], [1, 0, 1, -1.0], [1, 0, 1, float("nan")], [1, 0, 1]]
)
def test_an_advert_that_makes_no_sense_cannot_be_decoded(wrong: list[float]) -> None:
    with pytest.raises(msgspec.DecodeError):
        msgspec.msgpack.decode(msgspec.msgpack.encode(["advert", *wrong]), type=Advert)


def test_an_advert_survives_the_wire() -> None:
    for advert in (Advert(1, 2, 3, 4.5), Advert(1, None, 0, 0.0)):
        assert msgspec.msgpack.decode(msgspec.msgpack.encode(advert), type=Advert) == advert
