"""Report of a radio: counts in total, by channel and by link, messages by node, and the age of information."""

from typing import Any, Final

import numpy as np

from zwerm.world.radio.medium import Medium

# Largest number of links with counts of their own in the JSON object.
LINKS_IN_JSON_MAX: Final = 10_000


def radio_report(medium: Medium, tick: int) -> dict[str, Any]:
    """Return the counts for a JSON encoder: over all channels, and of each channel."""
    return {**medium.summary(), "channels": {name: _channel(medium, name, tick) for name in medium.channels}}


def _channel(medium: Medium, name: str, tick: int) -> dict[str, Any]:
    channel = medium.channels[name]
    ledger = channel.ledger
    age = ledger.ages_s(tick)
    links = ledger.by_link(tick) if ledger.link_count() <= LINKS_IN_JSON_MAX else None
    delivered = int(ledger.delivered().sum())
    return {
        "sent": ledger.sent_total(),
        "delivered": delivered,
        "dropped": ledger.dropped_total(),
        "out_of_reach": ledger.out_of_reach_total(),
        "in_flight": int(ledger.in_flight().sum()),
        "messages": ledger.node_messages.tolist(),
        "message_bytes": ledger.node_bytes.tolist(),
        "delay_mean_s": ledger.delay_ticks / delivered * channel.dt_s if delivered else None,
        "age_mean_s": None if age is None else age[0],
        "age_max_s": None if age is None else age[1],
        "links": links,
    }


def messages(medium: Medium) -> int:
    """Return the number of transmissions of all nodes over all channels; a broadcast is one."""
    return sum(int(channel.ledger.node_messages.sum()) for channel in medium.channels.values())


def radio_metrics(medium: Medium, robots: int, tick: int) -> dict[str, float]:
    """Return the metrics of a radio over all channels; empty if no node sent a packet."""
    ledgers = [channel.ledger for channel in medium.channels.values()]
    sent = sum(each.sent_total() for each in ledgers)
    if not sent:
        return {}
    messages = np.sum([each.node_messages[:robots] for each in ledgers], axis=0)
    message_bytes = np.sum([each.node_bytes[:robots] for each in ledgers], axis=0)
    out_of_reach = sum(each.out_of_reach_total() for each in ledgers)
    found = {"out_of_reach_fraction": out_of_reach / sent}
    if sent > out_of_reach:
        found["delivered_fraction"] = sum(int(each.delivered().sum()) for each in ledgers) / (sent - out_of_reach)
    found |= {
        "messages_per_robot_mean": float(messages.mean()),
        "messages_per_robot_max": float(messages.max()),
        "bytes_per_robot_mean": float(message_bytes.mean()),
        "bytes_per_robot_max": float(message_bytes.max()),
    }
    ages = [age for age in (each.ages_s(tick) for each in ledgers) if age is not None]
    if ages:
        found["information_age_mean_s"] = float(np.mean([mean for mean, _ in ages]))
        found["information_age_max_s"] = max(peak for _, peak in ages)
    return found
