"""Delay with jitter: a packet arrives `delay_s` after it was sent, plus a random time with mean `jitter_s`.

A packet is delivered with the receiver's first observation at or after its arrival, so jitter beyond a tick reorders.
Distributions of the jitter, each with the mean jitter_s:

    uniform       over [0, 2 jitter_s)
    exponential   the waiting time at a memoryless server
    lognormal     with sigma 1: a heavy tail, as measured on the Internet
    pareto        with shape 2.5: a heavier tail. netem has a similar one, tc-netem(8)
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from zwerm.scenario.types import NonNegative
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import ReceiverDelay
from zwerm.world.scene import Floats

_PARETO_SHAPE = 2.5


class DelayTable(RadioModelTable):
    """A fixed part and a random one [s]."""

    delay_s: NonNegative = 0.0
    jitter_s: NonNegative = 0.0
    distribution: Literal["uniform", "exponential", "lognormal", "pareto"] = "uniform"


class Delay(RadioModel):
    """Delays every packet."""

    memoryless: ClassVar[bool] = True
    Parameters: ClassVar[type[RadioModelTable]] = DelayTable
    example: ClassVar[Mapping[str, Any]] = {"delay_s": 0.05, "jitter_s": 0.2, "distribution": "exponential"}

    def __init__(self, parameters: DelayTable, context: ModelContext) -> None:
        self._table = parameters
        self._random = context.link_random()

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Return the delay of each packet."""
        table = self._table
        if not table.jitter_s:
            return Verdict(after_s=np.full(len(packets), table.delay_s))
        return Verdict(after_s=table.delay_s + table.jitter_s * self._unit_jitter(packets))

    def _unit_jitter(self, packets: Packets) -> Floats:
        """Return random numbers (k,) of mean 1 with the chosen distribution."""
        if self._table.distribution == "lognormal":
            stretched: Floats = np.exp(self._random.normal(packets.link, packets.key) - 0.5)
            return stretched
        draw = self._random.uniform(packets.link, packets.key)
        if self._table.distribution == "uniform":
            return 2.0 * draw
        left: Floats = 1.0 - draw  # (0, 1]
        if self._table.distribution == "exponential":
            return np.asarray(-np.log(left))
        return np.asarray(left ** (-1.0 / _PARETO_SHAPE) * (1.0 - 1.0 / _PARETO_SHAPE))

    @classmethod
    def network_rule(cls, parameters: DelayTable) -> ReceiverDelay:
        """Return the same delay. Raises ValueError if the distribution is not uniform."""
        if parameters.jitter_s and parameters.distribution != "uniform":
            raise ValueError("netem has jitter of that mean only uniform")
        return ReceiverDelay(parameters.delay_s + parameters.jitter_s, parameters.jitter_s)
