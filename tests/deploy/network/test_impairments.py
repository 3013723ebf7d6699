"""Radio models and faults as rules of a real network, and the parts of a scenario that no network reproduces."""

from typing import Any

import pytest
from support import scenario

from zwerm.deploy.network.impairments import Network, ruleset, supported, translate
from zwerm.deploy.network.namespaces import Namespaces
from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws

LINKS = [(a, b) for a in range(4) for b in range(4) if a != b]


@pytest.mark.parametrize(
    ("tables", "line"),
    [
        ({"radio": {"models": [{"kind": "path_loss"}]}}, "radio.models.0.kind: not in the twin: its loss depends on "
         "the distance: use the models range and loss, got 'path_loss'"),
        ({"radio": {"models": [{"kind": "wall_attenuation"}]}},
         "radio.models.0.kind: not in the twin: without margin_db nothing is dropped, got 'wall_attenuation'"),
        ({"radio": {"models": [{"kind": "collision", "airtime_s": 0.1}]}},
         "radio.models.0.kind: not in the twin: cables do not collide, got 'collision'"),
        ({"radio": {"models": [{"kind": "delay", "jitter_s": 1.0, "distribution": "pareto"}]}},
         "radio.models.0.kind: not in the twin: netem has jitter of that mean only uniform, got 'delay'"),
        ({"radio": {"models": [{"kind": "own_models:Lossy"}]}},
         "radio.models.0.kind: not in the twin: no rule of the network is known for this model, got 'own_models:Lossy'"),
        ({"radio": {"models": [{"kind": "rate_limit", "rate_bytes_s": 1.0, "queue_bytes": 1.0}] * 2}},
         "radio.models.1.kind: not in the twin: one such model at most, got 'rate_limit'"),
        ({"coordinator": {"controller": "radioed:Counts"}, "uplink": {"models": [{"kind": "delay", "delay_s": 1.0}]}},
         "uplink.models.0.kind: not in the twin: both channels share a node's cable, got 'delay'"),
        ({"faults": [{"kind": "heal", "at_s": 0.0}, {"kind": "crash", "nodes": [1], "at_s": 0.0}]},
         "faults.1.kind: not in the twin: its programs are left alone, got 'crash'"),
        ({"random_faults": {}}, "random_faults: not in the twin; write the schedule into the scenario"),
        ({"robots": {"count": 65, "controller": "beacon"}},
         "robots.count: the twin links every two nodes, 64 at most, got 65"),
    ],
)  # fmt: skip
def test_the_twin_refuses_unsupported_parts_of_a_scenario_with_their_place(tables: dict[str, Any], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        supported(scenario(**{"radio": {}, **tables}))
    assert caught.value.mistakes == [f"small.toml: {line}"]


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        ({"kind": "own_models:Lossy"}, "no rule of the network is known for this model"),
        ({"kind": "collision", "airtime_s": 0.1}, "cables do not collide"),
    ],
)
def test_a_model_without_a_rule_of_the_network_is_refused_by_name_and_never_left_out(
    model: dict[str, Any], reason: str
) -> None:
    chosen = scenario(radio={"loss": 0.1, "models": [model]})
    line = f"small.toml: radio.models.0.kind: not in the twin: {reason}, got '{model['kind']}'"
    with pytest.raises(ScenarioError) as caught:
        supported(chosen)
    assert caught.value.mistakes == [line]
    with pytest.raises(ScenarioError) as caught:
        translate(chosen, {"robots": LINKS})
    assert caught.value.mistakes == [line]


def test_a_model_of_a_user_can_name_its_rule_of_the_network() -> None:
    chosen = scenario(radio={"loss": 0.1, "models": [{"kind": "own_models:Rain", "mm_per_h": 20.0, "senders": [1]}]})
    assert supported(chosen)[1] == []
    rules = translate(chosen, {"robots": LINKS}).rules
    assert [(rule.name, rule.lose, len(rule.pairs)) for rule in rules] == [("loss0", 0.1, 12), ("loss1", 0.2, 3)]


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ({"kind": "own_faults:Flood", "area_m": [0, 0, 1, 1]}, ""),
        ({"kind": "own_faults:Static", "fraction": 0.5}, "no rule of the network is known for this fault"),
    ],
)
def test_a_fault_of_a_user_is_in_the_twin_only_if_it_declares_that(fault: dict[str, Any], reason: str) -> None:
    chosen = scenario(radio={}, faults=[fault | {"at_s": 0.0}])
    if not reason:
        assert supported(chosen)[0].faults == chosen.faults
        return
    with pytest.raises(ScenarioError) as caught:
        supported(chosen)
    assert caught.value.mistakes == [f"small.toml: faults.0.kind: not in the twin: {reason}, got '{fault['kind']}'"]


def test_a_scenario_without_a_radio_has_no_twin() -> None:
    with pytest.raises(ScenarioError, match=r"^small.toml: radio: the scenario has none"):
        supported(scenario())


def test_rules_stand_in_the_order_of_the_models_and_bursts_begin_in_equilibrium() -> None:
    bursts = {"kind": "gilbert_elliott", "loss_fraction": 0.5, "burst_packets": 2.0}
    chosen = scenario(robots={"count": 40, "controller": "beacon"}, radio={"loss": 0.25, "models": [bursts]})
    rules = translate(chosen, {"robots": [(a, b) for a in range(40) for b in range(40) if a != b]}).rules
    assert [rule.name for rule in rules] == ["loss0", "burst_loss1"]
    text = ruleset(rules, Draws(1))
    assert "numgen random mod 1000000000 < 250000000 counter name loss0 drop" in text
    assert text.index("@loss0 jump") < text.index("@burst_loss1 jump")
    began = next(line for line in text.splitlines() if "burst_loss1_bad {" in line).count(" . ") - 1
    assert abs(began / (40 * 39) - 0.5) < 5.0 * (0.25 / (40 * 39)) ** 0.5


def test_a_delay_is_a_netem_rule_at_its_receiver() -> None:
    delay = {"kind": "delay", "delay_s": 0.1, "jitter_s": 0.02, "receivers": [1]}
    impairments = translate(scenario(radio={"models": [delay]}), {"robots": LINKS})
    assert list(Network(Namespaces([]), impairments, "udp").cables()) == [
        (None, ["node1", "root", "netem", "delay", "120000us", "20000us"])
    ]
