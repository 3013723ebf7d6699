"""Ledger: counts of sent, delivered and dropped packets, by link of a channel and by cause.

At every tick and for every link: sent = delivered + dropped, by cause + in flight. Dropped packets are out of reach (their
receivers were), or losses. Broadcast packets that no model saw are counted by cause. They get a link only on request
(`by_link`). They are part of the totals, and not of the columns `sent`, `dropped` and `out_of_reach`.

A copy that the medium made counts as sent, and as a copy; a damaged packet that arrives counts as delivered, and as damaged.
The age of information of a link is the time since its newest delivered packet was sent, from its first delivery on.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zwerm.world.radio.broadcast_log import BroadcastLog
from zwerm.world.radio.links import Column, Links
from zwerm.world.scene import Floats, Ints


class UnshownCause(NamedTuple):
    """The cause under which broadcast packets that no model saw are counted, and whether their receivers are out of reach."""

    cause: str
    out_of_reach: bool


class Ledger:
    """The ledger of one channel, among `nodes` nodes. `broadcasts` are those to all `members`."""

    def __init__(self, links: Links, nodes: int, dt_s: float, members: range) -> None:
        self.copies = 0
        self.damaged = 0
        self.delay_ticks = 0  # from sending to delivery, over all delivered packets
        self.node_messages: Ints = np.zeros(nodes, dtype=np.int64)  # transmissions, by sender
        self.node_bytes: Ints = np.zeros(nodes, dtype=np.int64)  # payload of these
        self._links = links
        self._dt_s = dt_s
        self._sent = links.integers()
        self._delivered = links.integers()
        self._lost: dict[str, Column] = {}  # by cause
        self._out_of_reach: dict[str, Column] = {}
        self.broadcasts = BroadcastLog(members, nodes)
        self._addressed = links.integers()  # packets with an addressee, and copies
        self._unshown: dict[str, tuple[UnshownCause, int]] = {}  # by the field of `Unshown` that tells their links
        # Age of information [ticks]: sending of the newest packet, its delivery, the sum of ages, the largest age.
        self._newest = links.integers(-1)
        self._since = links.integers()
        self._age_sum = links.numbers()
        self._age_peak = links.numbers()
        self._age_ticks = links.integers()

    def transmit(self, sender: Ints, sizes: Ints) -> None:
        """Count one transmission of each of `sender` (t,), with the sizes of their payloads [bytes] (t,)."""
        np.add.at(self.node_messages, sender, 1)
        np.add.at(self.node_bytes, sender, sizes)

    def send(self, link: Ints, addressed: bool = False) -> None:
        """Count packets sent on `link` (k,): broadcast ones, or ones with an addressee and copies."""
        np.add.at(self._sent.values, link, 1)
        if addressed:
            np.add.at(self._addressed.values, link, 1)

    def drop(self, link: Ints, cause: str, out_of_reach: bool = False) -> None:
        """Count packets dropped on `link` (k,), with receivers in reach or out of it."""
        if len(link):
            columns = self._out_of_reach if out_of_reach else self._lost
            column = columns.get(cause)
            if column is None:
                column = columns[cause] = self._links.integers()
            np.add.at(column.values, link, 1)

    def drop_unshown(self, reason: str, count: int, cause: str, out_of_reach: bool) -> None:
        """Count broadcast packets that no model saw, for a `reason` that is a field of `Unshown`."""
        if count:
            before = self._unshown[reason][1] if reason in self._unshown else 0
            self._unshown[reason] = UnshownCause(cause, out_of_reach), before + count

    def deliver(self, link: Ints, sent_tick: Ints, tick: int) -> None:
        """Count packets received at `tick` on `link` (k,) that were sent at `sent_tick` (k,)."""
        np.add.at(self._delivered.values, link, 1)
        self.delay_ticks += tick * len(link) - int(sent_tick.sum())
        newest = self._newest.values
        before = newest[link]
        np.maximum.at(newest, link, sent_tick)
        fresher = newest[link] > before
        if not fresher.all():
            link, before = link[fresher], before[fresher]
        since = self._since.values[link]
        # The age grew by one a tick from `since` to now. Two rows of the same link write the same value.
        ticks = np.where(before < 0, 0, tick - since)
        self._age_sum.values[link] += ticks * (0.5 * (since + tick - 1) - before)
        self._age_ticks.values[link] += ticks
        peak = np.where(before < 0, 0, tick - before)
        self._age_peak.values[link] = np.maximum(self._age_peak.values[link], peak)
        self._since.values[link] = tick

    # --- totals -----------------------------------------------------------------------------------------------------

    def sent_total(self) -> int:
        """Return the packets sent."""
        return int(self.sent().sum()) + sum(count for _, count in self._unshown.values())

    def dropped_total(self) -> dict[str, int]:
        """Return the packets dropped, by cause; causes are sorted."""
        found = {cause: int(column.sum()) for cause, column in self.dropped().items()}
        for (cause, _), count in self._unshown.values():
            found[cause] = found.get(cause, 0) + count
        return {cause: count for cause, count in sorted(found.items()) if count}

    def out_of_reach_total(self) -> int:
        """Return the packets dropped because their receivers were out of reach."""
        return int(self.out_of_reach().sum()) + sum(count for (_, out), count in self._unshown.values() if out)

    def link_count(self) -> int:
        """Return the number of links in `by_link`."""
        senders = self.broadcasts.senders()
        others = ~np.isin(self._of_links(self._links.sender), senders)
        return self.broadcasts.link_count() + int(np.count_nonzero(others))

    # --- by link, packets that no model saw left out ------------------------------------------------------------------

    def sent(self) -> Ints:
        """Return the packets sent, by link."""
        return self._of(self._sent)

    def delivered(self) -> Ints:
        """Return the packets delivered, by link."""
        return self._of(self._delivered)

    def dropped(self) -> dict[str, Ints]:
        """Return the packets dropped, by cause and link; causes are sorted."""
        found: dict[str, Ints] = {}
        for cause, column in sorted([*self._lost.items(), *self._out_of_reach.items()], key=lambda item: item[0]):
            found[cause] = found[cause] + self._of(column) if cause in found else self._of(column)
        return found

    def out_of_reach(self) -> Ints:
        """Return the packets dropped because their receivers were out of reach, by link."""
        found: Ints = np.zeros(self._links.count, dtype=np.int64)
        for column in self._out_of_reach.values():
            found = found + self._of(column)
        return found

    def in_flight(self) -> Ints:
        """Return the packets sent and neither delivered nor dropped yet, by link."""
        left: Ints = self.sent() - self.delivered()
        for dropped in self.dropped().values():
            left = left - dropped
        return left

    def imbalance(self, in_flight: Ints) -> list[str]:
        """Return a line for every link whose ledger differs from the counted packets in flight (links,)."""
        wrong = np.flatnonzero(self.in_flight() != in_flight)
        return [
            f"link {self._links.sender[row]} to {self._links.receiver[row]}: the ledger has {self.in_flight()[row]} packets"
            f" in flight, the queue has {in_flight[row]}"
            for row in wrong.tolist()
        ]

    def ages_s(self, tick: int) -> tuple[float, float] | None:
        """Return the mean over links of the mean age of information up to `tick`, and the largest age [s].

        None before the first delivery.
        """
        mean_s, peak_s = self.link_ages_s(tick)
        counted = ~np.isnan(mean_s)
        return (float(mean_s[counted].mean()), float(peak_s[counted].max())) if counted.any() else None

    def link_ages_s(self, tick: int) -> tuple[Floats, Floats]:
        """Return by link the mean and the largest age of information up to `tick` [s]; nan before the first delivery."""
        newest, since = self._of(self._newest), self._of(self._since)
        received = newest >= 0
        left = np.where(received, tick - since, 0)
        ticks = self._of(self._age_ticks) + left
        total = self._of(self._age_sum) + left * (0.5 * (since + tick - 1) - newest)
        counted = received & (ticks > 0)
        peak = np.maximum(self._of(self._age_peak), tick - newest)
        mean = np.divide(total, ticks, out=np.full(len(ticks), np.nan), where=counted)
        return mean * self._dt_s, np.where(counted, peak, np.nan) * self._dt_s

    def by_link(self, tick: int | None = None) -> dict[str, Any]:
        """Return the counts of all links as columns, sorted by sender and receiver, for a JSON encoder.

        Packets that no model saw are among them: the cost grows with all pairs. With `tick`, there are columns of the mean and
        the largest age of information up to it [s], None before the first delivery.
        """
        sender, receiver = self._of_links(self._links.sender), self._of_links(self._links.receiver)
        unshown = self.broadcasts.unshown(sender, receiver, self.sent() - self._of(self._addressed))
        nodes = len(self.node_messages)
        known, extra = sender * nodes + receiver, unshown.sender * nodes + unshown.receiver
        links = np.union1d(known, extra)
        at, extra_at = np.searchsorted(links, known), np.searchsorted(links, extra)

        def column(values: NDArray[Any], fill: float = 0) -> NDArray[Any]:
            whole = np.full(len(links), fill, dtype=values.dtype)
            whole[at] = values
            return whole

        sent, out_of_reach = column(self.sent()), column(self.out_of_reach())
        dropped = {cause: column(values) for cause, values in self.dropped().items()}
        for reason, ((cause, out), _) in self._unshown.items():
            count = getattr(unshown, reason)
            sent[extra_at] += count
            dropped.setdefault(cause, np.zeros(len(links), dtype=np.int64))[extra_at] += count
            if out:
                out_of_reach[extra_at] += count
        found = {
            "sender": (links // nodes).tolist(),
            "receiver": (links % nodes).tolist(),
            "sent": sent.tolist(),
            "delivered": column(self.delivered()).tolist(),
            "dropped": {cause: values.tolist() for cause, values in sorted(dropped.items())},
            "out_of_reach": out_of_reach.tolist(),
            "in_flight": column(self.in_flight()).tolist(),
        }
        if tick is not None:
            mean_s, peak_s = (column(ages, np.nan) for ages in self.link_ages_s(tick))
            found |= {"age_mean_s": _numbers(mean_s), "age_max_s": _numbers(peak_s)}
        return found

    def _of(self, column: Column) -> NDArray[Any]:
        return self._of_links(column.values)

    def _of_links(self, values: NDArray[Any]) -> NDArray[Any]:
        return values[: self._links.count]


def _numbers(values: Floats) -> list[float | None]:
    """Return numbers for JSON: None in place of nan."""
    return [None if value != value else value for value in values.tolist()]
