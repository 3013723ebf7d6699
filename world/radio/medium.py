"""The medium: the channels of a run, and everything that can happen to a packet between two nodes.

A packet is delivered with its receiver's next observation, one tick after it was sent at the earliest. Whoever is switched
off hears nothing: what is sent to it is dropped, and so is what is due to it, each with its cause. With `check`, the books
of every link are held against the air at every tick.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Packet, Transmission
from zwerm.world.arena.arena import Arena
from zwerm.world.radio import ROBOTS, UPLINK, Air, LinkModel, LinkTable, Packets, Verdict
from zwerm.world.radio.channel import Channel, Outboxes
from zwerm.world.radio.links import Links
from zwerm.world.radio.registry import make_models
from zwerm.world.scene import Bools, Scene


class Absent:
    """Drops what is sent to a robot that is not in the arena; nodes without a body are always there."""

    kind: ClassVar[str] = "absent"
    cause: ClassVar[str] = "absent"
    needs_positions: ClassVar[bool] = False
    out_of_reach: ClassVar[bool] = True
    Parameters: ClassVar[type[LinkTable]] = LinkTable

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Look the receivers up."""
        present = air.scene.present
        if present.all():
            return Verdict()
        receiver = packets.receiver
        return Verdict((receiver < len(present)) & ~present[np.minimum(receiver, len(present) - 1)])


class SwitchedOff:
    """Drops what is sent to a node whose program does not run: it crashed, or has not started yet."""

    kind: ClassVar[str] = "receiver-down"
    cause: ClassVar[str] = "receiver-down"
    needs_positions: ClassVar[bool] = False
    out_of_reach: ClassVar[bool] = True
    Parameters: ClassVar[type[LinkTable]] = LinkTable

    def __init__(self, nodes: int) -> None:
        self.deaf: Bools = np.zeros(nodes, dtype=np.bool_)

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Look the receivers up."""
        return Verdict(self.deaf[packets.receiver]) if self.deaf.any() else Verdict()


class Medium:
    """The medium of one run: robots with ids from 0, and a coordinator, if any, whose id follows theirs."""

    def __init__(self, scenario: Scenario, arena: Arena, draws: Draws) -> None:
        """Raises ScenarioError with every mistake in the tables of the radio's models."""
        robots, dt_s = scenario.robots.count, scenario.time.dt_s
        coordinator = scenario.coordinator is not None
        nodes = robots + coordinator
        self.channels: dict[str, Channel] = {}
        self.faults: dict[str, list[LinkModel]] = {ROBOTS: [], UPLINK: []}  # those in force now, by channel
        self._off = SwitchedOff(nodes)
        self._causes: dict[int, str] = {}
        self._before: list[LinkModel] = [Absent(), self._off]
        tables = {ROBOTS: scenario.radio, UPLINK: scenario.uplink}
        self._check = any(table.check for table in tables.values() if table is not None)
        members: dict[str, tuple[range, int | None]] = (
            {ROBOTS: (range(robots), None)} if scenario.radio is not None else {}
        )
        if coordinator:
            members[UPLINK] = (range(nodes), robots)
        made = make_models(scenario, tuple(members), {name: Links(nodes) for name in members}, arena, draws)
        for name, (ids, center) in members.items():
            table = tables[name]
            models, links = made[name]
            self.channels[name] = Channel(
                name, ids, center, nodes, dt_s, models, table is not None and table.anonymous, links
            )

    def arrive(self, tick: int) -> Sequence[int]:
        """Put what is due at `tick` into the inboxes, and return the nodes that have packets waiting, in id order."""
        deaf = self._off.deaf
        for channel in self.channels.values():
            if deaf.any():
                for receiver, link in zip(*channel.mail.remove_due(tick, deaf), strict=True):
                    channel.accounts.drop(link[None], self._causes[int(receiver)])
            channel.mail.arrive(tick)
        if self._check:
            self.audit()
        waiting = [channel.mail.waiting() for channel in self.channels.values()]
        return waiting[0] if len(waiting) == 1 else sorted({node for nodes in waiting for node in nodes})

    def deliver(self, nodes: Sequence[int], tick: int) -> list[tuple[Packet, ...]]:
        """Hand over the packets that wait for `nodes`, at `tick`."""
        inboxes: dict[int, tuple[Packet, ...]] = {}
        for channel in self.channels.values():
            handed, link, sent_tick = channel.mail.collect(nodes)
            if len(link):
                channel.accounts.deliver(link, sent_tick, tick)
            for node, packets in handed.items():
                inboxes[node] = inboxes[node] + packets if node in inboxes else packets
        return [inboxes.get(node, ()) for node in nodes]

    def send(self, scene: Scene, outboxes: Outboxes) -> None:
        """Take what the nodes sent at this tick, (node, its outbox) in id order, and judge every packet."""
        for name, channel in self.channels.items():
            channel.send(scene, outboxes, self._before, self.faults[name])

    def stopped(self, name: str, scene: Scene, numbers: Sequence[int]) -> list[tuple[int, int]]:
        """Return the pairs of a channel between whom nothing passes now, by faults or by its models with these `numbers`."""
        channel = self.channels[name]
        chosen = [channel.models[number] for number in numbers]
        return channel.stopped(scene, [*self._before, *self.faults[name], *chosen])

    def switch_off(self, node: int, cause: str) -> None:
        """Let a node hear nothing more, and drop for `cause` what waits for it and what comes due."""
        self._off.deaf[node] = True
        self._causes[node] = cause
        for channel in self.channels.values():
            channel.accounts.drop(channel.mail.remove_to(node), cause)

    def switch_on(self, node: int) -> None:
        """Let a node hear again; what its former incarnation sent, and nobody has received yet, is refused."""
        self._off.deaf[node] = False
        self._causes.pop(node, None)
        for channel in self.channels.values():
            channel.accounts.drop(channel.mail.remove_from(node), "stale-incarnation")

    def refuses(self, sender: int, message: Transmission) -> str:
        """Return why this transmission cannot be sent at all, or an empty string."""
        channel = self.channels.get(message.channel)
        if channel is None:
            return f"no channel {message.channel!r} here"
        if message.to is not None and not channel.carries(sender, message.to):
            return f"channel {message.channel!r} does not lead from node {sender} to {message.to}"
        return ""

    def audit(self) -> None:
        """Raise AssertionError where the books of a link do not agree with the air: a mistake of ours, not the user's."""
        for name, channel in self.channels.items():
            wrong = channel.accounts.imbalance(channel.mail.in_flight(channel.links.count))
            if wrong:
                raise AssertionError(f"channel {name}: {wrong[0]}")

    def summary(self) -> dict[str, Any]:
        """Return the books over all channels: packets sent, delivered, dropped by cause, in flight; bytes; and copies.

        `out_of_reach` are those of the dropped whose receivers were out of reach. `bytes` are payload, once a transmission.
        """
        dropped: dict[str, int] = {}
        for channel in self.channels.values():
            for cause, column in channel.accounts.dropped().items():
                dropped[cause] = dropped.get(cause, 0) + int(column.sum())
        books = [channel.accounts for channel in self.channels.values()]
        return {
            "sent": sum(int(each.sent().sum()) for each in books),
            "delivered": sum(int(each.delivered().sum()) for each in books),
            "dropped": {cause: count for cause, count in sorted(dropped.items()) if count},
            "in_flight": sum(int(each.in_flight().sum()) for each in books),
            "out_of_reach": sum(int(each.out_of_reach().sum()) for each in books),
            "bytes": sum(int(each.node_bytes.sum()) for each in books),
            "copies": sum(each.copies for each in books),
            "damaged": sum(each.damaged for each in books),
        }
