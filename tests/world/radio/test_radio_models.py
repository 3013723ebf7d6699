"""Each model fulfils its docstring: fractions within their 99 % confidence intervals, and every rule by an example."""

import math
from typing import Any

import numpy as np
import pytest
from air import DT_S, Radio, ring

from zwerm.catalogue import RADIO_MODELS
from zwerm.errors import ProtocolError, ScenarioError
from zwerm.scenario import renamed
from zwerm.wire.checksum import seal, unseal
from zwerm.wire.messages import Transmission
from zwerm.world.radio import RadioModel, RadioModelTable, registry

Z99 = 2.576


def within(found: float, expected: float, sd: float, count: float) -> None:
    """Assert that a mean of `count` values with deviation `sd` is within its 99 % confidence interval."""
    assert abs(found - expected) <= Z99 * sd / math.sqrt(count), (found, expected)


def lost_by_link(radio: Radio, ticks: int) -> np.ndarray:
    """Return (links, ticks) which packets were lost while everyone broadcast at every tick, by sender and receiver."""
    count = len(radio.position)
    lost = np.ones((count, count, ticks), dtype=np.bool_)
    for tick in range(ticks):
        payload = tick.to_bytes(4, "big")
        radio.step({node: (Transmission("robots", payload),) for node in range(count)})
    radio.step({})
    for node, got in radio.received.items():
        for _, packet in got:
            lost[packet.sender, node, int.from_bytes(packet.payload, "big")] = False
    return lost[~np.eye(count, dtype=np.bool_)]


def runs(flags: np.ndarray) -> np.ndarray:
    """Return the lengths of the runs of true in every row of (k, ticks), those that the ends cut short aside."""
    lengths = []
    for row in flags:
        edges = np.flatnonzero(np.diff(np.r_[row[0], row].astype(np.int64)))
        inside = edges[int(row[0]) :]
        pairs = len(inside) // 2 * 2
        lengths.append(inside[1:pairs:2] - inside[:pairs:2])
    return np.concatenate(lengths)


# --- loss -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fraction", [0.01, 0.3, 0.9])
def test_independent_loss_has_its_rate(fraction: float) -> None:
    summary = Radio(ring(10), loss=fraction).all_broadcast(300)
    within(summary["dropped"]["loss"] / 27_000, fraction, math.sqrt(fraction * (1 - fraction)), 27_000)


def test_independent_loss_has_no_memory() -> None:
    lengths = runs(lost_by_link(Radio(ring(8), loss=0.5), 400))
    within(float(lengths.mean()), 2.0, math.sqrt(2.0), len(lengths))


@pytest.mark.parametrize(("loss", "burst"), [(0.1, 4.0), (0.5, 10.0), (0.3, 1.0)])
def test_burst_loss_has_the_loss_and_the_burst_length_it_is_given(loss: float, burst: float) -> None:
    model = {"kind": "gilbert_elliott", "loss_fraction": loss, "burst_packets": burst}
    lost = lost_by_link(Radio(ring(8), [model]), 400)
    # A two-state chain with correlation r from packet to packet has (1 + r) / (1 - r) times the variance of a mean.
    r = 1 - 1 / burst - loss / (1 - loss) / burst
    within(lost.mean(), loss, math.sqrt(loss * (1 - loss) * (1 + r) / (1 - r)), lost.size)
    # The end cuts the long runs short: that shortens the mean by less than a run in 400 packets, and is allowed for.
    lengths = runs(lost)
    allowed = Z99 * math.sqrt(burst * (burst - 1) / len(lengths)) + burst * burst / 400
    assert abs(lengths.mean() - burst) <= allowed


def test_a_bad_state_that_passes_some_packets_lowers_the_loss_of_a_burst_but_not_of_the_link() -> None:
    model = {"kind": "gilbert_elliott", "loss_fraction": 0.2, "burst_packets": 8.0, "bad_loss_fraction": 0.5}
    summary = Radio(ring(12), [model]).all_broadcast(400)
    sent = 12 * 11 * 400
    bad, r = 0.4, 1 - 1 / 8 - 0.4 / 0.6 / 8
    sd = math.sqrt(0.25 * bad * (1 - bad) * (1 + r) / (1 - r) + bad * 0.25)
    within(summary["dropped"]["burst"] / sent, 0.2, sd, sent)


def test_packets_of_one_tick_step_the_chain_one_after_the_other() -> None:
    model = {"kind": "gilbert_elliott", "loss_fraction": 0.5, "burst_packets": 1_000_000.0}
    fates = []
    for seed in range(200):
        radio = Radio(ring(2), [model], seed)
        radio.step({0: tuple(Transmission("robots", bytes([number]), to=1) for number in range(5))})
        radio.step({})
        fates.append(len(radio.received[1]))
    assert sorted(set(fates)) == [0, 5], "a burst that long takes all packets of a tick or none"


# --- delay, copies, damage ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("delay_s", "ticks"), [(0.0, 1), (0.05, 1), (0.1, 1), (0.1000001, 2), (0.3, 3), (1.0, 10)])
def test_a_packet_is_delivered_with_the_first_observation_at_or_after_its_arrival(delay_s: float, ticks: int) -> None:
    radio = Radio(ring(2), [{"kind": "delay", "delay_s": delay_s}])
    radio.one_link(1)
    assert [tick for tick, _ in radio.received[1]] == [ticks]


@pytest.mark.parametrize(
    ("distribution", "sd"),
    [("uniform", 1 / math.sqrt(3)), ("exponential", 1.0), ("lognormal", math.sqrt(math.e - 1)), ("pareto", 0.894)],
)
def test_jitter_has_the_mean_it_is_given(distribution: str, sd: float) -> None:
    model = {"kind": "delay", "delay_s": 1.0, "jitter_s": 2.0, "distribution": distribution}
    radio = Radio(ring(8), [model])
    for tick in range(70):
        radio.step({node: (Transmission("robots", bytes([tick])),) for node in range(8)})
    while radio.medium.summary()["in_flight"]:
        radio.step({})
    ticks = [arrived - packet.payload[0] for got in radio.received.values() for arrived, packet in got]
    # Arrivals are looked at once a tick, half a tick late on average.
    within(float(np.mean(ticks)) * DT_S - DT_S / 2, 3.0, 2.0 * sd, 70 * 56)


def test_jitter_reorders_and_an_inbox_is_in_the_order_of_arrival() -> None:
    radio = Radio(ring(2), [{"kind": "delay", "jitter_s": 0.5}])
    for number in range(100):
        radio.step({0: (Transmission("robots", bytes([number]), to=1),)})
    order = [packet.payload[0] for _, packet in radio.received[1]]
    assert order != sorted(order)


def test_copies_have_their_rate_and_random_numbers_of_their_own() -> None:
    models = [{"kind": "duplication", "fraction": 0.25, "copies": 2}, {"kind": "loss", "fraction": 0.5}]
    summary = Radio(ring(10), models).all_broadcast(200)
    within(summary["copies"] / 18_000, 0.5, 2 * math.sqrt(0.25 * 0.75), 18_000)
    within(summary["dropped"]["loss"] / summary["sent"], 0.5, 0.5, summary["sent"])
    radio = Radio(ring(2), [{"kind": "duplication", "fraction": 1.0}, {"kind": "loss", "fraction": 0.5}])
    for number in range(200):
        radio.step({0: (Transmission("robots", bytes([number]), to=1),)})
    fates = np.bincount([packet.payload[0] for _, packet in radio.received[1]], minlength=200)
    assert set(fates.tolist()) == {0, 1, 2}, "a packet and its copy share no draw"


def test_damage_has_its_rate_and_the_decoder_refuses_every_damaged_packet() -> None:
    rate, payload = 0.002, seal(b"sixteen bytes in")
    radio = Radio(ring(8), [{"kind": "corruption", "bit_error_rate": rate}])
    summary = radio.all_broadcast(100, payload)
    bits = 8 * len(payload)
    chance = 1 - (1 - rate) ** bits
    within(summary["damaged"] / 5_600, chance, math.sqrt(chance * (1 - chance)), 5_600)
    got = [packet.payload for packets in radio.received.values() for _, packet in packets]
    flipped = [sum((a ^ b).bit_count() for a, b in zip(each, payload, strict=True)) for each in got]
    within(sum(flipped) / (5_600 * bits), rate, math.sqrt(rate * (1 - rate)), 5_600 * bits)
    for each, number in zip(got, flipped, strict=True):
        if number:
            with pytest.raises(ProtocolError, match=r"^damaged: "):
                unseal(each)
        else:
            assert unseal(each) == b"sixteen bytes in"
    assert summary["damaged"] == sum(number > 0 for number in flipped)
    assert len(got) == 5_600, "damaged packets are delivered"


# --- rate and collisions --------------------------------------------------------------------------------------------


def test_a_rate_limit_passes_its_rate_delays_by_its_queue_and_drops_what_does_not_fit() -> None:
    # 16 bytes every 0.1 s offer 160 bytes/s; 100 pass.
    radio = Radio(ring(2), [{"kind": "rate_limit", "rate_bytes_s": 100.0, "queue_bytes": 64.0}])
    summary = radio.one_link(1_000)
    assert summary["delivered"] * 16 / (1_000 * DT_S) == pytest.approx(100.0, abs=1.0)
    assert summary["dropped"] == {"queue-full": 1_000 - summary["delivered"]}
    # A packet that just fits a queue of 64 bytes waits for 48 to 64 of them: 5 to 7 ticks.
    waits = max(tick for tick, _ in radio.received[1]) - 999
    assert 4 <= waits <= 7


def test_a_broadcast_passes_the_rate_limit_once_and_senders_have_queues_of_their_own() -> None:
    radio = Radio(ring(5), [{"kind": "rate_limit", "rate_bytes_s": 160.0, "queue_bytes": 16.0}])
    summary = radio.all_broadcast(100)
    assert summary["dropped"] == {}
    assert summary["delivered"] == 100 * 5 * 4


def test_collisions_follow_pure_aloha() -> None:
    count, airtime_s = 12, 0.004
    radio = Radio(ring(count), [{"kind": "collision", "airtime_s": airtime_s}])
    summary = radio.all_broadcast(400)
    # A packet survives if each other robot, its receiver among them, starts more than an airtime away. Two starts uniform
    # in a tick are within a = airtime / dt of each other with probability 2 a - a^2.
    a = airtime_s / DT_S
    survives = (1 - (2 * a - a * a)) ** (count - 1)
    found = summary["delivered"] / summary["sent"]
    # Packets of one transmission share their fate: count transmissions.
    assert found == pytest.approx(survives, abs=Z99 * math.sqrt(survives * (1 - survives) / (400 * count / 2)))


def test_a_collision_needs_both_senders_in_range_and_a_sender_receives_nothing_meanwhile() -> None:
    # 0 and 2 are hidden from each other; 1 hears both, 3 hears only 2.
    model = {"kind": "collision", "airtime_s": 0.1, "range_m": 1.5}
    radio = Radio([(10, 10), (11, 10), (12, 10), (13, 10)], [{"kind": "range", "range_m": 1.5}, model])
    message = (Transmission("robots", b"x"),)
    radio.step({0: message, 2: message})
    radio.step({})
    assert {node: len(got) for node, got in radio.received.items()} == {0: 0, 1: 0, 2: 0, 3: 1}
    radio = Radio([(10, 10), (11, 10)], [model])
    radio.step({0: message, 1: message})
    radio.step({})
    assert radio.medium.summary()["dropped"] == {"collision": 2}


# --- space ----------------------------------------------------------------------------------------------------------


def test_a_packet_reaches_its_range_and_no_further() -> None:
    radio = Radio([(10, 10), (12, 10), (12.001, 10)], range_m=2.0)
    radio.step({0: (Transmission("robots", b"x"),)})
    radio.step({})
    assert [len(radio.received[node]) for node in (1, 2)] == [1, 0]
    assert radio.medium.summary()["dropped"] == {"out-of-range": 1}


def test_line_of_sight_is_computed_again_after_a_robot_moved() -> None:
    radio = Radio([(10, 10), (12, 10)], walls=[[[11, 9], [11, 11]]], line_of_sight=True)
    radio.one_link(2)
    radio.position[1] = 10, 12
    radio.one_link(2)
    radio.position[1] = 12, 10
    summary = radio.one_link(1)
    assert (summary["delivered"], summary["dropped"]) == (2, {"no-line-of-sight": 3})


def test_walls_attenuate_by_material_and_region() -> None:
    walls = [[[11, 0], [11, 20]], [[12, 0], [12, 20]], [[13, 0], [13, 20]]]

    def delivered(margin_db: float, **more: Any) -> int:
        model = {"kind": "wall_attenuation", "material": "brick", "margin_db": margin_db, **more}
        return int(Radio([(10, 10), (14, 10)], [model], walls=walls).one_link(1)["delivered"])

    assert (delivered(24.0), delivered(23.9)) == (1, 0)
    glass = {"regions": [{"rectangle_m": [11.5, 0, 12.5, 20], "material": "glass"}]}
    assert (delivered(18.0, **glass), delivered(17.9, **glass)) == (1, 0)
    assert (delivered(3.0, loss_db=1.0), delivered(2.9, loss_db=1.0)) == (1, 0)


def test_a_line_through_a_corner_crosses_one_of_its_two_walls() -> None:
    model = {"kind": "wall_attenuation", "loss_db": 1.0, "margin_db": 1.5}
    radio = Radio(
        [(10, 10), (12, 10)], [model], walls=[[[11, 9], [11, 10], [11, 11]], [[11, 9.5], [11, 10], [11.5, 11]]]
    )
    # Two lines of walls meet it, each at a corner: 2 dB, not 4.
    assert radio.one_link(1)["dropped"] == {"walls": 1}
    model["margin_db"] = 2.0
    radio = Radio(
        [(10, 10), (12, 10)], [model], walls=[[[11, 9], [11, 10], [11, 11]], [[11, 9.5], [11, 10], [11.5, 11]]]
    )
    assert radio.one_link(1)["delivered"] == 1


def test_path_loss_follows_its_curve_over_the_distance() -> None:
    # P_r = -40.2 - 30 log10(d); at 10 m -70.2 dBm. One width off the sensitivity: 1 / (1 + e^-1).
    model = {"kind": "path_loss", "shadowing_sd_db": 0.0, "width_db": 2.0}
    chances = {-70.2: 0.5, -72.2: 1 / (1 + math.exp(-1)), -68.2: 1 / (1 + math.e), -120.0: 1.0}
    for sensitivity, expected in chances.items():
        radio = Radio([(10, 10)] * 6 + [(20, 10)] * 6, [model | {"sensitivity_dbm": sensitivity}])
        lost = lost_by_link(radio, 50)
        apart = [(a < 6) != (b < 6) for a in range(12) for b in range(12) if a != b]
        within(1.0 - lost[apart].mean(), expected, math.sqrt(expected * (1 - expected)) or 1e-9, lost[apart].size)


def test_wall_attenuation_before_a_path_loss_reduces_the_received_power() -> None:
    weak = {"kind": "path_loss", "shadowing_sd_db": 0.0, "width_db": 0.1, "sensitivity_dbm": -75.0}
    walls = [[[15, 0], [15, 20]]]
    assert Radio([(10, 10), (20, 10)], [weak], walls=walls).one_link(10)["delivered"] == 10
    models: list[dict[str, Any]] = [{"kind": "wall_attenuation", "material": "brick"}, weak]
    assert Radio([(10, 10), (20, 10)], models, walls=walls).one_link(10)["dropped"] == {"weak-signal": 10}


def test_shadowing_is_log_normal_lasting_and_the_same_in_both_directions() -> None:
    model = {"kind": "path_loss", "shadowing_sd_db": 8.0, "width_db": 0.001, "sensitivity_dbm": -70.2}
    radio = Radio(ring(40, 5.0), [model])
    radio.position[:] = np.array([[50.0, 50.0 + 10.0 * (node % 2)] for node in range(40)])
    summary = radio.all_broadcast(5)
    counts = radio.medium.channels["robots"].ledger.by_link()
    fate = dict(zip(zip(counts["sender"], counts["receiver"], strict=True), counts["delivered"], strict=True))
    assert set(fate.values()) == {0, 5}, "a link's shadowing lasts"
    assert all(fate[a, b] == fate[b, a] for a, b in fate)
    far = [fate[a, b] > 0 for a, b in fate if a < b and (a + b) % 2]
    within(float(np.mean(far)), 0.5, 0.5, len(far))  # 10 m apart the mean power is at the sensitivity
    assert summary["dropped"]["weak-signal"] > 0


# --- senders and receivers --------------------------------------------------------------------------------------------


def test_a_one_way_link_stays_one_way() -> None:
    model = {"kind": "loss", "fraction": 1.0, "senders": [0], "receivers": [1]}
    radio = Radio(ring(3), [model])
    radio.all_broadcast(20)
    counts = radio.medium.channels["robots"].ledger.by_link()
    fate = dict(zip(zip(counts["sender"], counts["receiver"], strict=True), counts["delivered"], strict=True))
    assert fate == {(0, 1): 0, (0, 2): 20, (1, 0): 20, (1, 2): 20, (2, 0): 20, (2, 1): 20}


def received(radio: Radio, ticks: int, nodes: int) -> list[list[tuple[int, int | None, bytes]]]:
    """Return the packets that nodes below `nodes` received while all nodes sent numbered broadcasts."""
    for tick in range(ticks):
        payload = tick.to_bytes(2, "big")
        radio.step({node: (Transmission("robots", payload),) for node in range(len(radio.position))})
    return [
        [(tick, packet.sender, packet.payload) for tick, packet in radio.received[node] if (packet.sender or 0) < nodes]
        for node in range(nodes)
    ]


ALL_RANDOM = [
    {"kind": "path_loss", "tx_power_dbm": -25.0, "fading_sd_db": 2.0},
    {"kind": "loss", "fraction": 0.2},
    {"kind": "gilbert_elliott", "loss_fraction": 0.2, "burst_packets": 3.0},
    {"kind": "delay", "jitter_s": 0.2},
    {"kind": "duplication", "fraction": 0.2},
    {"kind": "corruption", "bit_error_rate": 0.01},
]


def test_another_robot_changes_no_random_numbers_of_other_links() -> None:
    four = received(Radio(ring(4), ALL_RANDOM), 60, 4)
    assert four == received(Radio([*ring(4), (52.0, 50.0)], ALL_RANDOM), 60, 4)
    assert four != received(Radio(ring(4), ALL_RANDOM, seed=2), 60, 4)


def test_another_model_changes_no_random_numbers_of_other_models() -> None:
    idle = {"kind": "rate_limit", "rate_bytes_s": 1e12, "queue_bytes": 1e12}
    four = received(Radio(ring(4), ALL_RANDOM), 60, 4)
    assert four == received(Radio(ring(4), [idle, *ALL_RANDOM]), 60, 4)
    named = [model | {"name": f"mine-{model['kind']}"} for model in ALL_RANDOM]
    another = {"kind": "loss", "fraction": 0.0}
    assert received(Radio(ring(4), named), 60, 4) == received(Radio(ring(4), [another, *named]), 60, 4)


def test_the_packets_of_one_robot_change_no_random_numbers_of_other_links() -> None:
    def run(silent: bool) -> list[Any]:
        radio = Radio(ring(4), ALL_RANDOM)
        for tick in range(60):
            senders = range(1, 4) if silent and 20 <= tick < 30 else range(4)
            radio.step({node: (Transmission("robots", tick.to_bytes(2, "big")),) for node in senders})
        return [
            [(tick, packet.sender, packet.payload) for tick, packet in radio.received[node] if packet.sender]
            for node in range(4)
        ]

    assert run(silent=False) == run(silent=True)


# --- plug-ins -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", RADIO_MODELS)
def test_the_catalogue_finds_a_documented_model_class_in_a_file_of_its_own(kind: str) -> None:
    found = registry.find(kind)
    assert issubclass(found, RadioModel)
    assert issubclass(found.Parameters, RadioModelTable)
    assert RADIO_MODELS[kind] == f"{found.__module__}:{found.__name__}"
    assert found.__module__.rpartition(".")[2] == kind
    assert found.__doc__
    assert [other for other in RADIO_MODELS if RADIO_MODELS[other] == RADIO_MODELS[kind]] == [kind]


def test_a_model_of_a_user_has_random_numbers_of_its_own_and_its_cause_in_the_ledger() -> None:
    rain = {"kind": "own_models:Rain", "mm_per_h": 30.0}
    summary = Radio(ring(10), [rain]).all_broadcast(100)
    within(summary["dropped"]["rain"] / 9_000, 0.3, math.sqrt(0.3 * 0.7), 9_000)
    assert summary["out_of_reach"] == 0
    four = received(Radio(ring(4), ALL_RANDOM), 60, 4)
    assert four == received(Radio(ring(4), [rain | {"mm_per_h": 0.0}, *ALL_RANDOM]), 60, 4)


def test_a_model_states_its_range_and_others_have_no_bound() -> None:
    radio = Radio(ring(2), [{"kind": "path_loss"}, {"kind": "own_models:Lossy"}], range_m=2.5)
    models: list[Any] = radio.medium.channels["robots"].models
    assert [model.range_max_m for model in models] == [2.5, math.inf, math.inf]


FORMER_NAMES = renamed.KINDS["radio.models"]
FORMER: dict[str, dict[str, Any]] = {
    "bursts": {"loss_fraction": 0.3, "burst_packets": 4.0},
    "walls": {"loss_db": 1.0, "margin_db": 0.5},
}


@pytest.mark.parametrize("former", FORMER)
def test_a_former_name_of_a_model_works_with_one_warning_and_the_same_random_numbers(
    former: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(renamed, "_warned", {})
    walls = [[[50.0, 40.0], [50.0, 60.0]]]

    def summary(kind: str) -> dict[str, Any]:
        return Radio(ring(6), [{"kind": kind, **FORMER[former]}], walls=walls).all_broadcast(50)

    current = summary(FORMER_NAMES[former])
    assert capsys.readouterr().err == ""
    assert summary(former) == summary(former) == current
    assert current["dropped"]
    warning = f"radio.models.0.kind: '{former}' is deprecated, use '{renamed.KINDS['radio.models'][former]}'"
    assert capsys.readouterr().err == f"zwerm: warning: small.toml: {warning}\n"


def test_these_tests_try_every_former_name() -> None:
    assert set(FORMER) == set(FORMER_NAMES)


# --- mistakes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "line"),
    [
        ({"kind": "los"}, f"radio.models.0.kind: expected a built-in model ({', '.join(RADIO_MODELS)}) or module:Class, "
         "got 'los'; did you mean loss?"),
        ({"kind": "own_models:Missing"}, "radio.models.0.kind: module 'own_models' has no class 'Missing'"),
        ({"kind": "own_models:WithoutJudge"}, "radio.models.0.kind: own_models:WithoutJudge is no radio model: it has no "
         "method judge(sent, packets)"),
        ({"kind": "own_models:WithoutContext"}, "radio.models.0.kind: own_models:WithoutContext is no radio model: its "
         "constructor must take (parameters, context)"),
        ({"kind": "loss"}, "radio.models.0.fraction: required, and missing"),
        ({"kind": "loss", "fraction": 1.5}, "radio.models.0.fraction: expected <= 1, got 1.5"),
        ({"kind": "loss", "fraction": "half"}, 'radio.models.0.fraction: expected a number, got "half"'),
        ({"kind": "loss", "fraction": 0.1, "rate": 1}, "radio.models.0.rate: unknown key"),
        ({"kind": "loss", "fraction": 0.1, "recievers": [0]},
         "radio.models.0.recievers: unknown key; did you mean receivers?"),
        ({"kind": "loss", "fraction": 0.1, "senders": [0, 7]},
         "radio.models.0.senders.1: no such robot: ids are 0 to 1, got 7"),
        ({"kind": "loss", "fraction": 0.1, "receivers": ["coordinator"]},
         "radio.models.0.receivers.0: the scenario has no coordinator"),
        ({"kind": "gilbert_elliott", "loss_fraction": 0.9, "burst_packets": 2.0},
         "radio.models.0: burst_packets: expected >= 9 for that loss_fraction, got 2"),
        ({"kind": "gilbert_elliott", "loss_fraction": 0.5, "burst_packets": 2.0, "bad_loss_fraction": 0.5},
         "radio.models.0: loss_fraction: expected < bad_loss_fraction 0.5, got 0.5"),
        ({"kind": "collision"}, "radio.models.0: expected either airtime_s or rate_bytes_s"),
        ({"kind": "delay", "distribution": "normal"},
         'radio.models.0.distribution: expected "uniform", "exponential", "lognormal" or "pareto", got "normal"'),
    ],
)  # fmt: skip
def test_a_mistake_in_a_model_is_one_line(model: dict[str, Any], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        Radio(ring(2), [model])
    assert caught.value.mistakes == [line]


def test_a_channel_lists_all_its_pairs_and_the_blocked_ones() -> None:
    radio = Radio([(50.0 + node, 50.0) for node in range(20)], [{"kind": "range", "range_m": 17.5}])
    pairs = radio.medium.channels["robots"].pairs()
    assert sorted(pairs) == [(a, b) for a in range(20) for b in range(20) if a != b]
    assert radio.medium.stopped("robots", radio.scene(), [0]) == [(0, 18), (0, 19), (1, 19), (18, 0), (19, 0), (19, 1)]
    assert radio.medium.stopped("robots", radio.scene(), []) == []
