"""The radio's books: what became of every packet, for every link of a channel and for every cause.

At every tick, for every link: sent = delivered + dropped, by cause + in flight. Of the dropped, some never had a chance: their
receivers were out of reach. The others are losses. A copy that the medium made counts as
sent, and as a copy; a damaged packet that arrives counts as delivered, and as damaged. The age of a link's information is
the time since its newest delivered packet was sent, from its first delivery on.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from zwerm.world.radio.links import Column, Links
from zwerm.world.scene import Floats, Ints


class Ledger:
    """The books of one channel, among `nodes` nodes."""

    def __init__(self, links: Links, nodes: int, dt_s: float) -> None:
        self.copies = 0
        self.damaged = 0
        self.delay_ticks = 0  # from sending to handing over, of all that were delivered
        self.node_messages: Ints = np.zeros(nodes, dtype=np.int64)  # transmissions, by sender
        self.node_bytes: Ints = np.zeros(nodes, dtype=np.int64)  # payload of these
        self._links = links
        self._dt_s = dt_s
        self._sent = links.integers()
        self._delivered = links.integers()
        self._lost: dict[str, Column] = {}  # by cause
        self._out_of_reach: dict[str, Column] = {}
        # Of the age of information, in ticks: the newest packet's, since when it is, the sum so far, the largest.
        self._newest = links.integers(-1)
        self._since = links.integers()
        self._age_sum = links.numbers()
        self._age_peak = links.numbers()
        self._age_ticks = links.integers()

    def send(self, link: Ints) -> None:
        """Take note of packets sent on `link` (k,)."""
        np.add.at(self._sent.values, link, 1)

    def drop(self, link: Ints, cause: str, out_of_reach: bool = False) -> None:
        """Take note of packets dropped on `link` (k,), whose receivers were in reach or out of it."""
        if len(link):
            columns = self._out_of_reach if out_of_reach else self._lost
            column = columns.get(cause)
            if column is None:
                column = columns[cause] = self._links.integers()
            np.add.at(column.values, link, 1)

    def deliver(self, link: Ints, sent_tick: Ints, tick: int) -> None:
        """Take note of packets received at `tick` on `link` (k,) that were sent at `sent_tick` (k,)."""
        np.add.at(self._delivered.values, link, 1)
        self.delay_ticks += tick * len(link) - int(sent_tick.sum())
        newest = self._newest.values
        before = newest[link]
        np.maximum.at(newest, link, sent_tick)
        fresher = newest[link] > before
        if not fresher.all():
            link, before = link[fresher], before[fresher]
        since = self._since.values[link]
        # From `since` to now the age grew by one a tick. Of a link that is here twice both rows write the same.
        ticks = np.where(before < 0, 0, tick - since)
        self._age_sum.values[link] += ticks * (0.5 * (since + tick - 1) - before)
        self._age_ticks.values[link] += ticks
        peak = np.where(before < 0, 0, tick - before)
        self._age_peak.values[link] = np.maximum(self._age_peak.values[link], peak)
        self._since.values[link] = tick

    # --- what the books say -----------------------------------------------------------------------------------------

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
        """Return by link the packets sent that have neither been delivered nor dropped yet."""
        left: Ints = self.sent() - self.delivered()
        for dropped in self.dropped().values():
            left = left - dropped
        return left

    def imbalance(self, in_flight: Ints) -> list[str]:
        """Return a line for every link on which the books do not agree with what is in flight (links,) when counted."""
        wrong = np.flatnonzero(self.in_flight() != in_flight)
        return [
            f"link {self._links.sender[row]} to {self._links.receiver[row]}: the books have {self.in_flight()[row]} packets"
            f" in flight, the air has {in_flight[row]}"
            for row in wrong.tolist()
        ]

    def ages_s(self, tick: int) -> tuple[float, float] | None:
        """Return the mean over links of the mean age of information up to `tick`, and the largest age [s].

        None where nothing was ever delivered.
        """
        mean_s, peak_s = self.link_ages_s(tick)
        counted = ~np.isnan(mean_s)
        return (float(mean_s[counted].mean()), float(peak_s[counted].max())) if counted.any() else None

    def link_ages_s(self, tick: int) -> tuple[Floats, Floats]:
        """Return by link the mean and the largest age of information up to `tick` [s]; nan where nothing was delivered."""
        newest, since = self._of(self._newest), self._of(self._since)
        heard = newest >= 0
        left = np.where(heard, tick - since, 0)
        ticks = self._of(self._age_ticks) + left
        total = self._of(self._age_sum) + left * (0.5 * (since + tick - 1) - newest)
        counted = heard & (ticks > 0)
        peak = np.maximum(self._of(self._age_peak), tick - newest)
        mean = np.divide(total, ticks, out=np.full(len(ticks), np.nan), where=counted)
        return mean * self._dt_s, np.where(counted, peak, np.nan) * self._dt_s

    def order(self) -> Ints:
        """Return the rows of the links in the order of sender and receiver."""
        return np.lexsort((self._of_links(self._links.receiver), self._of_links(self._links.sender)))

    def by_link(self) -> dict[str, Any]:
        """Return the books as columns, sorted by sender and receiver, ready for a JSON encoder."""
        sender, receiver = self._of_links(self._links.sender), self._of_links(self._links.receiver)
        order = self.order()
        return {
            "sender": sender[order].tolist(),
            "receiver": receiver[order].tolist(),
            "sent": self.sent()[order].tolist(),
            "delivered": self.delivered()[order].tolist(),
            "dropped": {cause: column[order].tolist() for cause, column in self.dropped().items()},
            "out_of_reach": self.out_of_reach()[order].tolist(),
            "in_flight": self.in_flight()[order].tolist(),
        }

    def _of(self, column: Column) -> NDArray[Any]:
        return self._of_links(column.values)

    def _of_links(self, values: NDArray[Any]) -> NDArray[Any]:
        return values[: self._links.count]
