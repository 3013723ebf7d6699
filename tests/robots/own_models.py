"""Radio models of a user, for tests."""

from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.types import NonNegative
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import RandomLoss


class Lossy:
    """Loses all packets. It does not inherit from the base class of radio models."""

    cause: ClassVar[str] = "silence"

    def __init__(self, parameters: Any, context: ModelContext) -> None:
        pass

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        return Verdict(np.ones(len(packets), dtype=np.bool_))


class Shadowed(Lossy):
    """Finds every receiver out of reach."""

    out_of_reach: ClassVar[bool] = True


class RainTable(RadioModelTable):
    """The rain rate."""

    mm_per_h: NonNegative


class Rain(RadioModel):
    """Loses one packet in a hundred for each mm/h."""

    Parameters: ClassVar[type[RadioModelTable]] = RainTable
    cause: ClassVar[str] = "rain"

    def __init__(self, parameters: RainTable, context: ModelContext) -> None:
        self._fraction = parameters.mm_per_h / 100.0
        self._random = context.link_random()

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        return Verdict(self._random.uniform(packets.link, packets.key) < self._fraction)

    @classmethod
    def network_rule(cls, parameters: RainTable) -> RandomLoss:
        return RandomLoss(parameters.mm_per_h / 100.0)


class WithoutJudge:
    """No radio model."""


class WithoutContext(Lossy):
    """No radio model: its constructor takes too little."""

    def __init__(self) -> None:
        pass
