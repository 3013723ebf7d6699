"""From the models of a scenario's radio to a real network that does the same, or a clear word that none can.

    range, line_of_sight, walls     pairs of nodes between which nothing passes, looked up in the world at every tick, and so
    (with margin_db), and faults    are partition, jam, blackout and cut; an nftables set
    loss                            nftables, `numgen random`, for every packet
    bursts                          nftables: the pairs in the bad state are a set, which packets enter and leave by chance
    rate_limit                      `tc tbf` at the sender; a broadcast is as many packets there as it has receivers
    delay (fixed or uniform)        `tc netem` before the receiver, where the kernel has it; else left out, and said so

Everything else is refused. Rules stand in the order of the models, and a packet that one drops the next never sees.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from zwerm.deploy.network.namespaces import Namespaces, address_of, lacks_netem, port_of
from zwerm.errors import ScenarioError
from zwerm.link.peer_radio import HEAD_BYTES, Transport
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.radio import ROBOTS
from zwerm.world.radio.registry import BUILT_IN, selected, tables_of

Pairs = list[tuple[int, int]]

# Nodes: every two of them have a link of their own.
NODES_MAX: Final = 64

_CHANCES: Final = 1_000_000_000

# Ethernet, IP, and UDP or TCP with its timestamps; then what Zenoh and the radio put before a payload.
_WIRE_BYTES: Final = {"udp": 14 + 20 + 8, "tcp": 14 + 20 + 32}
_ZENOH_BYTES: Final = 16

_BY_PLACE: Final = ("range", "line_of_sight", "walls")
_BY_CHANCE: Final = ("loss", "bursts")
_OF_A_CABLE: Final = ("delay", "rate_limit")
_CANNOT: Final = {
    "path_loss": "its chance changes with every distance; say range and loss",
    "walls": "without margin_db nothing is dropped",
    "duplication": "Zenoh drops what comes twice, by its number",
    "corruption": "the kernel drops what its checksum does not fit",
    "collision": "cables do not collide",
}


@dataclass(slots=True)
class Rule:
    """A model of loss between some pairs. `enter` and `leave` are a burst's chances, `lose` what is lost while it lasts."""

    name: str
    pairs: Pairs
    lose: float
    enter: float = 1.0
    leave: float = 0.0
    bursts: bool = False


@dataclass(slots=True)
class Impairments:
    """What the network is to do. `by_place` are the numbers of the models, by channel, that only the world can judge."""

    rules: list[Rule] = field(default_factory=list)
    by_place: dict[str, list[int]] = field(default_factory=dict)
    rates: dict[int, tuple[float, float, int]] = field(default_factory=dict)  # by sender: bytes/s, queue, receivers
    delays: dict[int, tuple[float, float]] = field(default_factory=dict)  # by receiver: mean [s], and how far around it


def possible(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """Return `scenario` without what this machine's kernel cannot do, and a line for each thing left out.

    Raises ScenarioError with every part of it that no network could do.
    """
    wrong: list[str] = []
    skipped: list[str] = []
    cables: list[str] = []
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
            complaint = _complaint(model)
            if not complaint and model.kind in _OF_A_CABLE:
                if scenario.radio is not None and scenario.coordinator is not None:
                    complaint = "both channels share a node's cable"
                elif model.kind in cables:
                    complaint = "one such model at most"
                cables.append(model.kind)
            if complaint:
                wrong.append(_not_in_the_twin(path, complaint, model))
            elif model.kind == "delay" and (reason := reason or lacks_netem()):
                skipped.append(f"{path} (delay): {reason}")
            elif path.startswith(f"{name}.models."):
                kept.append(model)
        if table is not None:
            changed[name] = table.model_copy(update={"models": kept})
    wrong += [
        f"faults.{index}.kind: not in the twin: its programs are left alone, got {fault.kind!r}"
        for index, fault in enumerate(scenario.faults)
        if fault.kind in ("crash", "restart", "pause", "join")
    ]
    if scenario.random_faults is not None:
        wrong.append("random_faults: not in the twin; write the schedule into the scenario")
    if wrong:
        raise ScenarioError([f"{scenario.place}: {line}" for line in wrong])
    return scenario.model_copy(update=changed), skipped


def _complaint(model: OpenTable) -> str:
    """Return why no network does what this model does, or an empty string."""
    if model.kind in _CANNOT and not (model.kind == "walls" and model.parameters.get("margin_db") is not None):
        return _CANNOT[model.kind]
    if model.kind not in (*_BY_PLACE, *_BY_CHANCE, *_OF_A_CABLE):
        return "no rule of the network is known for this model"
    if model.kind == "delay":
        if model.parameters.get("jitter_s") and model.parameters.get("distribution", "uniform") != "uniform":
            return "netem has jitter of that mean only uniform"
        if model.parameters.get("senders") is not None:
            return "netem delays all that goes to a receiver; say receivers"
    if model.kind == "rate_limit" and model.parameters.get("receivers") is not None:
        return "tbf slows down all that a sender sends; say senders"
    return ""


def translate(scenario: Scenario, links: Mapping[str, Pairs]) -> Impairments:
    """Return what the network has to do for a scenario that is possible; `links` are all pairs of a channel, by its name.

    Raises ScenarioError, a line for each, for models that no network does.
    """
    found = Impairments()
    wrong: list[str] = []
    for name, every in links.items():
        place, table = ("radio", scenario.radio) if name == ROBOTS else ("uplink", scenario.uplink)
        for index, (path, model) in enumerate([] if table is None else tables_of(table, place)):
            if complaint := _complaint(model):
                wrong.append(_not_in_the_twin(path, complaint, model))
                continue
            parameters: Any = BUILT_IN[model.kind].Parameters.model_validate(model.parameters)
            sends, receives = (
                selected(names, scenario, path, []) for names in (parameters.senders, parameters.receivers)
            )
            pairs = [(sender, receiver) for sender, receiver in every if sends[sender] and receives[receiver]]
            if model.kind in _BY_PLACE:
                found.by_place.setdefault(name, []).append(index)
            elif model.kind == "loss":
                found.rules.append(Rule(f"loss{len(found.rules)}", pairs, parameters.fraction))
            elif model.kind == "bursts":
                found.rules.append(_burst(f"bursts{len(found.rules)}", pairs, parameters))
            elif model.kind == "rate_limit":
                for sender, many in Counter(sender for sender, _ in pairs).items():
                    found.rates[sender] = many * parameters.rate_bytes_s, parameters.queue_bytes, many
            elif model.kind == "delay":
                for _, receiver in pairs:
                    found.delays[receiver] = parameters.delay_s + parameters.jitter_s, parameters.jitter_s
    if wrong:
        raise ScenarioError([f"{scenario.place}: {line}" for line in wrong])
    return found


def _not_in_the_twin(path: str, reason: str, model: OpenTable) -> str:
    return f"{path}.kind: not in the twin: {reason}, got {model.kind!r}"


def _burst(name: str, pairs: Pairs, table: Any) -> Rule:
    """Return a rule whose chances are those of the model `bursts`."""
    bad = table.loss_fraction / table.bad_loss_fraction
    enter = bad / (1.0 - bad) / table.burst_packets
    return Rule(name, pairs, table.bad_loss_fraction, enter, 1.0 / table.burst_packets, bursts=True)


def ruleset(rules: Sequence[Rule], draws: Draws) -> str:
    """Return the nftables rules of a bridge; each link's first packet finds its burst as likely as any later one."""
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
    """A network that can be impaired. Commands are run on its bridge and at its nodes."""

    def __init__(self, namespaces: Namespaces, impairments: Impairments, transport: Transport) -> None:
        self._namespaces = namespaces
        self._impairments = impairments
        self._transport = transport
        self._blocked: Pairs = []

    def impair(self, draws: Draws) -> None:
        """Begin to lose, to delay and to limit. Raises LinkError where a tool refuses."""
        self._namespaces.run(["nft", "-f", "-"], ruleset(self._impairments.rules, draws))
        for node, command in self.cables():
            self._namespaces.run(["tc", "qdisc", "add", "dev", *command], node=node)

    def cables(self) -> Iterator[tuple[int | None, list[str]]]:
        """Yield what tc is told, of which device in the namespace of which node (None: at the bridge)."""
        # What is counted is payload: the table of sizes takes away what stands before it, and has an entry for each size.
        before = _WIRE_BYTES[self._transport] + _ZENOH_BYTES + HEAD_BYTES
        sizes = ["stab", "overhead", str(-before - 1), "mtu", "2047", "tsize", "2048"]
        # What is longer than the burst would never get out: a segment of TCP can hold many packets.
        longest = 0.0 if self._transport == "udp" else 1500.0
        for sender, (rate_bytes_s, queue_bytes, receivers) in self._impairments.rates.items():
            burst, limit = max(queue_bytes, longest), max(receivers * queue_bytes, longest)
            bucket = ["rate", f"{8 * rate_bytes_s:.0f}bit", "burst", f"{burst:.0f}", "limit", f"{limit:.0f}"]
            yield sender, ["eth0", "root", *sizes, "tbf", *bucket]
        for receiver, (mean_s, around_s) in self._impairments.delays.items():
            delay = ["delay", f"{mean_s * 1e6:.0f}us", f"{around_s * 1e6:.0f}us"]
            yield None, [port_of(receiver), "root", "netem", *delay]

    def block(self, pairs: Pairs) -> None:
        """Let nothing pass between `pairs` from now on, and all others pass again."""
        if pairs != self._blocked:
            added = f"add element bridge zwerm blocked {{ {_listed(pairs)} }}\n" if pairs else ""
            self._namespaces.run(["nft", "-f", "-"], f"flush set bridge zwerm blocked\n{added}")
            self._blocked = pairs

    def dropped(self) -> dict[str, int]:
        """Return how many IP packets each rule has dropped."""
        listed = json.loads(self._namespaces.run(["nft", "--json", "list", "counters"]))["nftables"]
        counters = [entry["counter"] for entry in listed if "counter" in entry]
        return {counter["name"]: counter["packets"] for counter in counters}
