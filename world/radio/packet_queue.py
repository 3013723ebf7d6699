"""Packet queue of a channel: packets in flight, by the tick at which they are due, and packets in inboxes.

A packet is delivered with the first observation of its receiver at or after the tick at which it is due. A sleeping or paused
receiver gets it later. An inbox is sorted by arrival, then by sending, then by the ids of the senders.
"""

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zwerm.wire.messages import Packet
from zwerm.world.scene import Bools, Floats, Ints

Objects = NDArray[np.object_]


class PacketBatch:
    """Packets of one channel, in order, arrays (k,)."""

    __slots__ = ("arrival_s", "link", "packets", "receiver", "sender", "sent_tick")

    def __init__(
        self, sender: Ints, receiver: Ints, link: Ints, sent_tick: Ints, arrival_s: Floats, packets: Objects
    ) -> None:
        self.sender = sender
        self.receiver = receiver
        self.link = link
        self.sent_tick = sent_tick
        self.arrival_s = arrival_s
        self.packets = packets

    def take(self, rows: Ints | Bools | slice) -> "PacketBatch":
        """Return the packets at `rows`."""
        return PacketBatch(
            self.sender[rows],
            self.receiver[rows],
            self.link[rows],
            self.sent_tick[rows],
            self.arrival_s[rows],
            self.packets[rows],
        )


class _Arrived(NamedTuple):
    """Packets that arrived at one tick, by receiver: those of node n are in rows `starts[n]` to `starts[n + 1]`."""

    batch: PacketBatch
    receivers: list[int]  # ascending
    starts: list[int]  # (nodes + 1,)


class PacketQueue:
    """The packets of one channel among `nodes` nodes."""

    def __init__(self, nodes: int) -> None:
        self._nodes = nodes
        self._ids: NDArray[Any] = np.arange(nodes + 1, dtype=np.uint16 if nodes < 65_536 else np.int64)
        self._due: dict[int, list[PacketBatch]] = {}
        self._inboxes: dict[int, list[PacketBatch]] = {}
        self._arrived: _Arrived | None = None  # packets of this tick that are not in `_inboxes` yet

    def push(self, batch: PacketBatch, due: Ints | int) -> None:
        """Add packets that are due at one tick, or each (k,) at its own."""
        if isinstance(due, int):
            self._due.setdefault(due, []).append(batch)
            return
        order = np.argsort(batch.arrival_s, kind="stable")
        batch, due = batch.take(order), due[order]
        for tick in np.unique(due).tolist():
            self._due.setdefault(tick, []).append(batch.take(due == tick))

    def arrive(self, tick: int) -> None:
        """Move packets that are due at `tick` to the inboxes."""
        batches = self._due.pop(tick, None)
        if batches is None:
            return
        if len(batches) == 1:
            arrived, receiver = batches[0], batches[0].receiver
        else:
            arrived = joined(batches)
            arrived = arrived.take(np.lexsort((arrived.sender, arrived.sent_tick, arrived.arrival_s)))
            receiver = arrived.receiver
        order = np.argsort(receiver.astype(self._ids.dtype), kind="stable")
        arrived = arrived.take(order)
        starts = np.searchsorted(arrived.receiver.astype(self._ids.dtype), self._ids)
        self._distribute()
        self._arrived = _Arrived(arrived, np.flatnonzero(starts[1:] > starts[:-1]).tolist(), starts.tolist())

    def _distribute(self) -> None:
        """Give the packets that arrived last to the inboxes of their receivers."""
        if self._arrived is None:
            return
        batch, receivers, starts = self._arrived
        self._arrived = None
        for node in receivers:
            self._inboxes.setdefault(node, []).append(batch.take(slice(starts[node], starts[node + 1])))

    def waiting(self) -> Sequence[int]:
        """Return the nodes with packets in their inboxes, in id order."""
        if self._arrived is None:
            return sorted(self._inboxes)
        return sorted({*self._inboxes, *self._arrived.receivers}) if self._inboxes else self._arrived.receivers

    def collect(self, nodes: Sequence[int]) -> tuple[dict[int, tuple[Packet, ...]], Ints, Ints]:
        """Empty the inboxes of `nodes`; return their packets, and the link (k,) and tick of sending (k,) of each packet."""
        arrived = self._arrived
        if arrived is not None and not self._inboxes and set(arrived.receivers).issubset(nodes):
            # All inboxes are emptied in the tick in which they were filled: no need to fill them.
            self._arrived = None
            packets, starts = arrived.batch.packets.tolist(), arrived.starts
            whole = {node: tuple(packets[starts[node] : starts[node + 1]]) for node in arrived.receivers}
            return whole, arrived.batch.link, arrived.batch.sent_tick
        self._distribute()
        handed: dict[int, tuple[Packet, ...]] = {}
        taken: list[PacketBatch] = []
        for node in nodes:
            batches = self._inboxes.pop(node, None)
            if batches is not None:
                handed[node] = tuple(chain.from_iterable([batch.packets.tolist() for batch in batches]))
                taken += batches
        if not taken:
            return handed, _NOTHING, _NOTHING
        return handed, np.concatenate([each.link for each in taken]), np.concatenate([each.sent_tick for each in taken])

    def remove_to(self, receiver: int) -> Ints:
        """Empty an inbox; return the links (k,) of its packets."""
        self._distribute()
        batches = self._inboxes.pop(receiver, ())
        return np.concatenate([_NOTHING, *(batch.link for batch in batches)])

    def remove_due(self, tick: int, off: Bools) -> tuple[Ints, Ints]:
        """Remove packets due at `tick` for receivers in `off` (nodes,); return their receivers (k,) and links (k,)."""
        batches = self._due.get(tick)
        if batches is None:
            return _NOTHING, _NOTHING
        removed = []
        for index, batch in enumerate(batches):
            lost = off[batch.receiver]
            if lost.any():
                removed.append(batch.take(lost))
                batches[index] = batch.take(~lost)
        return (
            np.concatenate([_NOTHING, *(each.receiver for each in removed)]),
            np.concatenate([_NOTHING, *(each.link for each in removed)]),
        )

    def remove_from(self, sender: int) -> Ints:
        """Remove all packets of `sender` that are not delivered yet; return their links (k,)."""
        self._distribute()
        removed = [_NOTHING]
        for boxes in (self._due, self._inboxes):
            for key in list(boxes):
                kept = []
                for batch in boxes[key]:
                    stale = batch.sender == sender
                    removed.append(batch.link[stale])
                    if not stale.all():
                        kept.append(batch.take(~stale) if stale.any() else batch)
                if kept:
                    boxes[key] = kept
                else:
                    del boxes[key]
        return np.concatenate(removed)

    def in_flight(self, links: int) -> Ints:
        """Count the packets that are sent and not delivered yet, by link (links,)."""
        self._distribute()
        counts = np.zeros(links, dtype=np.int64)
        for boxes in (self._due, self._inboxes):
            for batches in boxes.values():
                for batch in batches:
                    np.add.at(counts, batch.link, 1)
        return counts


def joined(batches: Sequence[PacketBatch]) -> PacketBatch:
    """Return the packets of all `batches` in one, in order."""
    return PacketBatch(
        np.concatenate([each.sender for each in batches]),
        np.concatenate([each.receiver for each in batches]),
        np.concatenate([each.link for each in batches]),
        np.concatenate([each.sent_tick for each in batches]),
        np.concatenate([each.arrival_s for each in batches]),
        np.concatenate([each.packets for each in batches]),
    )


_NOTHING: Ints = np.zeros(0, dtype=np.int64)
