"""Clocks of robots: each has an offset and a rate of its own, drawn from the seed.

A robot's clock reads (1 + drift) * t + offset at virtual time t. `Observation.time_s` is that reading, and `Wake.at_s` is
understood by it. A coordinator's clock is exact. A restarted robot has the clock that it had.
"""

from collections.abc import Sequence
from typing import Final

import msgspec

from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import ClockTable
from zwerm.wire.messages import Wake
from zwerm.world.scene import Floats

_PPM: Final = 1e-6


class Clocks:
    """The clocks of `robots` robots, and of the nodes after them, which are exact."""

    def __init__(self, table: ClockTable, robots: int, nodes: int, draws: Draws) -> None:
        offset, drift = (2.0 * draws.uniform(f"clock-{what}", range(nodes)) - 1.0 for what in ("offset", "drift"))
        offset[robots:], drift[robots:] = 0.0, 0.0
        self.offset_s: Floats = table.offset_s_max * offset  # (nodes,) [s]
        self.drift: Floats = table.drift_ppm_max * _PPM * drift  # (nodes,)

    def local_s(self, time_s: float, nodes: Sequence[int]) -> list[float]:
        """Return the reading of each node's clock at a virtual time [s]."""
        chosen = list(nodes)
        local: list[float] = ((1.0 + self.drift[chosen]) * time_s + self.offset_s[chosen]).tolist()
        return local

    def true_wake(self, node: int, wake: Wake) -> Wake:
        """Return a wake of a node, whose time is by the node's clock, with the virtual time [s]."""
        if wake.at_s is None:
            return wake
        true_s = (wake.at_s - float(self.offset_s[node])) / (1.0 + float(self.drift[node]))
        return msgspec.structs.replace(wake, at_s=true_s)
