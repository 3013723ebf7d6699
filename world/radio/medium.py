"""Medium: the channels of a run, and all effects on packets between two nodes.

A packet is delivered with the next observation of its receiver, one tick after it was sent at the earliest. A node that is
switched off receives nothing: packets that are sent to it or due to it are dropped, each with its cause. With `check`, the
ledger of every link is compared with the packets in flight at every tick.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Packet, Transmission
from zwerm.world.arena.arena import Arena
from zwerm.world.radio import ROBOTS, UPLINK, PacketJudge
from zwerm.world.radio.availability import Absent, SwitchedOff
from zwerm.world.radio.channel import Channel, Outboxes
from zwerm.world.radio.links import Links
from zwerm.world.radio.registry import make_models
from zwerm.world.scene import Scene

# The table that makes a channel.
_TABLES: Final = {ROBOTS: "radio", UPLINK: "coordinator"}


class Medium:
    """The medium of one run: robots with ids from 0, and a coordinator, if any, whose id follows theirs."""

    def __init__(self, scenario: Scenario, arena: Arena, draws: Draws) -> None:
        """Raises ScenarioError with every mistake in the tables of the radio's models."""
        robots, dt_s = scenario.robots.count, scenario.time.dt_s
        coordinator = scenario.coordinator is not None
        nodes = robots + coordinator
        self.channels: dict[str, Channel] = {}
        self.faults: dict[str, list[PacketJudge]] = {ROBOTS: [], UPLINK: []}  # the active ones, by channel
        self._off = SwitchedOff(nodes)
        self._causes: dict[int, str] = {}
        self._absent = Absent()
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
        """Move packets that are due at `tick` to the inboxes; return the nodes with packets in them, in id order."""
        off = self._off
        for channel in self.channels.values():
            if off.any:
                for receiver, link in zip(*channel.queue.remove_due(tick, off.off), strict=True):
                    channel.ledger.drop(link[None], self._causes[int(receiver)])
            channel.queue.arrive(tick)
        if self._check:
            self.audit()
        waiting = [channel.queue.waiting() for channel in self.channels.values()]
        return waiting[0] if len(waiting) == 1 else sorted({node for nodes in waiting for node in nodes})

    def deliver(self, nodes: Sequence[int], tick: int) -> list[tuple[Packet, ...]]:
        """Return the packets in the inboxes of `nodes` at `tick`, and empty these."""
        inboxes: dict[int, tuple[Packet, ...]] = {}
        for channel in self.channels.values():
            handed, link, sent_tick = channel.queue.collect(nodes)
            if len(link):
                channel.ledger.deliver(link, sent_tick, tick)
            for node, packets in handed.items():
                inboxes[node] = inboxes[node] + packets if node in inboxes else packets
        return [inboxes.get(node, ()) for node in nodes]

    def send(self, scene: Scene, outboxes: Outboxes) -> None:
        """Judge every packet that the nodes sent at this tick; (node, outbox) are in id order."""
        for name, channel in self.channels.items():
            channel.send(scene, outboxes, self._absent, self._off, self.faults[name])

    def stopped(self, name: str, scene: Scene, numbers: Sequence[int]) -> list[tuple[int, int]]:
        """Return the pairs of a channel that are blocked now, by faults or by its models with these `numbers`."""
        channel = self.channels[name]
        chosen = [channel.models[number] for number in numbers]
        return channel.stopped(scene, [self._absent, self._off, *self.faults[name], *chosen])

    def switch_off(self, node: int, cause: str) -> None:
        """Switch a node off: it receives nothing. Drop the packets in its inbox, and those that become due, for `cause`."""
        self._off.switch(node, True)
        self._causes[node] = cause
        for channel in self.channels.values():
            channel.ledger.drop(channel.queue.remove_to(node), cause)

    def switch_on(self, node: int) -> None:
        """Let a node receive again; drop the undelivered packets of its former incarnation."""
        self._off.switch(node, False)
        self._causes.pop(node, None)
        for channel in self.channels.values():
            channel.ledger.drop(channel.queue.remove_from(node), "stale-incarnation")

    def refuses(self, sender: int, message: Transmission) -> str:
        """Return the reason why this transmission cannot be sent, or an empty string."""
        channel = self.channels.get(message.channel)
        if channel is None:
            if message.channel in _TABLES:
                return f"no channel {message.channel!r}: the scenario has no [{_TABLES[message.channel]}]"
            return f"no channel {message.channel!r}; the scenario has {', '.join(self.channels) or 'none'}"
        if message.to is not None and not channel.carries(sender, message.to):
            return f"channel {message.channel!r} does not lead from node {sender} to {message.to}"
        return ""

    def audit(self) -> None:
        """Raise AssertionError if a ledger differs from the packets in flight: an internal error."""
        for name, channel in self.channels.items():
            wrong = channel.ledger.imbalance(channel.queue.in_flight(channel.links.count))
            if wrong:
                raise AssertionError(f"channel {name}: {wrong[0]}")

    def summary(self) -> dict[str, Any]:
        """Return the counts over all channels: packets sent, delivered, dropped by cause, in flight; bytes; and copies.

        `out_of_reach` are the dropped packets with receivers out of reach. `bytes` are payload, counted once a transmission.
        """
        ledgers = [channel.ledger for channel in self.channels.values()]
        dropped: Counter[str] = Counter()
        for each in ledgers:
            dropped.update(each.dropped_total())
        return {
            "sent": sum(each.sent_total() for each in ledgers),
            "delivered": sum(int(each.delivered().sum()) for each in ledgers),
            "dropped": {cause: count for cause, count in sorted(dropped.items()) if count},
            "in_flight": sum(int(each.in_flight().sum()) for each in ledgers),
            "out_of_reach": sum(each.out_of_reach_total() for each in ledgers),
            "bytes": sum(int(each.node_bytes.sum()) for each in ledgers),
            "copies": sum(each.copies for each in ledgers),
            "damaged": sum(each.damaged for each in ledgers),
        }
