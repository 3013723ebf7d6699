"""Compare the modelled and the real result of each packet of a twin run.

The compared quantity is the fraction of packets that pass. For the models these are sent packets less dropped ones. For
the network these are packets that arrive before the end of the run. The half width belongs to a 99 % confidence
interval of the difference. A link with n modelled and m real packets adds `p (1 - p) g (n/N^2 + m/M^2)` to the
variance. N and M are the totals over all links; g > 1 accounts for the correlation of packets in bursts. The two sides
agree if the difference is within the interval, and the difference of each link is within a joint interval for all
links.
"""

import itertools
import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from statistics import NormalDist
from typing import Any, Final, NamedTuple

import numpy as np

from zwerm.link.peer_radio import ARRIVED, EVERYONE, HEARD, SENT
from zwerm.twin.twin_runner import TwinRun

Z99: Final = 2.5758

Link = tuple[str, int, int]


def compare(run: TwinRun) -> dict[str, Any]:
    """Return the comparison, ready for a JSON encoder."""
    dt_s = run.world.scenario.time.dt_s
    sent, arrived, delay_ns, heard_ticks = _real(run)
    modelled = _modelled(run)
    real_sent, real_arrived = sum(map(len, sent.values())), sum(map(len, arrived.values()))
    model_sent, model_passed = (sum(each[part] for each in modelled.values()) for part in range(2))
    runs = [length for link, numbers in sent.items() for length in lost_runs(numbers, arrived[link])]
    real = real_arrived / real_sent if real_sent else math.nan
    model = model_passed / model_sent if model_sent else math.nan
    counts = _counts(run, modelled, sent, arrived)
    half, links = half_width(counts), agreeing(counts)
    channels = run.world.medium.channels.values()
    delivered = sum(int(each.ledger.delivered().sum()) for each in channels)
    model_delay_s = sum(each.ledger.delay_ticks for each in channels) * dt_s / delivered if delivered else None
    return {
        "outcome": run.outcome,
        "ticks": run.world.tick,
        "wall_s": round(run.wall_s, 3),
        "late_commands": run.world.intake.late_count,
        "middleware_lost": run.middleware_lost,
        "modelled": {
            "sent": model_sent,
            "passed": model_passed,
            "passed_fraction": _json(model),
            "dropped": run.world.medium.summary()["dropped"],
            "heard_after_mean_s": model_delay_s,
        },
        "real": {
            "sent": real_sent,
            "passed": real_arrived,
            "passed_fraction": _json(real),
            "dropped_ip_packets": run.network_dropped,
            "lost_run_mean_packets": float(np.mean(runs)) if runs else None,
            "heard_after_mean_s": float(np.mean(heard_ticks)) * dt_s if heard_ticks else None,
            "delay_s": _spread(delay_ns),
            "tcp_segments": run.segments,
            "tcp_segments_sent_again": run.retransmitted,
        },
        "difference": _json(real - model),
        "half_width": _json(half),
        "links_that_agree": links,
        "agrees": bool(abs(real - model) <= half) and links == len(counts),
        "links": _by_link(modelled, sent, arrived),
    }


def _real(run: TwinRun) -> tuple[dict[Link, list[int]], dict[Link, set[int]], list[int], list[int]]:
    """Return by link the packet numbers sent and arrived; for all packets the delays [ns] and the ticks until
    received."""
    audience: dict[tuple[str, int], list[int]] = defaultdict(list)
    for name, pairs in run.links.items():
        for sender, receiver in pairs:
            audience[name, sender].append(receiver)
    sent: dict[Link, list[int]] = defaultdict(list)
    arrived: dict[Link, set[int]] = defaultdict(set)
    delay_ns: list[int] = []
    heard_ticks: list[int] = []
    for node, lines in sorted(run.logs.items()):
        for line in lines:
            name = run.channels[line.channel]
            if line.what == SENT:
                for receiver in audience[name, node] if line.other == EVERYONE else [line.other]:
                    sent[name, node, receiver].append(line.number)
            elif line.what == ARRIVED:
                arrived[name, line.other, node].add(line.number)
                delay_ns.append(line.at - line.sent_ns)
            elif line.what == HEARD:
                heard_ticks.append(line.at - line.tick)
    return sent, arrived, delay_ns, heard_ticks


def _modelled(run: TwinRun) -> dict[Link, tuple[int, int]]:
    """Return by link the numbers of packets sent and not dropped, from the world's ledgers."""
    found: dict[Link, tuple[int, int]] = {}
    for name, channel in run.world.medium.channels.items():
        ledger = channel.ledger.by_link()
        dropped = [sum(column) for column in zip(*ledger["dropped"].values(), strict=True)] or [0] * len(ledger["sent"])
        for sender, receiver, sent, lost in zip(
            ledger["sender"], ledger["receiver"], ledger["sent"], dropped, strict=True
        ):
            if sent:
                found[name, sender, receiver] = sent, sent - lost
    return found


def lost_runs(sent: list[int], arrived: set[int]) -> list[int]:
    """Return the lengths of the runs of lost packets on a link."""
    fates = itertools.groupby(number in arrived for number in sent)
    return [len(list(run)) for passed, run in fates if not passed]


class LinkCounts(NamedTuple):
    """Packets of a link: modelled, passed in the model, sent, arrived; `variance_factor` is the factor g for bursts."""

    modelled: int
    passed: int
    real: int
    arrived_count: int
    variance_factor: float

    @property
    def variance(self) -> float:
        """Variance of one packet's result, p (1 - p) g, with p over both sides."""
        p = (self.passed + self.arrived_count) / (self.modelled + self.real)
        return p * (1.0 - p) * self.variance_factor


def _counts(
    run: TwinRun, modelled: dict[Link, tuple[int, int]], sent: dict[Link, list[int]], arrived: dict[Link, set[int]]
) -> list[LinkCounts]:
    """Return the counts of each link."""
    variance_factor: dict[tuple[int, int], float] = {}
    for rule in run.impairments.rules:
        if rule.bursts:
            correlation = 1.0 - rule.leave - rule.enter
            variance_factor |= dict.fromkeys(rule.pairs, (1.0 + correlation) / (1.0 - correlation))
    return [
        LinkCounts(*modelled.get(link, (0, 0)), len(sent[link]), len(arrived[link]), variance_factor.get(link[1:], 1.0))
        for link in {**modelled, **sent}
    ]


def half_width(counts: Sequence[LinkCounts]) -> float:
    """Return the half width of the 99 % interval for the difference of the two fractions over all links."""
    here, there = sum(each.modelled for each in counts), sum(each.real for each in counts)
    if not here or not there:
        return math.nan
    variance = sum(each.variance * (each.modelled / here**2 + each.real / there**2) for each in counts)
    return Z99 * math.sqrt(variance)


def agreeing(counts: Sequence[LinkCounts]) -> int:
    """Return the number of links that agree.

    If both sides have the same probabilities, all links agree in 99 % of runs (Bonferroni).
    """
    z = NormalDist().inv_cdf(1.0 - 0.005 / max(1, len(counts)))

    def agrees(each: LinkCounts) -> bool:
        if not each.modelled or not each.real:
            return False
        half = z * math.sqrt(each.variance * (1.0 / each.modelled + 1.0 / each.real))
        return abs(each.passed / each.modelled - each.arrived_count / each.real) <= half

    return sum(map(agrees, counts))


def _spread(delay_ns: list[int]) -> dict[str, float] | None:
    if not delay_ns:
        return None
    delay_s = np.array(delay_ns) * 1e-9
    median, most = np.quantile(delay_s, [0.5, 0.99]).tolist()
    return {"mean": float(delay_s.mean()), "median": median, "p99": most, "max": float(delay_s.max())}


def _by_link(
    modelled: dict[Link, tuple[int, int]], sent: dict[Link, list[int]], arrived: dict[Link, set[int]]
) -> dict[str, list[Any]]:
    """Return all links as columns, sorted by channel, sender and receiver."""
    links = sorted({*modelled, *sent})
    counts = Counter({link: len(numbers) for link, numbers in sent.items()})
    return {
        "channel": [link[0] for link in links],
        "sender": [link[1] for link in links],
        "receiver": [link[2] for link in links],
        "modelled_sent": [modelled.get(link, (0, 0))[0] for link in links],
        "modelled_passed": [modelled.get(link, (0, 0))[1] for link in links],
        "sent": [counts[link] for link in links],
        "passed": [len(arrived[link]) for link in links],
    }


def _json(value: float) -> float | None:
    return value if math.isfinite(value) else None
