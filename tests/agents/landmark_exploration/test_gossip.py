"""Merging logs and registers obeys its laws; gossip makes the maps of a connected swarm equal, although messages are lost."""

import random
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.frontier_status import (
    ABANDONED,
    BOUNDARY,
    REOPENED,
    TIMED_OUT,
    UNEXPLORED,
    key_of,
)
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.agents.landmark_exploration.sharing.landmark_messages import Entries, Register, RegisterBeacon, Vector
from zwerm.agents.landmark_exploration.sharing.log_entries import (
    ENTRY_BYTES_MAX,
    failure_entry,
    observation_entries,
    status_entries,
)
from zwerm.agents.landmark_exploration.sharing.log_gossip import AddressedMessage, Gossip
from zwerm.agents.landmark_exploration.sharing.packing import ORIGINS_END
from zwerm.agents.landmark_exploration.sharing.registers import Registers
from zwerm.agents.landmark_exploration.sharing.replica import Replica, Stretch, origin_of


def stretches_of(replica: Replica) -> list[Stretch]:
    return [Stretch(origin, 0, tuple(log)) for origin, log in sorted(replica.logs.items())]


def merged(*replicas: Replica) -> Replica:
    found = Replica()
    for each in replicas:
        for stretch in stretches_of(each):
            found.extend(stretch)
    return found


def content(replica: Replica) -> object:
    return replica.logs, replica.vector, replica.digest


# Every origin has one log; replicas hold some of its beginning each.
prefixes = st.dictionaries(st.integers(0, 3), st.integers(0, 5), max_size=4)


def holding(counts: dict[int, int]) -> Replica:
    found = Replica()
    for origin, count in counts.items():
        if count:
            found.append(origin, [bytes([origin, number]) for number in range(count)])
    return found


@given(prefixes, prefixes, prefixes)
def test_merging_logs_is_commutative_associative_and_idempotent(
    a: dict[int, int], b: dict[int, int], c: dict[int, int]
) -> None:
    one, two, three = holding(a), holding(b), holding(c)
    assert content(merged(one, two)) == content(merged(two, one))
    assert content(merged(merged(one, two), three)) == content(merged(one, merged(two, three)))
    assert content(merged(one, one)) == content(one)


@given(prefixes, prefixes)
def test_equal_digests_mean_equal_logs(a: dict[int, int], b: dict[int, int]) -> None:
    one, two = holding(a), holding(b)
    assert (one.digest == two.digest) is (one.vector == two.vector)


def test_a_stretch_with_a_gap_before_it_waits_for_what_is_missing() -> None:
    replica = holding({1: 2})
    assert not replica.extend(Stretch(1, 3, (b"x", b"y")))
    assert not replica.extend(Stretch(1, 6, (b"z",)))
    assert replica.vector == {1: 2}
    assert replica.extend(Stretch(1, 1, (bytes([1, 1]), b"w"))) == [b"w", b"x", b"y"]
    assert replica.vector == {1: 5}
    assert replica.extend(Stretch(1, 5, (b"v",))) == [b"v", b"z"]


registers = st.lists(
    st.builds(
        lambda node, incarnation, stamp: Register(
            node, incarnation, stamp, claim=(node, incarnation, stamp).__hash__() % 97
        ),
        st.integers(0, 3),
        st.integers(1, 2),
        st.integers(0, 4),
    ),
    max_size=10,
)


@given(registers, st.randoms())
def test_registers_do_not_depend_on_order_or_copies(some: list[Register], order: random.Random) -> None:
    one, other = Registers(100, 100, 1), Registers(100, 100, 1)
    shuffled = [*some, *some]
    order.shuffle(shuffled)
    for each in some:
        one.merge(each, 0)
    for each in shuffled:
        other.merge(each, 0)
    assert one.newest == other.newest


# --- gossip ------------------------------------------------------------------------------------------------------------


@dataclass
class Robot:
    """A node that gossips, and writes what a seed says."""

    me: int
    bytes_max: int
    hub: bool = False
    tick: int = 0
    replica: Replica = field(default_factory=Replica)
    map: LandmarkMap = field(default_factory=LandmarkMap)

    def __post_init__(self) -> None:
        self.registers = Registers(100, 1_000, 1)
        self.gossip = Gossip(self.me, self.replica, self.registers, self.map.read, self.bytes_max, self.hub)
        self.stamp = 0

    def write(self, entries: list[bytes]) -> None:
        stretch = self.replica.append(origin_of(self.me, 1), entries)
        self.map.read(stretch, stretch.first)
        self.gossip.announce(stretch)

    def outgoing(self) -> list[AddressedMessage]:
        self.tick += 1
        return self.gossip.tick(self.tick, None if self.hub else self.register)

    def register(self) -> Register:
        self.stamp += 1
        return Register(self.me, 1, self.stamp)


def exchange(robots: list[Robot], links: set[tuple[int, int]], fate: random.Random, loss: float, ticks: int) -> int:
    """Let robots speak over `links` for so many ticks; messages are lost, late and copied. Return the longest packet's size."""
    late: list[tuple[int, int, int, bytes]] = []
    longest = 0
    for now in range(ticks):
        for robot in robots:
            for to, message in robot.outgoing():
                packet = messages.write(message)
                longest = max(longest, len(packet))
                for other in range(len(robots)):
                    if (robot.me, other) not in links or to not in (None, other):
                        continue
                    late += [
                        (now + 1 + int(fate.random() < loss) * fate.randrange(20), robot.me, other, packet)
                        for _ in range(1 + (fate.random() < loss / 4))
                        if fate.random() >= loss
                    ]
        due = [each for each in late if each[0] <= now]
        late = [each for each in late if each[0] > now]
        fate.shuffle(due)
        for _, sender, to, packet in due:
            received = messages.read(packet)
            assert received is not None
            robots[to].gossip.receive(sender, received, robots[to].tick)
    return longest


def chain(count: int) -> set[tuple[int, int]]:
    return {(i, j) for i in range(count) for j in range(count) if abs(i - j) == 1}


def scribble(robot: Robot, fate: random.Random) -> None:
    """Write an observation of up to 30 landmarks, or a status."""
    landmarks = tuple(sorted(fate.sample(range(900), fate.randrange(1, 30))))
    robot.write(observation_entries(BearingSnapshot(landmarks, tuple(fate.randrange(256) for _ in landmarks))))
    robot.write(status_entries([key_of(fate.randrange(900), 900 + fate.randrange(9))], BOUNDARY))


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.3, 0.6]), st.sampled_from([64, 1000]))
def test_connected_maps_become_equal_although_messages_are_lost_late_or_copied(
    seed: int, loss: float, bytes_max: int
) -> None:
    fate = random.Random(seed)
    robots = [Robot(me, bytes_max) for me in range(4)]
    for _ in range(6):
        scribble(fate.choice(robots), fate)
        exchange(robots, chain(4), fate, loss, 3)
    exchange(robots, chain(4), fate, loss, 1_500)
    assert len({robot.replica.digest for robot in robots}) == 1
    assert all(robot.map.content() == robots[0].map.content() for robot in robots)
    assert robots[0].map.complex.simplices


def test_without_links_maps_stay_apart() -> None:
    fate = random.Random(1)
    robots = [Robot(me, 1000) for me in range(2)]
    scribble(robots[0], fate)
    exchange(robots, set(), fate, 0.0, 100)
    assert robots[1].replica.digest != robots[0].replica.digest


def test_a_hub_forwards_the_map_between_robots_out_of_reach_of_each_other() -> None:
    fate = random.Random(3)
    robots = [Robot(0, 1000), Robot(1, 1000), Robot(2, 1000, hub=True)]
    star = {(0, 2), (2, 0), (1, 2), (2, 1)}
    scribble(robots[0], fate)
    scribble(robots[1], fate)
    exchange(robots, star, fate, 0.3, 200)
    assert robots[0].map.content() == robots[1].map.content() == robots[2].map.content()
    assert set(robots[0].registers.newest) == {0, 1}


@pytest.mark.parametrize("robots_count", [2, 12])
def test_small_packets_are_small(robots_count: int) -> None:
    fate = random.Random(5)
    robots = [Robot(me, messages.SMALL_BYTES) for me in range(robots_count)]
    everybody = {(i, j) for i in range(robots_count) for j in range(robots_count) if i != j}
    longest = 0
    for _ in range(15):
        scribble(fate.choice(robots), fate)
        longest = max(longest, exchange(robots, everybody, fate, 0.4, 12))
    assert 40 < longest <= messages.SMALL_BYTES


@given(
    st.lists(st.tuples(st.integers(0, 99_999), st.integers(1, 300), st.integers(0, 10**7)), min_size=1, max_size=12),
    st.integers(0, 2**32),
    st.integers(0, 2**62),
)
@settings(max_examples=60, deadline=None)
def test_no_packet_is_longer_than_the_cap_for_any_identifiers(
    robots: list[tuple[int, int, int]], claim: int, frozen: int
) -> None:
    registers, replica = Registers(150, 1_500, len(robots)), Replica()
    me = robots[0][0]
    gossip = Gossip(me, replica, registers, lambda stretch, held: None, messages.SMALL_BYTES)
    for node, incarnation, stamp in robots:
        registers.merge(Register(node, incarnation, stamp, claim, frozen), 0)
        replica.append(origin_of(node, incarnation), [bytes(ENTRY_BYTES_MAX)] * 3)
        gossip.announce(Stretch(origin_of(node, incarnation), 0, (bytes(ENTRY_BYTES_MAX),) * 3))
    gossip.beacon_soon()
    gossip.receive(me + 1, RegisterBeacon(2**62, ()), 1)
    gossip.receive(me + 1, Vector(0, ORIGINS_END, (), True), 1)
    outgoing = gossip.tick(1, lambda: Register(me, 300, 10**7, claim, frozen))
    assert {type(each.message) for each in outgoing} == {Entries, Vector, RegisterBeacon}
    assert max(len(messages.write(each.message)) for each in outgoing) <= messages.SMALL_BYTES


# Entries of every kind, of few landmarks, so that logs of several robots concern the same frontiers.
keys = st.tuples(st.integers(0, 4), st.integers(0, 4)).filter(lambda pair: pair[0] != pair[1]).map(lambda p: key_of(*p))
observed = st.dictionaries(st.integers(0, 4), st.integers(0, 255), min_size=1).map(
    lambda seen: observation_entries(BearingSnapshot(tuple(sorted(seen)), tuple(seen[each] for each in sorted(seen))))
)
entries = st.one_of(
    observed,
    keys.map(lambda key: [failure_entry(key)]),
    st.tuples(st.lists(keys, min_size=1, max_size=3), st.sampled_from([TIMED_OUT, REOPENED, ABANDONED, BOUNDARY])).map(
        lambda some: status_entries(*some)
    ),
)
logs = st.dictionaries(
    st.integers(0, 2),
    st.lists(entries, max_size=4).map(lambda some: [each for part in some for each in part]),
    max_size=3,
)


class Mapped:
    """A replica and the map that is read from it."""

    def __init__(self, *others: "Mapped") -> None:
        self.replica, self.map = Replica(), LandmarkMap()
        for other in others:
            self.merge(other)

    def merge(self, other: "Mapped") -> "Mapped":
        for stretch in stretches_of(other.replica):
            held = self.replica.vector.get(stretch.origin, 0)
            new = self.replica.extend(stretch)
            if new:
                self.map.read(Stretch(stretch.origin, held, tuple(new)), held)
        return self

    def cut(self, random_: random.Random) -> "Mapped":
        """Return a node that has received a part of this one's logs."""
        part = Mapped()
        for origin, log in self.replica.logs.items():
            held = log[: random_.randint(0, len(log))]
            if part.replica.extend(Stretch(origin, 0, tuple(held))):
                part.map.read(Stretch(origin, 0, tuple(held)), 0)
        return part


@given(logs, st.randoms(use_true_random=False))
def test_merging_maps_is_commutative_associative_and_idempotent(
    some: dict[int, list[bytes]], fate: random.Random
) -> None:
    whole = Mapped()
    for origin, log in some.items():
        if log:
            whole.replica.append(origin, log)
            whole.map.read(Stretch(origin, 0, tuple(log)), 0)
    a, b, c = (whole.cut(fate) for _ in range(3))
    assert Mapped(a, b).map.content() == Mapped(b, a).map.content()
    assert Mapped(Mapped(a, b), c).map.content() == Mapped(a, Mapped(b, c)).map.content()
    assert Mapped(a).merge(a).map.content() == a.map.content()
    assert Mapped(a, b, c, whole).map.content() == whole.map.content()


@given(st.permutations(range(5)))
def test_failures_of_all_robots_count_together_in_any_order(order: list[int]) -> None:
    key = key_of(1, 2)
    stretches = [Stretch(origin, 0, (failure_entry(key),)) for origin in range(5)]
    seen = BearingSnapshot((1, 2, 3), (0, 10, 20))
    statuses = []
    map_ = LandmarkMap()
    map_.observe(seen)
    for origin in order:
        map_.read(stretches[origin], 0)
        statuses.append(map_.frontiers.statuses[key])
    assert statuses == [UNEXPLORED, TIMED_OUT, TIMED_OUT, ABANDONED, ABANDONED]


def test_registers_give_the_time_since_which_half_of_the_others_are_silent() -> None:
    registers = Registers(150, 1_500, 3)
    assert registers.half_silent_since(0) is None
    for node, tick in ((0, 90), (1, 10), (2, 50)):
        registers.merge(Register(node, 1, 1), tick)
    assert registers.half_silent_since(0) == 50, "half of the others, here one of two, are silent since then"
    registers.merge(Register(3, 1, 1), 20)
    assert registers.half_silent_since(0) == 20
    assert registers.is_fresh(0, 60, 51)
    assert not registers.is_fresh(0, 60, 50)
