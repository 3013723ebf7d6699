"""A channel of the radio: the permitted pairs of sender and receiver, and the models that judge each packet, in order.

The channel drops packets to absent and switched-off receivers first. The leading models find receivers out of reach.
Faults judge next, and then all other models. So a packet that a fault drops would have reached its receiver. These
leading models use no random numbers, so the order of faults and models changes the causes and not the packets that
pass.

Models see a broadcast as packets to the receivers in reach (`reach`): those that are available, within the shortest reach
that a model states. The packets to all others count for `absent`, `receiver-down` or the cause of that model.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from zwerm.maths.keyed_random import key_part
from zwerm.wire.messages import Packet, Transmission
from zwerm.world.radio import PacketJudge, Packets, Transmissions, Verdict
from zwerm.world.radio.availability import Absent, SwitchedOff
from zwerm.world.radio.ledger import Ledger
from zwerm.world.radio.links import Links
from zwerm.world.radio.packet_queue import PacketBatch, PacketQueue
from zwerm.world.radio.reach import Reach
from zwerm.world.scene import Ints, Scene

Outboxes = Sequence[tuple[int, Sequence[Transmission]]]

# Key of a packet: its tick, its number among those of its sender at that tick, and the number of the copy.
_TICK_BITS: Final = np.uint64(32)
_COPY_BITS: Final = np.uint64(16)

# Addressee of a broadcast.
_EVERYONE: Final = -1


class Channel:
    """A named channel among `members`, ids below `nodes`. With a `center`, each other node exchanges packets with it only."""

    def __init__(
        self,
        name: str,
        members: range,
        center: int | None,
        nodes: int,
        dt_s: float,
        models: Sequence[PacketJudge] = (),
        anonymous: bool = False,
        links: Links | None = None,
    ) -> None:
        self.name = name
        self.models = list(models)
        self.links = links or Links(nodes)
        self.ledger = Ledger(self.links, nodes, dt_s, members)
        self.queue = PacketQueue(nodes)
        self._members = members
        self._center = center
        self.dt_s = dt_s
        self._anonymous = anonymous
        self._audiences: dict[int, Ints] = {}
        self._reach = Reach(members)
        # The number of leading models that find receivers out of reach.
        self._leading = next((at for at, model in enumerate(self.models) if not model.out_of_reach), len(self.models))
        # The model that bounds broadcasts. Faults judge before it, unless it is a leading one.
        self._bound = _shortest(self.models)
        self._bound_leads = self._bound in self.models[: self._leading]

    def carries(self, sender: int, to: int) -> bool:
        """Return whether `sender` may address `to`."""
        if to == sender or to not in self._members:
            return False
        return self._center is None or self._center in (sender, to)

    def pairs(self) -> list[tuple[int, int]]:
        """Return every (sender, receiver) of broadcasts, sorted."""
        audiences = [
            (node, self._audience(node)) for node in self._members
        ]  # all of them first: `_audience` adds links
        return [(node, other) for node, links in audiences for other in self.links.receiver[links].tolist()]

    def stopped(self, scene: Scene, models: Sequence[PacketJudge]) -> list[tuple[int, int]]:
        """Return the pairs whose packets one of `models`, which use no random numbers, drops now; sorted."""
        nodes = np.array(self._members)
        links = [self._audience(node) for node in nodes.tolist()]
        transmission = np.repeat(np.arange(len(nodes)), [len(each) for each in links])
        traffic = Transmissions(scene, self.dt_s, nodes, np.zeros(len(nodes), dtype=np.int64), [b""] * len(nodes))
        key = np.zeros(len(transmission), dtype=np.uint64)
        packets = Packets(self.links, np.concatenate(links), transmission, transmission, key)
        stopped = np.zeros(len(packets), dtype=np.bool_)
        for model in models:
            drop = model.judge(traffic, packets).drop
            if drop is not None:
                stopped |= drop
        return sorted(zip(packets.sender[stopped].tolist(), packets.receiver[stopped].tolist(), strict=True))

    def send(
        self,
        scene: Scene,
        outboxes: Outboxes,
        absent: Absent,
        off: SwitchedOff,
        faults: Sequence[PacketJudge] = (),
    ) -> None:
        """Judge every packet that the nodes sent on this channel at this tick; (node, outbox) are in id order."""
        name, center = self.name, self._center
        senders: list[int] = []
        ranks: list[int] = []
        payloads: list[bytes] = []
        addressees: list[int] = []
        sent: dict[int, int] = {}  # a node that answered late appears twice
        for node, outbox in outboxes:
            rank = sent.get(node, 0)
            everyone = _EVERYONE if center is None or node == center else center
            for message in outbox:
                if message.channel == name:
                    senders.append(node)
                    ranks.append(rank)
                    payloads.append(message.payload)
                    addressees.append(everyone if message.to is None else message.to)
                    rank += 1
            sent[node] = rank
        if not senders:
            return
        traffic = Transmissions(scene, self.dt_s, np.array(senders), np.array(ranks), payloads)
        self.ledger.transmit(traffic.sender, traffic.sizes())
        bound = None if faults and not self._bound_leads else self._bound
        to = np.array(addressees)
        link, transmission = self._links_of(traffic, to, absent, off, bound)
        key = key_part(_stamp(traffic))[transmission]
        packets = Packets(self.links, link, transmission, transmission, key)
        # Broadcasts find available receivers only.
        availability: list[PacketJudge] = [] if (to == _EVERYONE).all() else [absent, off]
        for model in (*availability, *self.models[: self._leading], *faults, *self.models[self._leading :]):
            if not len(packets):
                return
            packets = self._apply(model.judge(traffic, packets), model, traffic, packets)
        self._enqueue(traffic, packets)

    def _links_of(
        self, traffic: Transmissions, to: Ints, absent: Absent, off: SwitchedOff, bound: PacketJudge | None
    ) -> tuple[Ints, Ints]:
        """Count all packets as sent. Return the links (k,) of those that models judge, and the transmissions (k,), ascending.

        Broadcasts have the addressee `_EVERYONE` in `to` (t,).
        """
        sender, scene, ledger = traffic.sender, traffic.scene, self.ledger
        broadcast = to == _EVERYONE
        which, alone = np.flatnonzero(broadcast), np.flatnonzero(~broadcast)
        link, transmission = alone, alone
        if len(alone):
            link = self.links.rows(sender[alone], to[alone])
            ledger.send(link, addressed=True)
        if not len(which):
            return link, transmission
        found = self._reach.find(scene, off.off, sender[which], _reach_m(bound))
        ledger.broadcasts.add(sender[which], scene.present, off.off)
        for reason, judge in (("absent", absent), ("off", off), ("beyond", bound)):
            if judge is not None:
                ledger.drop_unshown(reason, int(getattr(found, reason).sum()), judge.cause, judge.out_of_reach)
        reached = np.repeat(which, found.counts)
        near = self.links.rows(sender[reached], found.ids)
        ledger.send(near)
        if not len(alone):
            return near, reached
        transmission = np.concatenate([reached, transmission])
        order = np.argsort(transmission, kind="stable")
        return np.concatenate([near, link])[order], transmission[order]

    def _apply(self, verdict: Verdict, model: PacketJudge, traffic: Transmissions, packets: Packets) -> Packets:
        """Return the packets that remain after a verdict of `model`."""
        drop, after_s, copies, payload, attenuation_db = verdict
        if payload is not None:
            packets.payload = payload
        if after_s is not None:
            packets.delay_s = after_s if packets.delay_s is None else packets.delay_s + after_s
        if attenuation_db is not None:
            before_db = packets.attenuation_db
            packets.attenuation_db = attenuation_db if before_db is None else before_db + attenuation_db
        if copies is not None and copies.any():
            packets = self._copied(traffic, packets, copies)
        if drop is not None and drop.any():
            self.ledger.drop(packets.link[drop], model.cause, model.out_of_reach)
            packets = packets.take(np.flatnonzero(~drop))
        return packets

    def _copied(self, traffic: Transmissions, packets: Packets, copies: Ints) -> Packets:
        """Return `packets`, each followed by its `copies` (k,). A copy has a key of its own."""
        original = np.repeat(np.arange(len(packets)), copies + 1)
        number = np.arange(len(original)) - np.repeat(np.cumsum(copies + 1) - copies - 1, copies + 1)
        made = packets.take(original)
        # Copies of copies continue after the largest number.
        made.copy = number if made.copy is None else made.copy * (int(copies.max()) + 1) + number
        fresh = number > 0
        stamp = _stamp(traffic)[made.transmission] | made.copy.astype(np.uint64)
        made.key = np.where(fresh, key_part(stamp), made.key)
        self.ledger.send(made.link[fresh], addressed=True)
        self.ledger.copies += int(np.count_nonzero(fresh))
        return made

    def _enqueue(self, traffic: Transmissions, packets: Packets) -> None:
        """Add the remaining packets to the queue."""
        if not len(packets):
            return
        payloads = traffic.payloads
        objects: NDArray[np.object_] = np.empty(len(payloads), dtype=np.object_)
        name, anonymous = self.name, self._anonymous
        whose = traffic.sender.tolist()
        whole = len(whose)
        objects[:whole] = [
            Packet(name, payload, None if anonymous else sender)
            for payload, sender in zip(payloads[:whole], whose, strict=True)
        ]
        sender = packets.sender
        if len(payloads) > whole:
            damaged = np.flatnonzero(packets.payload >= whole)
            for row in damaged.tolist():
                which = int(packets.payload[row])
                objects[which] = Packet(name, payloads[which], None if anonymous else int(sender[row]))
            self.ledger.damaged += len(damaged)
        delay_s = packets.delay_s
        tick, now_s = traffic.tick, traffic.scene.time_s
        due: Ints | int = tick + 1
        arrival_s = np.full(len(packets), now_s)
        if delay_s is not None:
            arrival_s = now_s + delay_s
            due = tick + np.maximum(1, np.ceil(delay_s / self.dt_s - 1e-9)).astype(np.int64)
        batch = PacketBatch(
            sender,
            packets.receiver,
            packets.link,
            np.full(len(packets), tick),
            arrival_s,
            objects[packets.payload],
        )
        self.queue.push(batch, due)

    def _audience(self, sender: int) -> Ints:
        """Return the links of a broadcast of `sender`: to all others, or to the center if there is one."""
        links = self._audiences.get(sender)
        if links is None:
            if self._center is not None and sender != self._center:
                receivers = np.array([self._center])
            else:
                receivers = np.array([node for node in self._members if node != sender], dtype=np.int64)
            links = self._audiences[sender] = self.links.rows(np.full(len(receivers), sender), receivers)
        return links


def _shortest(models: Sequence[PacketJudge]) -> PacketJudge | None:
    """Return the model with the shortest reach among those that may judge before all others, or None without a bound.

    These are the models that no model with a memory precedes. A model that finds receivers out of reach must not judge
    before one that loses packets: the losses are those of the earlier model.
    """
    found: PacketJudge | None = None
    leading = True
    for model in models:
        leading = leading and model.out_of_reach
        if _reach_m(model) < _reach_m(found) and (leading or not model.out_of_reach):
            found = model
        if not getattr(model, "memoryless", False):
            break
    return found


def _reach_m(model: PacketJudge | None) -> float:
    """Return the distance beyond which a model receives no broadcast [m]; infinite for one that states none."""
    return float(getattr(model, "reach_m", math.inf))


def _stamp(traffic: Transmissions) -> NDArray[np.uint64]:
    """Return the part of the key of each transmission (t,): its tick, and its number among those of its sender."""
    return np.uint64(traffic.tick) << _TICK_BITS | traffic.rank.astype(np.uint64) << _COPY_BITS
