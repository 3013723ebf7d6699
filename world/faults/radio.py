"""Faults of the radio: each is a link model that judges before the channel's own, while it is in force."""

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from zwerm.scenario.types import Point, Positive, Rectangle
from zwerm.world.faults import FaultTable, Nodes
from zwerm.world.radio import Air, LinkTable, Packets, Verdict
from zwerm.world.scene import Bools, Ints

Channel = Literal["robots", "uplink"]


class RadioFaultTable(FaultTable):
    """A fault of one channel, or of all."""

    channel: Channel | None = None


class PartitionTable(RadioFaultTable):
    """Nothing passes between nodes of different `groups`; the nodes that no group names are one more group."""

    groups: list[Nodes]


class JamTable(RadioFaultTable):
    """Nothing is received within `radius_m` of `center_m`, or within `rectangle_m` [xmin, ymin, xmax, ymax]."""

    center_m: Point | None = None
    radius_m: Positive | None = None
    rectangle_m: Rectangle | None = None


class BlackoutTable(RadioFaultTable):
    """Nothing passes on a channel."""


class CutTable(RadioFaultTable):
    """Nothing passes from `senders` to `receivers`; with `both` not the other way either."""

    senders: Nodes
    receivers: Nodes
    both: bool = False


class HealTable(FaultTable):
    """Ends every fault of the radio, of sensors, and of nodes that are paused or slow. The dead stay dead."""

    lasts: ClassVar[bool] = False


class _RadioFault:
    """What all faults of the radio have in common with link models."""

    kind: ClassVar[str]
    cause: ClassVar[str]
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = LinkTable


class Partition(_RadioFault):
    """Drops what crosses from one group to another; `group` (nodes,) is each node's."""

    kind = cause = "partition"

    def __init__(self, group: Ints) -> None:
        self._group = group

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Compare groups."""
        return Verdict(self._group[packets.sender] != self._group[packets.receiver])


class Jam(_RadioFault):
    """Drops what is received in a region; a coordinator is nowhere, and so never jammed."""

    kind = cause = "jam"

    def __init__(self, table: JamTable) -> None:
        self._table = table

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Look where the receivers are at the time of sending."""
        position, receiver = air.scene.position, packets.receiver
        bodies = receiver < len(position)
        x, y = position[np.where(bodies, receiver, 0)].T
        if self._table.rectangle_m is not None:
            xmin, ymin, xmax, ymax = self._table.rectangle_m
            inside = (xmin <= x) & (x <= xmax) & (ymin <= y) & (y <= ymax)
        else:
            center_x, center_y = self._table.center_m or (0.0, 0.0)
            inside = np.hypot(x - center_x, y - center_y) <= (self._table.radius_m or 0.0)
        return Verdict(inside & bodies)


class Blackout(_RadioFault):
    """Drops everything."""

    kind = cause = "blackout"

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Ask nothing."""
        return Verdict(np.ones(len(packets), dtype=np.bool_))


class Cut(_RadioFault):
    """Drops what `senders` (nodes,) send to `receivers` (nodes,)."""

    kind = cause = "cut"

    def __init__(self, senders: Bools, receivers: Bools, both: bool) -> None:
        self._senders = senders
        self._receivers = receivers
        self._both = both

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Look both ends up."""
        sender, receiver = packets.sender, packets.receiver
        hit = self._senders[sender] & self._receivers[receiver]
        if self._both:
            hit |= self._senders[receiver] & self._receivers[sender]
        return Verdict(hit)


def groups_of(named: Sequence[Sequence[int]], nodes: int) -> Ints:
    """Return (nodes,) the number of each node's group; those not named are group 0."""
    group = np.zeros(nodes, dtype=np.int64)
    for number, members in enumerate(named, 1):
        group[list(members)] = number
    return group
