"""Translate the radio models of a scenario to rules of a real network, or report the models without such a rule.

Each model names its rule (`RadioModel.network_rule`). A network installs four mechanisms:

    BlockedPairs    an nftables set of blocked pairs of nodes; the world computes the set at every tick, also for radio faults
    RandomLoss      nftables, `numgen random`, for each packet; with bursts a set of pairs in the bad state, where packets
                    add and delete pairs at random
    SenderRate      `tc tbf` at the sender; a broadcast is one packet for each receiver there
    ReceiverDelay   `tc netem` before the receiver; skipped, with a message, if the kernel has none

Other models are refused. Rules are in the order of the models; a packet that one rule drops does not reach the next.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from pydantic import ValidationError

from zwerm.deploy.network.namespaces import Namespaces, address_of, netem_unavailable_reason, port_of
from zwerm.errors import ScenarioError
from zwerm.link.peer_radio import HEAD_BYTES, Transport
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.faults import registry as faults
from zwerm.world.radio import ROBOTS
from zwerm.world.radio import registry as radio
from zwerm.world.radio.network_rules import BlockedPairs, NetworkRule, RandomLoss, ReceiverDelay, SenderRate
from zwerm.world.radio.nodes import selected
from zwerm.world.radio.registry import tables_of

Pairs = list[tuple[int, int]]

# Largest number of nodes: each pair of nodes has a link.
NODES_MAX: Final = 64

_CHANCES: Final = 1_000_000_000

# Header bytes: Ethernet, IP, and UDP or TCP with timestamps; then the Zenoh header of a message.
_WIRE_BYTES: Final = {"udp": 14 + 20 + 8, "tcp": 14 + 20 + 32}
_ZENOH_BYTES: Final = 16


@dataclass(slots=True)
class Rule:
    """A loss model for some pairs. `lose` is the probability of loss of a packet.

    With `bursts`, `lose` applies in the bad state only. `enter` and `leave` are the probabilities per packet of entering and
    leaving the bad state.
    """

    name: str
    pairs: Pairs
    lose: float
    enter: float = 1.0
    leave: float = 0.0
    bursts: bool = False


@dataclass(slots=True)
class Impairments:
    """The rules of a network. `by_place` are, by channel, the indices of the models that depend on positions."""

    rules: list[Rule] = field(default_factory=list)
    by_place: dict[str, list[int]] = field(default_factory=dict)
    rates: dict[int, tuple[float, float, int]] = field(default_factory=dict)  # by sender: bytes/s, queue, receivers
    delays: dict[int, tuple[float, float]] = field(
        default_factory=dict
    )  # by receiver: mean [s] and largest deviation [s]


def supported(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """Return `scenario` without the models this machine's kernel does not support, and a line for each of these.

    Raises ScenarioError with every part of the scenario that a real network cannot reproduce.
    """
    wrong: list[str] = []
    skipped: list[str] = []
    interface_rules: list[type[NetworkRule]] = []
    reason = ""
    changed: dict[str, Any] = {}
    nodes = scenario.robots.count + (scenario.coordinator is not None)
    if scenario.radio is None and scenario.coordinator is None:
        wrong.append("radio: the scenario has none, and nothing would cross the network")
    if nodes > NODES_MAX:
        wrong.append(f"robots.count: the twin links every two nodes, {NODES_MAX} at most, got {nodes}")
    for name, table in (("radio", scenario.radio), ("uplink", scenario.uplink)):
        kept: list[OpenTable] = []
        for path, model in [] if table is None else tables_of(table, name):
            try:
                rule, _ = _rule(model, path, scenario)
                if isinstance(rule, ReceiverDelay | SenderRate):
                    if scenario.radio is not None and scenario.coordinator is not None:
                        raise ScenarioError([_not_in_the_twin(path, "both channels share a node's cable", model)])
                    if type(rule) in interface_rules:
                        raise ScenarioError([_not_in_the_twin(path, "one such model at most", model)])
                    interface_rules.append(type(rule))
            except ScenarioError as error:
                wrong += error.mistakes
                continue
            if isinstance(rule, ReceiverDelay) and (reason := reason or netem_unavailable_reason()):
                skipped.append(f"{path} ({model.kind}): {reason}")
            elif path.startswith(f"{name}.models."):
                kept.append(model)
        if table is not None:
            changed[name] = table.model_copy(update={"models": kept})
    for index, fault in enumerate(scenario.faults):
        if reason_refused := _fault_refused(fault):
            wrong.append(f"faults.{index}.kind: not in the twin: {reason_refused}, got {fault.kind!r}")
    if scenario.random_faults is not None:
        wrong.append("random_faults: not in the twin; write the schedule into the scenario")
    if wrong:
        raise ScenarioError([f"{scenario.place}: {line}" for line in wrong])
    return scenario.model_copy(update=changed), skipped


def _rule(model: OpenTable, path: str, scenario: Scenario) -> tuple[NetworkRule, Any]:
    """Return the rule of the model that stands at `path`, and its parameters.

    Raises ScenarioError if a real network cannot reproduce the model, or its table has mistakes.
    """
    try:
        kind = radio.find(model.kind)
        parameters = kind.Parameters.model_validate(model.parameters)
        rule = kind.network_rule(parameters)
        if rule is None:
            raise ValueError("no rule of the network is known for this model")
        if isinstance(rule, ReceiverDelay) and parameters.senders is not None:
            raise ValueError("netem delays all packets to a receiver: set receivers, not senders")
        if isinstance(rule, SenderRate) and parameters.receivers is not None:
            raise ValueError("tbf slows down all packets of a sender: set senders, not receivers")
    except ValidationError as error:
        named = f"{scenario.place}: "
        found = [line.removeprefix(named) for line in mistakes(error, scenario.place, f"{path}.")]
        raise ScenarioError(found) from None
    except ValueError as error:
        raise ScenarioError([_not_in_the_twin(path, str(error), model)]) from None
    return rule, parameters


def _fault_refused(fault: OpenTable) -> str:
    """Return the reason why a fault cannot occur in the twin, or an empty string."""
    try:
        kind = faults.find(fault.kind)
    except ValueError as error:
        return str(error)
    if kind.touches_programs:
        return "its programs are left alone"
    return "" if kind.in_network else "no rule of the network is known for this fault"


def translate(scenario: Scenario, links: Mapping[str, Pairs]) -> Impairments:
    """Return the rules of the network for a `supported` scenario; `links` are all (sender, receiver) pairs by channel.

    Raises ScenarioError with a line for each model that a real network cannot reproduce.
    """
    found = Impairments()
    wrong: list[str] = []
    for name, every in links.items():
        place, table = ("radio", scenario.radio) if name == ROBOTS else ("uplink", scenario.uplink)
        for index, (path, model) in enumerate([] if table is None else tables_of(table, place)):
            try:
                rule, parameters = _rule(model, path, scenario)
            except ScenarioError as error:
                wrong += error.mistakes
                continue
            sends, receives = (
                selected(names, scenario, path, []) for names in (parameters.senders, parameters.receivers)
            )
            pairs = [(sender, receiver) for sender, receiver in every if sends[sender] and receives[receiver]]
            match rule:
                case BlockedPairs():
                    found.by_place.setdefault(name, []).append(index)
                case RandomLoss(lose, bursts, enter, leave):
                    label = f"{'burst_loss' if bursts else 'loss'}{len(found.rules)}"
                    found.rules.append(Rule(label, pairs, lose, enter, leave, bursts))
                case SenderRate(rate_bytes_s, queue_bytes):
                    for sender, many in Counter(sender for sender, _ in pairs).items():
                        found.rates[sender] = many * rate_bytes_s, queue_bytes, many
                case ReceiverDelay(mean_s, deviation_s):
                    for _, receiver in pairs:
                        found.delays[receiver] = mean_s, deviation_s
    if wrong:
        raise ScenarioError([f"{scenario.place}: {line}" for line in wrong])
    return found


def _not_in_the_twin(path: str, reason: str, model: OpenTable) -> str:
    return f"{path}.kind: not in the twin: {reason}, got {model.kind!r}"


def ruleset(rules: Sequence[Rule], draws: Draws) -> str:
    """Return the nftables rules of a bridge. Each link starts in the bad state with its stationary probability."""
    lines = ["table bridge zwerm {", " counter blocked { }", f" set blocked {{ {_SET} }}"]
    for rule in rules:
        lines += [f" counter {rule.name} {{ }}", f" set {rule.name} {{ {_SET} {_elements(rule.pairs)}}}"]
        lose = f"{_chance(rule.lose)} counter name {rule.name} drop"
        if not rule.bursts:
            lines.append(f" chain {rule.name}_chain {{ {lose}; }}")
            continue
        bad = rule.enter / (rule.enter + rule.leave)
        began = [pair for pair in rule.pairs if float(draws.uniform(f"twin/{rule.name}", *pair)) < bad]
        state = f"{rule.name}_bad"
        lines += [
            f" set {state} {{ {_SET} size 65535; flags dynamic; {_elements(began)}}}",
            f" chain {rule.name}_lose {{ {lose}; }}",
            f" chain {rule.name}_leave {{",
            f"  {_chance(rule.leave)} delete @{state} {{ {_PAIR} }} return",
            f"  goto {rule.name}_lose",
            " }",
            f" chain {rule.name}_chain {{",
            f"  {_PAIR} @{state} goto {rule.name}_leave",
            f"  {_chance(rule.enter)} add @{state} {{ {_PAIR} }} goto {rule.name}_lose",
            " }",
        ]
    lines += [
        " chain air {",
        "  type filter hook forward priority 0; policy accept;",
        f"  {_PAIR} @blocked counter name blocked drop",
        *(f"  {_PAIR} @{rule.name} jump {rule.name}_chain" for rule in rules),
        " }",
        "}",
    ]
    return "\n".join([*lines, ""])


_PAIR: Final = "ip saddr . ip daddr"
_SET: Final = "type ipv4_addr . ipv4_addr;"


def _chance(chance: float) -> str:
    return "" if chance >= 1.0 else f"numgen random mod {_CHANCES} < {round(chance * _CHANCES)}"


def _elements(pairs: Sequence[tuple[int, int]]) -> str:
    return f"elements = {{ {_listed(pairs)} }}; " if pairs else ""


def _listed(pairs: Sequence[tuple[int, int]]) -> str:
    return ", ".join(f"{address_of(sender)} . {address_of(receiver)}" for sender, receiver in pairs)


class Network:
    """A network with impairments. Runs commands on its bridge and at its nodes."""

    def __init__(self, namespaces: Namespaces, impairments: Impairments, transport: Transport) -> None:
        self._namespaces = namespaces
        self._impairments = impairments
        self._transport = transport
        self._blocked: Pairs = []

    def impair(self, draws: Draws) -> None:
        """Install the rules for loss, delay and rate. Raises LinkError if a tool refuses."""
        self._namespaces.run(["nft", "-f", "-"], ruleset(self._impairments.rules, draws))
        for node, command in self.cables():
            self._namespaces.run(["tc", "qdisc", "add", "dev", *command], node=node)

    def cables(self) -> Iterator[tuple[int | None, list[str]]]:
        """Yield the arguments of `tc qdisc add dev`, with the node to whose namespace they apply (None: the bridge)."""
        # The rate counts payload bytes: the size table subtracts the headers, with one entry for each size.
        before = _WIRE_BYTES[self._transport] + _ZENOH_BYTES + HEAD_BYTES
        sizes = ["stab", "overhead", str(-before - 1), "mtu", "2047", "tsize", "2048"]
        # tbf never sends a packet longer than its burst, and a TCP segment can hold several packets.
        longest = 0.0 if self._transport == "udp" else 1500.0
        for sender, (rate_bytes_s, queue_bytes, receivers) in self._impairments.rates.items():
            burst, limit = max(queue_bytes, longest), max(receivers * queue_bytes, longest)
            bucket = ["rate", f"{8 * rate_bytes_s:.0f}bit", "burst", f"{burst:.0f}", "limit", f"{limit:.0f}"]
            yield sender, ["eth0", "root", *sizes, "tbf", *bucket]
        for receiver, (mean_s, around_s) in self._impairments.delays.items():
            delay = ["delay", f"{mean_s * 1e6:.0f}us", f"{around_s * 1e6:.0f}us"]
            yield None, [port_of(receiver), "root", "netem", *delay]

    def block(self, pairs: Pairs) -> None:
        """Block packets between `pairs` from now on, and unblock all other pairs."""
        if pairs != self._blocked:
            added = f"add element bridge zwerm blocked {{ {_listed(pairs)} }}\n" if pairs else ""
            self._namespaces.run(["nft", "-f", "-"], f"flush set bridge zwerm blocked\n{added}")
            self._blocked = pairs

    def dropped(self) -> dict[str, int]:
        """Return the number of IP packets that each rule has dropped."""
        listed = json.loads(self._namespaces.run(["nft", "--json", "list", "counters"]))["nftables"]
        counters = [entry["counter"] for entry in listed if "counter" in entry]
        return {counter["name"]: counter["packets"] for counter in counters}
