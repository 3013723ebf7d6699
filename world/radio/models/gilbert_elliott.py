"""Burst loss: each link is a Markov chain of a good and a bad state. It steps with every packet sent on the link.

Gilbert: Capacity of a burst-noise channel. Bell System Technical Journal 39 (1960). Elliott: Estimates of error rates for
codes on burst-noise channels. BSTJ 42 (1963), where the bad state passes some packets. The parameters are the measurable
ones, loss rate and length of bursts. The transition probabilities follow from these:

    in the long run a fraction b = loss_fraction / bad_loss_fraction of packets meets the bad state,
    P(bad -> good) = 1 / burst_packets,    P(good -> bad) = b / (1 - b) / burst_packets.

With `bad_loss_fraction` = 1 (Gilbert) a burst is a run of lost packets, `burst_packets` long in the mean.
"""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.radio.network_rules import RandomLoss

Share = Annotated[float, Field(gt=0, lt=1)]


class GilbertElliottTable(RadioModelTable):
    """The overall loss, the mean number of packets in a bad state, and the loss in the bad state."""

    loss_fraction: Share
    burst_packets: Annotated[float, Field(ge=1, allow_inf_nan=False)]
    bad_loss_fraction: Annotated[float, Field(gt=0, le=1)] = 1.0


class GilbertElliott(RadioModel):
    """Drops packets in the bad state of their link. The first packet of a link meets the chain in equilibrium."""

    cause: ClassVar[str] = "burst"
    draw_key: ClassVar[str] = "bursts"
    Parameters: ClassVar[type[RadioModelTable]] = GilbertElliottTable
    example: ClassVar[Mapping[str, Any]] = {"loss_fraction": 0.4, "burst_packets": 3.0}

    def __init__(self, parameters: GilbertElliottTable, context: ModelContext) -> None:
        self._equilibrium, self._enter, self._leave = chances(parameters)
        self._bad_loss = parameters.bad_loss_fraction
        self._random = context.link_random()
        self._passes = context.link_random("/pass") if parameters.bad_loss_fraction < 1.0 else None
        # The probability that the next packet meets the bad state; -1: equilibrium.
        self._bad = context.links.numbers(-1.0)

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Step the chain of every link once for each of its packets, in the order of sending."""
        draw = self._random.uniform(packets.link, packets.key)
        drop = np.zeros(len(packets), dtype=np.bool_)
        chance = self._bad.values
        for rows in packets.layers(sent):
            link = packets.link[rows]
            likely = chance[link]
            bad = draw[rows] < np.where(likely < 0.0, self._equilibrium, likely)
            chance[link] = np.where(bad, 1.0 - self._leave, self._enter)
            drop[rows] = bad
        if self._passes is not None:
            drop &= self._passes.uniform(packets.link, packets.key) < self._bad_loss
        return Verdict(drop)

    @classmethod
    def network_rule(cls, parameters: GilbertElliottTable) -> RandomLoss:
        """Return loss with the same chain. Raises ValueError as the constructor does."""
        _, enter, leave = chances(parameters)
        return RandomLoss(parameters.bad_loss_fraction, True, enter, leave)


def chances(parameters: GilbertElliottTable) -> tuple[float, float, float]:
    """Return the stationary probability of the bad state, P(good -> bad) and P(bad -> good).

    Raises ValueError, one line, if no chain has these parameters.
    """
    bad = parameters.loss_fraction / parameters.bad_loss_fraction
    if not bad < 1.0:
        raise ValueError(
            f"loss_fraction: expected < bad_loss_fraction {parameters.bad_loss_fraction:g}, "
            f"got {parameters.loss_fraction:g}"
        )
    enter = bad / (1.0 - bad) / parameters.burst_packets
    if enter > 1.0:
        raise ValueError(
            f"burst_packets: expected >= {bad / (1.0 - bad):g} for that loss_fraction, got {parameters.burst_packets:g}"
        )
    return bad, enter, 1.0 / parameters.burst_packets
