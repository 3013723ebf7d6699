"""Facts spread through a team although packets are lost, and no fact is ever deleted."""

import numpy as np
import pytest

from zwerm.agents.robot_teams.mapping.facts import SweptSegment
from zwerm.agents.robot_teams.mapping.slice_map import SliceMap
from zwerm.agents.robot_teams.protocols.fact_exchange import FACTS_MAX, FactExchange
from zwerm.agents.robot_teams.protocols.team_messages import TeamBeacon, View, read_beacon, write_beacon

DT_S = 0.25


def beacon(node: int, slice_map: SliceMap, exchange: FactExchange, tick: int) -> TeamBeacon:
    parcel = exchange.outgoing(tick)
    facts = slice_map.facts
    sent = TeamBeacon(node, (View(1, 0, (0, 1, 2)),), (), (), (), facts.digest, len(facts), *parcel)
    received = read_beacon(write_beacon(sent))
    assert received is not None
    return received


@pytest.mark.parametrize("loss", [0.0, 0.3, 0.8])
def test_all_maps_become_equal_under_loss(loss: float) -> None:
    random = np.random.default_rng(7)
    maps = [SliceMap() for _ in range(3)]
    exchanges = [FactExchange(slice_map, DT_S) for slice_map in maps]
    everything = set()
    for tick in range(400):
        if tick < 100 and tick % 5 == 0:
            fact = SweptSegment(tick, 0, 1_000 + tick)
            maps[int(random.integers(3))].add(fact)
            everything.add(fact)
        sent = [beacon(node, maps[node], exchanges[node], tick) for node in range(3)]
        for receiver in range(3):
            for each in sent:
                if each.sender != receiver and random.random() >= loss:
                    exchanges[receiver].receive(each, tick)
    assert [set(slice_map.facts.since(0)) for slice_map in maps] == [everything] * 3


def test_a_beacon_goes_back_to_saying_little_when_all_know_all() -> None:
    slice_map = SliceMap()
    exchange = FactExchange(slice_map, DT_S)
    for k in range(20):
        slice_map.add(SweptSegment(k, 0, 1_000))
    assert len(exchange.outgoing(0)[0]) == 20
    assert exchange.outgoing(20) == ((), (), (), (), ())


def test_a_large_map_is_sent_in_pages_to_a_robot_that_has_none() -> None:
    ours, theirs = SliceMap(), SliceMap()
    exchange, other = FactExchange(ours, DT_S), FactExchange(theirs, DT_S)
    for k in range(2 * FACTS_MAX + 5):
        ours.add(SweptSegment(k, 0, 1_000))
    exchange.outgoing(0)
    for tick in range(100, 200):
        exchange.receive(beacon(1, theirs, other, tick), tick)
        sent = beacon(0, ours, exchange, tick)
        assert len(sent.segments) <= FACTS_MAX
        other.receive(sent, tick)
    assert theirs.facts.digest == ours.facts.digest
