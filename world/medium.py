"""The radio medium: every packet between nodes passes here, and every packet is accounted for.

A broadcast is one packet a potential receiver. Models judge the packets of a tick together; the first that drops a packet
names the cause. What is not dropped is delivered with the receiver's next observation, one tick after it was sent at the
earliest. At every tick, for every link: sent = delivered + dropped, by cause + in flight.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np

from zwerm.protocol import Packet, Transmission
from zwerm.scenario import RadioTable
from zwerm.world.scene import Bools, Ints, Scene

# From robot to robot, and between any robot and the coordinator.
ROBOTS: Final = "robots"
UPLINK: Final = "uplink"


class LinkModel(Protocol):
    """One reason why a packet may not arrive."""

    cause: str

    def drops(self, scene: Scene, sender: Ints, receiver: Ints) -> Bools:
        """Tell for each packet, (k,) senders to (k,) receivers, whether this model drops it."""


class DiscRange:
    """Drops what is sent further than `range_m` [m]: the unit disc model."""

    cause = "out-of-range"

    def __init__(self, range_m: float) -> None:
        self._range_m = range_m

    def drops(self, scene: Scene, sender: Ints, receiver: Ints) -> Bools:
        """Compare distances between the two positions at the time of sending."""
        offset = scene.position[sender] - scene.position[receiver]
        return np.asarray(np.hypot(offset[:, 0], offset[:, 1]) > self._range_m)


class LineOfSight:
    """Drops what a wall stands in the way of."""

    cause = "no-line-of-sight"

    def drops(self, scene: Scene, sender: Ints, receiver: Ints) -> Bools:
        """Test the segment between the two positions at the time of sending against every wall."""
        return scene.arena.blocked(scene.position[sender], scene.position[receiver])


class Absent:
    """Drops what is sent to a robot that is not in the arena; nodes without a body are always there."""

    cause = "absent"

    def drops(self, scene: Scene, sender: Ints, receiver: Ints) -> Bools:
        """Look the receivers up."""
        robots = len(scene.present)
        return (receiver < robots) & ~scene.present[np.minimum(receiver, robots - 1)]


class Accounts:
    """What became of every packet, in all and for every link (sender, receiver)."""

    def __init__(self) -> None:
        self.sent = 0
        self.delivered = 0
        self.bytes = 0
        self.dropped: Counter[str] = Counter()
        self.links_sent: Counter[tuple[int, int]] = Counter()
        self.links_delivered: Counter[tuple[int, int]] = Counter()
        self.links_dropped: dict[tuple[int, int], Counter[str]] = defaultdict(Counter)

    @property
    def in_flight(self) -> int:
        """Packets sent that have neither been delivered nor dropped yet."""
        return self.sent - self.delivered - self.dropped.total()


class Channel:
    """A named channel: its members, and the models that judge its packets, in order."""

    def __init__(self, members: range, center: int | None, models: list[LinkModel], anonymous: bool = False) -> None:
        self.models = models
        self.anonymous = anonymous
        self._members = members
        self._center = center

    def hearers(self, sender: int) -> Sequence[int]:
        """Return the nodes that a broadcast of `sender` is for: everyone, or through the center where there is one."""
        if self._center is not None and sender != self._center:
            return (self._center,)
        return [node for node in self._members if node != sender]

    def carries(self, sender: int, to: int) -> bool:
        """Tell whether `sender` may address `to` at all."""
        if to == sender or to not in self._members:
            return False
        return self._center is None or self._center in (sender, to)


class Medium:
    """The medium of one run: `robots` robots, with ids from 0, and a coordinator, if any, whose id is `robots`."""

    def __init__(self, table: RadioTable | None, robots: int, coordinator: bool) -> None:
        self.accounts = Accounts()
        self.channels: dict[str, Channel] = {}
        self._inboxes: dict[int, list[tuple[int, Packet]]] = {}
        if table is not None:
            models: list[LinkModel] = [Absent()]
            if table.range_m is not None:
                models.append(DiscRange(table.range_m))
            if table.line_of_sight:
                models.append(LineOfSight())
            self.channels[ROBOTS] = Channel(range(robots), None, models, table.anonymous)
        if coordinator:
            self.channels[UPLINK] = Channel(range(robots + 1), robots, [Absent()])

    def waiting(self) -> Sequence[int]:
        """Return the robots that have packets to receive, in id order."""
        return sorted(self._inboxes)

    def deliver(self, robot: int) -> tuple[Packet, ...]:
        """Hand over the packets that wait for `robot`."""
        packets = self._inboxes.pop(robot, None)
        if packets is None:
            return ()
        self.accounts.delivered += len(packets)
        for sender, _ in packets:
            self.accounts.links_delivered[sender, robot] += 1
        return tuple(packet for _, packet in packets)

    def lose(self, robot: int, cause: str) -> None:
        """Drop what waits for a robot that can no longer receive."""
        for sender, _ in self._inboxes.pop(robot, ()):
            self._drop(sender, robot, cause)

    def send(self, scene: Scene, outboxes: Sequence[tuple[int, Sequence[Transmission]]]) -> None:
        """Take what the nodes sent at this tick, (node, its outbox) in id order, and judge every packet."""
        for name, channel in self.channels.items():
            sender, receiver, messages = self._expand(name, channel, outboxes)
            if messages:
                self._judge(channel, scene, sender, receiver, messages)

    def _judge(
        self, channel: Channel, scene: Scene, sender: Ints, receiver: Ints, messages: list[Transmission]
    ) -> None:
        verdict = np.full(len(messages), -1)
        for number, model in enumerate(channel.models):
            left = np.flatnonzero(verdict < 0)
            verdict[left[model.drops(scene, sender[left], receiver[left])]] = number
        accounts = self.accounts
        accounts.sent += len(messages)
        for a, b, message, number in zip(sender.tolist(), receiver.tolist(), messages, verdict.tolist(), strict=True):
            accounts.links_sent[a, b] += 1
            accounts.bytes += len(message.payload)
            if number >= 0:
                self._drop(a, b, channel.models[number].cause)
                continue
            packet = Packet(message.channel, message.payload, None if channel.anonymous else a)
            self._inboxes.setdefault(b, []).append((a, packet))

    def _drop(self, sender: int, receiver: int, cause: str) -> None:
        self.accounts.dropped[cause] += 1
        self.accounts.links_dropped[sender, receiver][cause] += 1

    def _expand(
        self, name: str, channel: Channel, outboxes: Sequence[tuple[int, Sequence[Transmission]]]
    ) -> tuple[Ints, Ints, list[Transmission]]:
        """Return one (sender, receiver, transmission) for every receiver that a packet is meant for."""
        senders: list[int] = []
        receivers: list[int] = []
        messages: list[Transmission] = []
        for node, outbox in outboxes:
            for message in outbox:
                if message.channel == name:
                    to = channel.hearers(node) if message.to is None else (message.to,)
                    senders += [node] * len(to)
                    receivers += to
                    messages += [message] * len(to)
        return np.array(senders, dtype=np.int64), np.array(receivers, dtype=np.int64), messages

    def refuses(self, sender: int, message: Transmission) -> str:
        """Return why this transmission cannot be sent at all, or an empty string."""
        channel = self.channels.get(message.channel)
        if channel is None:
            return f"no channel {message.channel!r} here"
        if message.to is not None and not channel.carries(sender, message.to):
            return f"channel {message.channel!r} does not lead from node {sender} to {message.to}"
        return ""
