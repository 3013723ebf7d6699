"""Availability: packets to robots that are not in the arena, and to nodes whose programs do not run, are dropped."""

from typing import ClassVar

import numpy as np

from zwerm.world.radio import Packets, Transmissions, Verdict
from zwerm.world.scene import Bools


class Absent:
    """Drops packets to robots that are not in the arena. Nodes without a body are always present."""

    cause: ClassVar[str] = "absent"
    out_of_reach: ClassVar[bool] = True

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Check the presence of the receivers."""
        present = sent.scene.present
        if present.all():
            return Verdict()
        receiver = packets.receiver
        return Verdict((receiver < len(present)) & ~present[np.minimum(receiver, len(present) - 1)])


class SwitchedOff:
    """Drops packets to nodes whose programs do not run: crashed, or not started yet.

    `off` (nodes,) is replaced at every switch, and never changed in place.
    """

    cause: ClassVar[str] = "receiver-down"
    out_of_reach: ClassVar[bool] = True

    def __init__(self, nodes: int) -> None:
        self.off: Bools = np.zeros(nodes, dtype=np.bool_)
        self.any = False

    def switch(self, node: int, off: bool) -> None:
        """Switch a node off, or on."""
        self.off = self.off.copy()
        self.off[node] = off
        self.any = bool(self.off.any())

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Check the status of the receivers."""
        return Verdict(self.off[packets.receiver]) if self.any else Verdict()
