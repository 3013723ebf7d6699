"""Receivers of broadcasts found by positions are those that a test of every pair finds, and the ledger adds up to the same."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import shapely
from air import EXAMPLES, Radio
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from zwerm.maths.keyed_random import Draws
from zwerm.wire.messages import Packet, Transmission
from zwerm.world.arena.arena import Arena
from zwerm.world.radio import reach
from zwerm.world.radio.models.path_loss import PathLossTable, reach_m
from zwerm.world.radio.reach import Reach
from zwerm.world.scene import Bools, Floats, Ints, Scene

MODELS = {**EXAMPLES, "own_models:Lossy": {"kind": "own_models:Lossy"}}
WALLS = [[[50.0, 45.0], [50.0, 50.0]]]
ARENA = Arena(shapely.box(0.0, 0.0, 100.0, 100.0))


def scene_of(position: Floats, present: Bools) -> Scene:
    return Scene(0, 0.0, position, np.zeros(len(position)), present, present, 0.05, ARENA, Draws(1))


def one_by_one(position: Floats, here: Bools, senders: Ints, bound_m: float) -> list[list[int]]:
    """Return the receivers of each sender, by a test of every pair."""
    return [
        [
            other
            for other in range(len(position))
            if other != sender and here[other] and np.hypot(*(position[other] - position[sender])) <= bound_m
        ]
        for sender in senders.tolist()
    ]


@pytest.mark.parametrize("dense_pairs", [0, 20_000])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32), count=st.integers(1, 40), bound_m=st.sampled_from([0.3, 1.0, 3.0, np.inf]))
def test_the_receivers_are_those_of_a_test_of_every_pair(
    dense_pairs: int, seed: int, count: int, bound_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reach, "_DENSE_PAIRS", dense_pairs)
    random = np.random.Generator(np.random.Philox(seed))
    found = Reach(range(count))
    position = random.uniform(0.0, 5.0, (count, 2))
    present, off = random.random(count) < 0.8, random.random(count) < 0.2
    for step_m in (0.0, 0.01, 0.01, 0.2, 3.0):
        position = position + random.uniform(-step_m, step_m, position.shape)
        if random.random() < 0.3:
            present, off = random.random(count) < 0.8, random.random(count) < 0.2
        senders = random.integers(0, count, int(random.integers(1, 2 * count + 1)))
        if random.random() < 0.5 and (present & ~off).any():
            senders = np.flatnonzero(present & ~off)  # everybody at once, as a swarm of beacons does
        got = found.find(scene_of(position, present), off, senders, bound_m)
        expected = one_by_one(position, present & ~off, senders, bound_m)
        assert [each.tolist() for each in np.split(got.ids, np.cumsum(got.counts)[:-1])] == expected
        others = np.arange(count) != senders[:, None]
        assert got.absent.tolist() == (others & ~present).sum(axis=1).tolist()
        assert got.off.tolist() == (others & present & off).sum(axis=1).tolist()
        assert (got.counts + got.absent + got.off + got.beyond == count - 1).all()


def test_many_packets_of_few_senders_at_once_need_no_search_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    """A world that is delayed in real time gets the packets of many ticks in one; to import SciPy then stops it again."""
    monkeypatch.setattr(reach, "tree_of", lambda points: pytest.fail("it makes a search tree"))
    random, count = np.random.Generator(np.random.Philox(1)), 100
    position, everyone = random.uniform(0.0, 5.0, (count, 2)), np.ones(count, dtype=np.bool_)
    senders = np.tile(np.arange(count), 64)
    got = Reach(range(count)).find(scene_of(position, everyone), ~everyone, senders, 1.0)
    expected = one_by_one(position, everyone, np.arange(count), 1.0) * 64
    assert [each.tolist() for each in np.split(got.ids, np.cumsum(got.counts)[:-1])] == expected


def see_all_pairs(radio: Radio) -> None:
    """Let the models judge every packet, as if none had a bound."""
    channel: Any = radio.medium.channels["robots"]
    channel._bound = None


def received(
    radio: Radio, traffic: Sequence[dict[int, list[Transmission]]], places: Sequence[Floats]
) -> dict[int, list[tuple[int, Packet]]]:
    for outboxes, place in zip(traffic, places, strict=True):
        radio.position = place
        radio.step(outboxes)
    for _ in range(200):
        radio.step({})
    return radio.received


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    kinds=st.lists(st.sampled_from(sorted(MODELS)), max_size=4),
    shorthand=st.booleans(),
    down=st.integers(0, 8),
    seed=st.integers(0, 2**32),
)
def test_the_same_packets_arrive_and_the_totals_are_equal_with_all_pairs_judged(
    kinds: list[str], shorthand: bool, down: int, seed: int
) -> None:
    """With a fault that silences a node. The causes are equal too where the bounding model judges first."""
    random = np.random.Generator(np.random.Philox(seed))
    count, ticks = 9, 8
    start = random.uniform(46.0, 54.0, (count, 2))
    places = [start + 0.1 * tick * random.uniform(-1.0, 1.0, start.shape) for tick in range(ticks)]
    traffic = [
        {
            node: [Transmission("robots", b"all"), Transmission("robots", b"one", to=(node + 1) % count)]
            for node in np.flatnonzero(random.random(count) < 0.7).tolist()
        }
        for _ in range(ticks)
    ]
    models = [MODELS[kind] for kind in kinds]
    more = {"range_m": 3.0} if shorthand else {}
    results = []
    judges_first = False
    for bounded in (True, False):
        radio = Radio([tuple(each) for each in start.tolist()], models, seed, WALLS, check=False, **more)
        if bounded:
            channel: Any = radio.medium.channels["robots"]
            judges_first = channel._bound is None or channel._bound is channel.models[0]
        else:
            see_all_pairs(radio)
        radio.medium.switch_off(down, "receiver-crashed")
        arrived = received(radio, traffic, places)
        radio.medium.audit()
        summary = radio.medium.summary()
        assert summary["sent"] == summary["delivered"] + sum(summary["dropped"].values()) + summary["in_flight"]
        by_link = radio.medium.channels["robots"].ledger.by_link(radio.tick)
        for name in ("sent", "delivered", "out_of_reach", "in_flight"):
            assert sum(by_link[name]) == summary[name]
        assert {cause: sum(column) for cause, column in by_link["dropped"].items() if any(column)} == summary["dropped"]
        if not judges_first:  # another model may have dropped the same packets first, for its own cause
            del by_link["dropped"], summary["dropped"]
        results.append((arrived, summary, by_link))
    assert results[0] == results[1]


def test_models_see_the_packets_in_reach_and_not_all_pairs() -> None:
    line = [(0.5 + index, 50.0) for index in range(90)]
    radio = Radio(line, check=False, range_m=1.1)
    summary = radio.all_broadcast(1)
    assert summary["delivered"] == 2 * 89
    assert summary["dropped"] == {"out-of-range": 90 * 89 - 2 * 89}
    assert summary["out_of_reach"] == summary["dropped"]["out-of-range"]
    channel = radio.medium.channels["robots"]
    assert channel.links.count == 2 * 89, "only packets in reach have a link before it is asked for"
    assert channel.ledger.link_count() == len(channel.ledger.by_link()["sent"]) == 90 * 89
    assert channel.links.count == 2 * 89


def test_a_model_with_a_memory_before_the_range_sees_every_packet() -> None:
    line = [(0.5 + index, 50.0) for index in range(5)]
    bursts = {"kind": "gilbert_elliott", "loss_fraction": 0.4, "burst_packets": 3.0}
    radio = Radio(line, [bursts, {"kind": "range", "range_m": 1.1}], check=False)
    radio.all_broadcast(3)
    assert radio.medium.channels["robots"].links.count == 5 * 4


def test_beyond_its_reach_path_loss_lets_no_more_pass_than_it_states() -> None:
    for fading in (0.0, 3.0):
        table = PathLossTable(fading_sd_db=fading, tx_power_dbm=-20.0, negligible_probability=0.01)
        far_m = reach_m(table)
        assert far_m < reach_m(table.model_copy(update={"negligible_probability": 1e-12}))
        pairs = [(1.0 + 0.01 * index, 1.0) for index in range(40)]
        pairs += [(x + far_m, y) for x, y in pairs]
        parameters = {"fading_sd_db": fading, "tx_power_dbm": -20.0, "negligible_probability": 0.01}
        radio = Radio(pairs, [{"kind": "path_loss", **parameters}], check=False)
        see_all_pairs(radio)
        for _ in range(20):
            radio.step({node: (Transmission("robots", b"x"),) for node in range(40)})
        counts = radio.medium.channels["robots"].ledger.by_link()
        far = np.array(counts["receiver"]) >= 40
        sent, dropped = np.array(counts["sent"])[far].sum(), np.array(counts["dropped"]["weak-signal"])[far].sum()
        assert sent == 20 * 40 * 40
        assert sent - dropped <= 0.01 * sent
