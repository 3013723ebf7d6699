"""Packets on their way: those still in flight, by the tick they are due, and those that wait in inboxes.

A packet is handed over with the receiver's first observation at or after the tick it is due; a receiver that sleeps or is
paused finds it later. An inbox is in the order of arrival, then of sending, then of the senders' ids.
"""

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zwerm.wire.messages import Packet
from zwerm.world.scene import Bools, Floats, Ints

Objects = NDArray[np.object_]


class Parcel:
    """Some packets of one channel, in order, arrays (k,)."""

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

    def take(self, rows: Ints | Bools | slice) -> "Parcel":
        """Return the packets at `rows`."""
        return Parcel(
            self.sender[rows],
            self.receiver[rows],
            self.link[rows],
            self.sent_tick[rows],
            self.arrival_s[rows],
            self.packets[rows],
        )


class Mail:
    """The mail of one channel among `nodes` nodes."""

    def __init__(self, nodes: int) -> None:
        self._nodes = nodes
        self._ids: NDArray[Any] = np.arange(nodes + 1, dtype=np.uint16 if nodes < 65_536 else np.int64)
        self._due: dict[int, list[Parcel]] = {}
        self._inboxes: dict[int, list[Parcel]] = {}

    def post(self, parcel: Parcel, due: Ints | int) -> None:
        """Send packets on their way, all due at one tick or each (k,) at its own."""
        if isinstance(due, int):
            self._due.setdefault(due, []).append(parcel)
            return
        order = np.argsort(parcel.arrival_s, kind="stable")
        parcel, due = parcel.take(order), due[order]
        for tick in np.unique(due).tolist():
            self._due.setdefault(tick, []).append(parcel.take(due == tick))

    def arrive(self, tick: int) -> None:
        """Put what is due at `tick` into the inboxes."""
        parcels = self._due.pop(tick, None)
        if parcels is None:
            return
        if len(parcels) == 1:
            arrived, receiver = parcels[0], parcels[0].receiver
        else:
            arrived = joined(parcels)
            arrived = arrived.take(np.lexsort((arrived.sender, arrived.sent_tick, arrived.arrival_s)))
            receiver = arrived.receiver
        order = np.argsort(receiver.astype(self._ids.dtype), kind="stable")
        arrived = arrived.take(order)
        starts = np.searchsorted(arrived.receiver.astype(self._ids.dtype), self._ids)
        for node in np.flatnonzero(starts[1:] > starts[:-1]).tolist():
            self._inboxes.setdefault(node, []).append(arrived.take(slice(starts[node], starts[node + 1])))

    def waiting(self) -> Sequence[int]:
        """Return the nodes that have packets to receive, in id order."""
        return sorted(self._inboxes)

    def collect(self, nodes: Sequence[int]) -> tuple[dict[int, tuple[Packet, ...]], Ints, Ints]:
        """Empty the inboxes of `nodes`: return what was in them, and of every packet its link (k,) and tick of sending."""
        handed: dict[int, tuple[Packet, ...]] = {}
        taken: list[Parcel] = []
        for node in nodes:
            parcels = self._inboxes.pop(node, None)
            if parcels is not None:
                handed[node] = tuple(chain.from_iterable([parcel.packets.tolist() for parcel in parcels]))
                taken += parcels
        if not taken:
            return handed, _NOTHING, _NOTHING
        return handed, np.concatenate([each.link for each in taken]), np.concatenate([each.sent_tick for each in taken])

    def remove_to(self, receiver: int) -> Ints:
        """Empty an inbox; return the links (k,) of what was in it."""
        parcels = self._inboxes.pop(receiver, ())
        return np.concatenate([_NOTHING, *(parcel.link for parcel in parcels)])

    def remove_due(self, tick: int, deaf: Bools) -> tuple[Ints, Ints]:
        """Take out what is due at `tick` for receivers in `deaf` (nodes,); return the receivers (k,) and links (k,)."""
        parcels = self._due.get(tick)
        if parcels is None:
            return _NOTHING, _NOTHING
        removed = []
        for index, parcel in enumerate(parcels):
            lost = deaf[parcel.receiver]
            if lost.any():
                removed.append(parcel.take(lost))
                parcels[index] = parcel.take(~lost)
        return (
            np.concatenate([_NOTHING, *(each.receiver for each in removed)]),
            np.concatenate([_NOTHING, *(each.link for each in removed)]),
        )

    def remove_from(self, sender: int) -> Ints:
        """Take out everything that `sender` sent and that has not been handed over; return its links (k,)."""
        removed = [_NOTHING]
        for boxes in (self._due, self._inboxes):
            for key in list(boxes):
                kept = []
                for parcel in boxes[key]:
                    stale = parcel.sender == sender
                    removed.append(parcel.link[stale])
                    if not stale.all():
                        kept.append(parcel.take(~stale) if stale.any() else parcel)
                if kept:
                    boxes[key] = kept
                else:
                    del boxes[key]
        return np.concatenate(removed)

    def in_flight(self, links: int) -> Ints:
        """Count, by link (links,), the packets that have been sent and not handed over."""
        counts = np.zeros(links, dtype=np.int64)
        for boxes in (self._due, self._inboxes):
            for parcels in boxes.values():
                for parcel in parcels:
                    np.add.at(counts, parcel.link, 1)
        return counts


def joined(parcels: Sequence[Parcel]) -> Parcel:
    """Return the packets of all `parcels`, in their order."""
    return Parcel(
        np.concatenate([each.sender for each in parcels]),
        np.concatenate([each.receiver for each in parcels]),
        np.concatenate([each.link for each in parcels]),
        np.concatenate([each.sent_tick for each in parcels]),
        np.concatenate([each.arrival_s for each in parcels]),
        np.concatenate([each.packets for each in parcels]),
    )


_NOTHING: Ints = np.zeros(0, dtype=np.int64)
