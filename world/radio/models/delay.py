"""Delay with jitter: a packet arrives `delay_s` after it was sent, plus a random time with mean `jitter_s`.

A packet is delivered with the receiver's first observation at or after its arrival, so jitter beyond a tick reorders.
The jitter's distribution, of mean jitter_s:

    uniform       over [0, 2 jitter_s)
    exponential   of waiting for a memoryless server
    lognormal     with sigma 1: a heavy tail, as measured on the Internet
    pareto        with shape 2.5: a heavier one. netem offers the like, tc-netem(8)
"""

from typing import ClassVar, Literal

import numpy as np

from zwerm.scenario.types import NonNegative
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict
from zwerm.world.scene import Floats

_PARETO_SHAPE = 2.5


class DelayTable(LinkTable):
    """A fixed part and a random one [s]."""

    delay_s: NonNegative = 0.0
    jitter_s: NonNegative = 0.0
    distribution: Literal["uniform", "exponential", "lognormal", "pareto"] = "uniform"


class Delay:
    """Delays every packet."""

    kind: ClassVar[str] = "delay"
    cause: ClassVar[str] = "delay"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = DelayTable

    def __init__(self, parameters: DelayTable, place: ModelPlace) -> None:
        self._table = parameters
        self._draws = place.link_draws()

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Draw each packet's delay."""
        table = self._table
        if not table.jitter_s:
            return Verdict(after_s=np.full(len(packets), table.delay_s))
        return Verdict(after_s=table.delay_s + table.jitter_s * self._unit_jitter(packets))

    def _unit_jitter(self, packets: Packets) -> Floats:
        """Return draws (k,) of mean 1 from the distribution."""
        if self._table.distribution == "lognormal":
            stretched: Floats = np.exp(self._draws.normal(packets.link, packets.key) - 0.5)
            return stretched
        draw = self._draws.uniform(packets.link, packets.key)
        if self._table.distribution == "uniform":
            return 2.0 * draw
        left: Floats = 1.0 - draw  # (0, 1]
        if self._table.distribution == "exponential":
            return np.asarray(-np.log(left))
        return np.asarray(left ** (-1.0 / _PARETO_SHAPE) * (1.0 - 1.0 / _PARETO_SHAPE))
