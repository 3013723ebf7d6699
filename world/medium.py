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

ROBOTS: Final = "robots"
CHANNELS: Final = (ROBOTS,)


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
    """Drops what is sent to or from a robot that is not in the arena."""

    cause = "absent"

    def drops(self, scene: Scene, sender: Ints, receiver: Ints) -> Bools:
        """Look both ends up."""
        return ~(scene.present[sender] & scene.present[receiver])


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


class Medium:
    """The medium of one run of `count` robots."""

    def __init__(self, table: RadioTable | None, count: int) -> None:
        self.accounts = Accounts()
        self.open = table is not None
        self._count = count
        self._anonymous = table is not None and table.anonymous
        self._models: list[LinkModel] = [Absent()]
        if table is not None and table.range_m is not None:
            self._models.append(DiscRange(table.range_m))
        if table is not None and table.line_of_sight:
            self._models.append(LineOfSight())
        self._inboxes: dict[int, list[tuple[int, Packet]]] = {}

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
        """Take what the robots sent at this tick, (robot, its outbox) in id order, and judge every packet."""
        sender, receiver, messages = self._expand(outboxes)
        if not len(sender):
            return
        cause = np.full(len(sender), -1)
        for number, model in enumerate(self._models):
            left = np.flatnonzero(cause < 0)
            cause[left[model.drops(scene, sender[left], receiver[left])]] = number
        self.accounts.sent += len(sender)
        for a, b, message, verdict in zip(sender.tolist(), receiver.tolist(), messages, cause.tolist(), strict=True):
            self.accounts.links_sent[a, b] += 1
            if verdict >= 0:
                self._drop(a, b, self._models[verdict].cause)
                continue
            packet = Packet(message.channel, message.payload, None if self._anonymous else a)
            self._inboxes.setdefault(b, []).append((a, packet))

    def _drop(self, sender: int, receiver: int, cause: str) -> None:
        self.accounts.dropped[cause] += 1
        self.accounts.links_dropped[sender, receiver][cause] += 1

    def _expand(self, outboxes: Sequence[tuple[int, Sequence[Transmission]]]) -> tuple[Ints, Ints, list[Transmission]]:
        """Return one (sender, receiver, transmission) for every potential receiver."""
        senders: list[int] = []
        receivers: list[int] = []
        messages: list[Transmission] = []
        for robot, outbox in outboxes:
            for message in outbox:
                self.accounts.bytes += len(message.payload)
                to = [each for each in range(self._count) if each != robot] if message.to is None else [message.to]
                senders += [robot] * len(to)
                receivers += to
                messages += [message] * len(to)
        return np.array(senders, dtype=np.int64), np.array(receivers, dtype=np.int64), messages

    def refuses(self, message: Transmission) -> str:
        """Return why this transmission cannot be sent at all, or an empty string."""
        if not self.open:
            return "this scenario has no radio"
        if message.channel not in CHANNELS:
            return f"no channel {message.channel!r}"
        if message.to is not None and not 0 <= message.to < self._count:
            return f"no node {message.to}"
        return ""
