"""Every packet is accounted for: under any two models, any traffic, sleepers and crashes, on every link at every tick."""

import io
from collections import Counter
from itertools import product
from typing import Any

import numpy as np
import pytest
from air import DT_S, EXAMPLES, Radio, ring
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console
from support import scenario

from zwerm.cli.radio_table import print_radio_ledger
from zwerm.run.runner import run
from zwerm.wire.messages import Transmission
from zwerm.world.radio.links import Links

WALL = [[50.0, 50.0], [50.0, 60.0]]


@pytest.mark.parametrize(("first", "second"), list(product(EXAMPLES, EXAMPLES)))
def test_the_ledger_balances_under_every_pair_of_models(first: str, second: str) -> None:
    radio = Radio(ring(4), [EXAMPLES[first], EXAMPLES[second] | {"senders": [0, 1, 2]}], walls=[WALL])
    outbox = (Transmission("robots", b"broadcast"), Transmission("robots", b"one", to=3))
    for _ in range(12):  # the medium audits itself at every tick
        radio.step({0: outbox, 1: outbox[:1], 2: outbox})
    held_back = radio.medium.summary()
    summary = radio.all_broadcast(3)
    for counts in (held_back, summary):
        assert counts["sent"] == counts["delivered"] + sum(counts["dropped"].values()) + counts["in_flight"]
    assert summary["in_flight"] == 0
    assert summary["sent"] == 12 * (3 * 3 + 2) + 3 * 12 + summary["copies"]
    assert summary["delivered"] == sum(map(len, radio.received.values()))


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    kinds=st.lists(st.sampled_from(sorted(EXAMPLES)), max_size=4),
    traffic=st.lists(
        st.lists(
            st.tuples(st.integers(0, 4), st.one_of(st.none(), st.integers(0, 4)), st.binary(max_size=20)), max_size=5
        ),
        max_size=12,
    ),
    asleep=st.sets(st.integers(0, 4)),
    dies=st.tuples(st.integers(0, 4), st.integers(0, 12), st.integers(0, 12)),
    seed=st.integers(0, 2**32),
)
def test_the_ledger_balances_under_any_traffic_with_sleeping_and_crashing_nodes(
    kinds: list[str], traffic: list[Any], asleep: set[int], dies: tuple[int, int, int], seed: int
) -> None:
    radio = Radio(ring(5), [EXAMPLES[kind] for kind in kinds], seed, walls=[WALL])
    node, down_at, up_at = dies
    sent = 0
    for number, tick in enumerate(traffic):
        if number == down_at:
            radio.medium.switch_off(node, "receiver-crashed")
        if number == up_at:
            radio.medium.switch_on(node)
        outboxes: dict[int, list[Transmission]] = {}
        for sender, to, payload in tick:
            if to != sender:
                outboxes.setdefault(sender, []).append(Transmission("robots", payload, to))
                sent += 4 if to is None else 1
        radio.step(outboxes, [each for each in range(5) if each not in asleep])
    radio.medium.audit()
    counts = radio.medium.summary()
    assert counts["sent"] == sent + counts["copies"]
    assert counts["sent"] == counts["delivered"] + sum(counts["dropped"].values()) + counts["in_flight"]
    assert counts["delivered"] == sum(map(len, radio.received.values()))


def test_an_audit_finds_a_packet_that_vanishes() -> None:
    radio = Radio(ring(3))
    radio.step({0: (Transmission("robots", b"x"),)})
    radio.medium.channels["robots"].queue.remove_from(0)  # the ledger does not count this
    with pytest.raises(
        AssertionError, match=r"^channel robots: link 0 to 1: the ledger has 1 packets in flight, the queue has 0"
    ):
        radio.medium.audit()


def test_the_counts_by_link_are_sorted_and_add_up_to_the_summary() -> None:
    radio = Radio(ring(4), [EXAMPLES["loss"], EXAMPLES["duplication"]])
    summary = radio.all_broadcast(50)
    counts = radio.medium.channels["robots"].ledger.by_link()
    assert list(zip(counts["sender"], counts["receiver"], strict=True)) == [
        (a, b) for a in range(4) for b in range(4) if a != b
    ]
    assert sum(counts["sent"]) == summary["sent"]
    assert sum(counts["delivered"]) == summary["delivered"]
    assert sum(counts["dropped"]["loss"]) == summary["dropped"]["loss"]
    received = Counter((packet.sender, node) for node, got in radio.received.items() for _, packet in got)
    pairs = zip(counts["sender"], counts["receiver"], strict=True)
    assert counts["delivered"] == [received[pair] for pair in pairs]


def test_the_radio_table_has_every_cause_and_the_links_that_lost_most() -> None:
    one_way = {"kind": "loss", "fraction": 1.0, "senders": [0], "receivers": [1]}
    walled = scenario(
        robots={"count": 3, "controller": "beacon", "sensors": []},
        radio={"models": [one_way]},
        faults=[{"kind": "cut", "senders": [2], "receivers": [0], "at_s": 1.0}],
    )
    counts = run(walled, 1, "inline").radio
    links = counts["channels"]["robots"]["links"]
    ages = dict(zip(zip(links["sender"], links["receiver"], strict=True), links["age_mean_s"], strict=True))
    assert ages[0, 1] is None, "nothing was ever delivered"
    assert ages[1, 0] == pytest.approx(0.1)
    assert ages[2, 0] > 0.3
    console = Console(record=True, width=120, file=io.StringIO())
    print_radio_ledger(console, counts, 2)
    text = [" ".join(line.split()) for line in console.export_text().splitlines()]
    assert text[1] == "from to sent delivered loss cut in flight delivered % age mean s age max s"
    assert text[2].startswith(f"all all 120 {120 - 20 - 10 - 4} 20 10 4 ")
    assert [line[:14] for line in text[3:5]] == ["0 1 20 0 20 0 ", "2 0 20 10 0 10"]
    assert text[5:] == ["messages a node: mean 20.0, most 20", "bytes a node: mean 320.0, most 320"]


def test_messages_and_bytes_are_counted_once_for_each_sender() -> None:
    radio = Radio(ring(3))
    radio.step({0: (Transmission("robots", b"12345"), Transmission("robots", b"1", to=2)), 2: ()})
    counts = radio.medium.channels["robots"].ledger
    assert counts.node_messages.tolist() == [2, 0, 0]
    assert counts.node_bytes.tolist() == [6, 0, 0]
    assert radio.medium.summary()["bytes"] == 6


def test_a_packet_to_a_receiver_out_of_reach_is_no_loss() -> None:
    count = 12  # along a line, so that each has two neighbours at most
    line = [[0.5 + index, 0.5, 0.0] for index in range(count)]
    robots = {
        "count": count,
        "controller": "beacon",
        "sensors": [],
        "body": {"kind": "holonomic", "radius_m": 0.05},
        "placement": {"kind": "poses", "poses": line},
    }
    down = {"kind": "crash", "nodes": [count - 1], "at_s": 0.0}
    cut = {"kind": "cut", "senders": [1], "receivers": [0, 5], "at_s": 0.0}
    chosen = scenario(
        arena={"size_m": [20.0, 1.0]},
        time={"duration_s": 40.0},
        robots=robots,
        radio={"range_m": 1.1, "loss": 0.3, "check": True},
        faults=[down, cut],
    )
    result = run(chosen, 1, "inline")
    counts, ticks = result.radio, 400
    sent = ticks * (count - 1) * (count - 1)  # 11 live robots, 11 receivers each
    # Neighbours among the 11 that live: 10 pairs, both ways. Of these the fault cuts one link, not the one to a stranger.
    in_reach = ticks * 20
    assert counts["sent"] == sent
    assert counts["out_of_reach"] == sent - in_reach
    assert counts["dropped"]["cut"] == ticks
    assert counts["dropped"]["receiver-down"] == ticks * (count - 1)
    assert counts["sent"] == counts["delivered"] + sum(counts["dropped"].values()) + counts["in_flight"]
    assert counts["bytes"] == sum(counts["channels"]["robots"]["message_bytes"]) == ticks * (count - 1) * 16
    assert result.metrics["out_of_reach_fraction"] == pytest.approx(1.0 - in_reach / sent)
    expected = 0.7 * 19 / 20
    assert abs(result.metrics["delivered_fraction"] - expected) < 2.576 * (0.7 * 0.3 / in_reach) ** 0.5 + 20 / in_reach
    links = counts["channels"]["robots"]["links"]
    assert sum(links["out_of_reach"]) == counts["channels"]["robots"]["out_of_reach"] == counts["out_of_reach"]
    console = Console(record=True, width=160, file=io.StringIO())
    print_radio_ledger(console, counts, 1)
    rows = [line.split() for line in console.export_text().splitlines()]
    assert rows[2][-3] == f"{100.0 * result.metrics['delivered_fraction']:.1f}"
    assert rows[3][:4] == ["1", "0", str(ticks), "0"], "the link that lost most, and not one out of reach"


def test_without_a_receiver_in_reach_there_is_no_delivered_fraction() -> None:
    far = {"range_m": 0.001}
    metrics = run(scenario(robots={"controller": "beacon", "sensors": []}, radio=far), 1, "inline").metrics
    assert metrics["out_of_reach_fraction"] == 1.0
    assert "delivered_fraction" not in metrics


def test_a_model_of_a_user_states_whether_its_receivers_are_out_of_reach() -> None:
    far = {"senders": [0], "receivers": [1]}
    for own, lost in (("own_models:Shadowed", 0), ("own_models:Lossy", 10)):
        radio = Radio(ring(3), [{"kind": own, **far}])
        summary = radio.all_broadcast(10)
        assert summary["dropped"] == {"silence": 10}
        assert summary["out_of_reach"] == 10 - lost


def test_the_age_of_information_equals_a_count_at_every_tick() -> None:
    radio = Radio(ring(3), [EXAMPLES["loss"], EXAMPLES["delay"]], seed=5)
    broadcast = Transmission("robots", b"x")
    newest: dict[tuple[int, int], int] = {}
    ages: dict[tuple[int, int], list[int]] = {}
    sent_tick: dict[tuple[int, int, bytes], int] = {}
    for tick in range(200):
        payload = tick.to_bytes(2, "big")
        outboxes = {} if tick % 3 else {node: (Transmission(broadcast.channel, payload),) for node in range(3)}
        before = {node: len(got) for node, got in radio.received.items()}
        for node in outboxes:
            sent_tick.update({(node, other, payload): tick for other in range(3)})
        radio.step(outboxes)
        for node, got in radio.received.items():
            for _, packet in got[before[node] :]:
                assert packet.sender is not None
                link = packet.sender, node
                newest[link] = max(newest.get(link, -1), sent_tick[packet.sender, node, packet.payload])
        for link, sent in newest.items():
            ages.setdefault(link, []).append(tick - sent)
    found = radio.medium.channels["robots"].ledger.ages_s(200)
    assert found is not None
    assert found[0] == pytest.approx(DT_S * np.mean([np.mean(each) for each in ages.values()]))
    # Looked at just before the next packet came, one tick later than at the tick before.
    assert found[1] == pytest.approx(DT_S * (max(map(max, ages.values())) + 1))


def test_the_dense_and_the_sorted_table_find_the_same_links() -> None:
    random = np.random.Generator(np.random.Philox(7))
    dense, by_key = Links(50), Links(50, dense_nodes_max=0)
    for _ in range(30):
        sender, receiver = random.integers(0, 50, (2, 40))
        a, b = dense.rows(sender, receiver), by_key.rows(sender, receiver)
        assert (a == b).all()
        assert (by_key.sender[b] == sender).all()
        assert (by_key.receiver[b] == receiver).all()
    assert dense.count == by_key.count
