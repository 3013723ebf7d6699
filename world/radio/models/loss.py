"""Independent loss: every packet is lost with the same probability, whatever became of those before it (Bernoulli)."""

from typing import ClassVar

from zwerm.scenario.types import Fraction
from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict


class LossTable(LinkTable):
    """The fraction of packets lost."""

    fraction: Fraction


class Loss:
    """Drops each packet with probability `fraction`, drawn by link and packet."""

    kind: ClassVar[str] = "loss"
    cause: ClassVar[str] = "loss"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = LossTable

    def __init__(self, parameters: LossTable, place: ModelPlace) -> None:
        self._fraction = parameters.fraction
        self._draws = place.link_draws()

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Draw once for every packet."""
        return Verdict(self._draws.uniform(packets.link, packets.key) < self._fraction)
