"""Independent loss: each packet is lost with the same probability, independently of all others (Bernoulli)."""

from collections.abc import Mapping
from typing import Any, ClassVar

from zwerm.scenario.types import Fraction
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import RandomLoss


class LossTable(RadioModelTable):
    """The fraction of packets lost."""

    fraction: Fraction


class Loss(RadioModel):
    """Drops each packet with probability `fraction`."""

    cause: ClassVar[str] = "loss"
    memoryless: ClassVar[bool] = True
    Parameters: ClassVar[type[RadioModelTable]] = LossTable
    example: ClassVar[Mapping[str, Any]] = {"fraction": 0.3}

    def __init__(self, parameters: LossTable, context: ModelContext) -> None:
        self._fraction = parameters.fraction
        self._random = context.link_random()

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Compare one random number of each packet with the fraction."""
        return Verdict(self._random.uniform(packets.link, packets.key) < self._fraction)

    @classmethod
    def network_rule(cls, parameters: LossTable) -> RandomLoss:
        """Return loss without memory."""
        return RandomLoss(parameters.fraction)
