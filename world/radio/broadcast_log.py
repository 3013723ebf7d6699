"""Broadcast log: it finds, on request, the links with broadcasts that were never shown to the models.

The channel shows its models the receivers in reach only. The log counts the broadcasts of each sender for as long as the same
nodes are available. So the cost of a tick does not grow with all pairs of nodes; that of `by_link` does. Where the available
nodes change often, the counts are summed for all pairs of nodes: memory does not grow with the number of faults.
"""

from typing import Final, NamedTuple

import numpy as np

from zwerm.world.scene import Bools, Ints

# Periods that are kept before they are summed, or one for each node if that is more: then the sums are no larger than these.
_PERIODS_MAX: Final = 64


class Unshown(NamedTuple):
    """Broadcast packets that no model saw, as rows (k,) of sender and receiver, and counts of each reason."""

    sender: Ints
    receiver: Ints
    absent: Ints
    off: Ints
    beyond: Ints


class _Period(NamedTuple):
    """Numbers of broadcasts `number` of `sender` (t,) while the availability of nodes did not change."""

    there: Bools  # (nodes,)
    off: Bools  # (nodes,)
    sender: Ints
    number: Ints


class BroadcastLog:
    """The broadcasts of one channel to all `members`, ids below `nodes`."""

    def __init__(self, members: range, nodes: int) -> None:
        self._members = members
        self._nodes = nodes
        self._count: Ints = np.zeros(nodes, dtype=np.int64)  # in the current period
        self._present: Bools = np.zeros(0, dtype=np.bool_)
        self._off: Bools = np.zeros(nodes, dtype=np.bool_)
        self._periods: list[_Period] = []
        self._sent: Bools = np.zeros(nodes, dtype=np.bool_)
        self._sums: Ints | None = None  # (3, nodes, nodes) packets of former periods: absent, off, beyond

    def add(self, senders: Ints, present: Bools, off: Bools) -> None:
        """Count a broadcast of each of `senders` (t,). Both arrays (robots,), (nodes,) are replaced when they change."""
        if present is not self._present or off is not self._off:
            self._close()
            self._present, self._off = present, off
        np.add.at(self._count, senders, 1)

    def senders(self) -> Ints:
        """Return the nodes that sent a broadcast, ascending."""
        self._close()
        return np.flatnonzero(self._sent)

    def link_count(self) -> int:
        """Return the number of links of all broadcasts."""
        return len(self.senders()) * (len(self._members) - 1)

    def unshown(self, sender: Ints, receiver: Ints, shown: Ints) -> Unshown:
        """Return the packets that were not among the `shown` (k,) ones of the links `sender` (k,) to `receiver` (k,)."""
        senders = self.senders()
        row = np.zeros(self._nodes, dtype=np.int64)
        row[senders] = np.arange(len(senders))
        kept = (
            np.zeros((3, len(senders), self._nodes), dtype=np.int64) if self._sums is None else self._sums[:, senders]
        )
        self._add_periods(kept, row)
        absent, off, beyond = kept
        known = np.isin(sender, senders)
        beyond[row[sender[known]], receiver[known]] -= shown[known]
        link = np.zeros(beyond.shape, dtype=np.bool_)
        link[:, self._members.start : self._members.stop] = True
        link[np.arange(len(senders)), senders] = False
        link &= (absent > 0) | (off > 0) | (beyond > 0)
        at, to = link.nonzero()
        return Unshown(senders[at], to, absent[at, to], off[at, to], beyond[at, to])

    def _close(self) -> None:
        """End the current period."""
        sender = np.flatnonzero(self._count)
        if len(sender):
            there = np.ones(self._nodes, dtype=np.bool_)
            there[: len(self._present)] = self._present
            self._periods.append(_Period(there, self._off, sender, self._count[sender]))
            self._count[sender] = 0
            self._sent[sender] = True
            if len(self._periods) > max(_PERIODS_MAX, self._nodes):
                if self._sums is None:
                    self._sums = np.zeros((3, self._nodes, self._nodes), dtype=np.int64)
                self._add_periods(self._sums, np.arange(self._nodes))
                self._periods.clear()

    def _add_periods(self, sums: Ints, row: Ints) -> None:
        """Add the packets of the kept periods to `sums` (3, rows, nodes), where a sender has the row `row` (nodes,)."""
        absent, off, beyond = sums
        for period in self._periods:
            rows, count = row[period.sender], period.number[:, None]
            absent[rows] += count * ~period.there
            off[rows] += count * (period.there & period.off)
            beyond[rows] += count * (period.there & ~period.off)
