"""A channel of the radio: who may send to whom, and the models that judge each packet, in order.

What a node hears of a packet's sender is the channel's to say. A receiver that is absent or switched off is judged before the
models. Faults judge before the models, too, but after those leading ones that find receivers out of reach: what a fault drops
would have reached its receiver. Neither of the two draws, so their order changes the causes, and not the packets that pass.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zwerm.maths.keyed_random import key_part
from zwerm.wire.messages import Packet, Transmission
from zwerm.world.radio import Air, LinkModel, Packets, Verdict
from zwerm.world.radio.accounts import Ledger
from zwerm.world.radio.links import Links
from zwerm.world.radio.mail import Mail, Parcel
from zwerm.world.scene import Ints, Scene

Outboxes = Sequence[tuple[int, Sequence[Transmission]]]

# A packet's key: its tick, which of its sender's at that tick it is, and which copy of it.
_TICK_BITS: Final = np.uint64(32)
_COPY_BITS: Final = np.uint64(16)


class Channel:
    """A named channel among `members`, ids below `nodes`; with a `center`, everyone else speaks with that node only."""

    def __init__(
        self,
        name: str,
        members: range,
        center: int | None,
        nodes: int,
        dt_s: float,
        models: Sequence[LinkModel] = (),
        anonymous: bool = False,
        links: Links | None = None,
    ) -> None:
        self.name = name
        self.models = list(models)
        self.links = links or Links(nodes)
        self.accounts = Ledger(self.links, nodes, dt_s)
        self.mail = Mail(nodes)
        self._members = members
        self._center = center
        self.dt_s = dt_s
        self._anonymous = anonymous
        self._audiences: dict[int, Ints] = {}
        # How many models, from the first on, find receivers out of reach.
        self._leading = next((at for at, model in enumerate(self.models) if not _is_of_reach(model)), len(self.models))

    def carries(self, sender: int, to: int) -> bool:
        """Tell whether `sender` may address `to` at all."""
        if to == sender or to not in self._members:
            return False
        return self._center is None or self._center in (sender, to)

    def pairs(self) -> list[tuple[int, int]]:
        """Return every (sender, receiver) between whom a broadcast passes, sorted."""
        audiences = [
            (node, self._audience(node)) for node in self._members
        ]  # all of them, before receivers are looked up
        return [(node, other) for node, links in audiences for other in self.links.receiver[links].tolist()]

    def stopped(self, scene: Scene, models: Sequence[LinkModel]) -> list[tuple[int, int]]:
        """Return the pairs between whom one of `models` would now let nothing pass, sorted; for models without chance."""
        nodes = np.array(self._members)
        links = [self._audience(node) for node in nodes.tolist()]
        transmission = np.repeat(np.arange(len(nodes)), [len(each) for each in links])
        air = Air(scene, self.dt_s, nodes, np.zeros(len(nodes), dtype=np.int64), [b""] * len(nodes))
        key = np.zeros(len(transmission), dtype=np.uint64)
        packets = Packets(self.links, np.concatenate(links), transmission, transmission, key)
        stopped = np.zeros(len(packets), dtype=np.bool_)
        for model in models:
            drop = model.judge(air, packets).drop
            if drop is not None:
                stopped |= drop
        return sorted(zip(packets.sender[stopped].tolist(), packets.receiver[stopped].tolist(), strict=True))

    def send(
        self, scene: Scene, outboxes: Outboxes, before: Sequence[LinkModel] = (), faults: Sequence[LinkModel] = ()
    ) -> None:
        """Take what the nodes sent on this channel at this tick, (node, its outbox) in id order, and judge every packet."""
        name, books = self.name, self.accounts
        senders: list[int] = []
        ranks: list[int] = []
        payloads: list[bytes] = []
        links: list[Ints] = []
        sent: dict[int, int] = {}  # a node that answered late is here twice
        for node, outbox in outboxes:
            rank = sent.get(node, 0)
            for message in outbox:
                if message.channel == name:
                    senders.append(node)
                    ranks.append(rank)
                    payloads.append(message.payload)
                    links.append(self._audience(node) if message.to is None else self._link(node, message.to))
                    books.node_bytes[node] += len(message.payload)
                    rank += 1
            books.node_messages[node] += rank - sent.get(node, 0)
            sent[node] = rank
        if not senders:
            return
        audience = list(map(len, links))
        air = Air(scene, self.dt_s, np.array(senders), np.array(ranks), payloads)
        link = np.concatenate(links)
        transmission = np.repeat(np.arange(len(senders)), audience)
        key = key_part(_stamp(air))[transmission]
        books.send(link)
        packets = Packets(self.links, link, transmission, transmission, key)
        for model in (*before, *self.models[: self._leading], *faults, *self.models[self._leading :]):
            if not len(packets):
                return
            packets = self._carry_out(model.judge(air, packets), model, air, packets)
        self._post(air, packets)

    def _carry_out(self, verdict: Verdict, model: LinkModel, air: Air, packets: Packets) -> Packets:
        """Return what is left of `packets` after a verdict of `model`."""
        drop, after_s, copies, payload, attenuation_db = verdict
        if payload is not None:
            packets.payload = payload
        if after_s is not None:
            packets.delay_s = after_s if packets.delay_s is None else packets.delay_s + after_s
        if attenuation_db is not None:
            before_db = packets.attenuation_db
            packets.attenuation_db = attenuation_db if before_db is None else before_db + attenuation_db
        if copies is not None and copies.any():
            packets = self._copied(air, packets, copies)
        if drop is not None and drop.any():
            self.accounts.drop(packets.link[drop], model.cause, _is_of_reach(model))
            packets = packets.take(np.flatnonzero(~drop))
        return packets

    def _copied(self, air: Air, packets: Packets, copies: Ints) -> Packets:
        """Return `packets` with `copies` (k,) of each right after it; a copy has a key of its own."""
        original = np.repeat(np.arange(len(packets)), copies + 1)
        number = np.arange(len(original)) - np.repeat(np.cumsum(copies + 1) - copies - 1, copies + 1)
        made = packets.take(original)
        # Copies of copies count on from the largest number that there is.
        made.copy = number if made.copy is None else made.copy * (int(copies.max()) + 1) + number
        fresh = number > 0
        stamp = _stamp(air)[made.transmission] | made.copy.astype(np.uint64)
        made.key = np.where(fresh, key_part(stamp), made.key)
        self.accounts.send(made.link[fresh])
        self.accounts.copies += int(np.count_nonzero(fresh))
        return made

    def _post(self, air: Air, packets: Packets) -> None:
        """Send on their way what nothing has dropped."""
        if not len(packets):
            return
        sent = air.payloads
        objects: NDArray[np.object_] = np.empty(len(sent), dtype=np.object_)
        name, anonymous = self.name, self._anonymous
        whose = air.sender.tolist()
        whole = len(whose)
        objects[:whole] = [
            Packet(name, payload, None if anonymous else sender)
            for payload, sender in zip(sent[:whole], whose, strict=True)
        ]
        sender = packets.sender
        if len(sent) > whole:
            damaged = np.flatnonzero(packets.payload >= whole)
            for row in damaged.tolist():
                which = int(packets.payload[row])
                objects[which] = Packet(name, sent[which], None if anonymous else int(sender[row]))
            self.accounts.damaged += len(damaged)
        delay_s = packets.delay_s
        tick, now_s = air.tick, air.scene.time_s
        due: Ints | int = tick + 1
        arrival_s = np.full(len(packets), now_s)
        if delay_s is not None:
            arrival_s = now_s + delay_s
            due = tick + np.maximum(1, np.ceil(delay_s / self.dt_s - 1e-9)).astype(np.int64)
        parcel = Parcel(
            sender,
            packets.receiver,
            packets.link,
            np.full(len(packets), tick),
            arrival_s,
            objects[packets.payload],
        )
        self.mail.post(parcel, due)

    def _audience(self, sender: int) -> Ints:
        """Return the links of a broadcast of `sender`: to everyone, or to the center where there is one."""
        links = self._audiences.get(sender)
        if links is None:
            if self._center is not None and sender != self._center:
                receivers = np.array([self._center])
            else:
                receivers = np.array([node for node in self._members if node != sender], dtype=np.int64)
            links = self._audiences[sender] = self.links.rows(np.full(len(receivers), sender), receivers)
        return links

    def _link(self, sender: int, to: int) -> Ints:
        return self.links.rows(np.array([sender]), np.array([to]))


def _is_of_reach(model: LinkModel) -> bool:
    """Tell whether a model drops packets whose receivers are out of reach."""
    return bool(getattr(model, "out_of_reach", False))


def _stamp(air: Air) -> NDArray[np.uint64]:
    """Return what keys each transmission (t,) of a sender: when it was sent, and which of that tick's it is."""
    return np.uint64(air.tick) << _TICK_BITS | air.rank.astype(np.uint64) << _COPY_BITS
