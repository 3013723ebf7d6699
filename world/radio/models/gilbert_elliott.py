"""Burst loss: each link is a Markov chain of a good and a bad state that steps with every packet sent on it.

Gilbert: Capacity of a burst-noise channel. Bell System Technical Journal 39 (1960). Elliott: Estimates of error rates for
codes on burst-noise channels. BSTJ 42 (1963), who also let the bad state pass some packets. What a user knows of a link is
its loss rate and how long its bursts are; the transition probabilities follow:

    in the long run a fraction b = loss_fraction / bad_loss_fraction of packets meets the bad state,
    P(bad -> good) = 1 / burst_packets,    P(good -> bad) = b / (1 - b) / burst_packets.

With `bad_loss_fraction` = 1 (Gilbert) a burst is a run of lost packets, `burst_packets` long in the mean.
"""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict

Share = Annotated[float, Field(gt=0, lt=1)]


class GilbertElliottTable(LinkTable):
    """The overall loss, and the mean number of packets for which a bad state lasts."""

    loss_fraction: Share
    burst_packets: Annotated[float, Field(ge=1, allow_inf_nan=False)]
    bad_loss_fraction: Annotated[float, Field(gt=0, le=1)] = 1.0


class GilbertElliott:
    """Drops what meets the bad state of its link; a link's first packet meets the chain in equilibrium."""

    kind: ClassVar[str] = "bursts"
    cause: ClassVar[str] = "burst"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = GilbertElliottTable

    def __init__(self, parameters: GilbertElliottTable, place: ModelPlace) -> None:
        bad = parameters.loss_fraction / parameters.bad_loss_fraction
        if not bad < 1.0:
            raise ValueError(
                f"loss_fraction: expected < bad_loss_fraction {parameters.bad_loss_fraction:g}, "
                f"got {parameters.loss_fraction:g}"
            )
        self._leave = 1.0 / parameters.burst_packets
        self._enter = bad / (1.0 - bad) / parameters.burst_packets
        if self._enter > 1.0:
            raise ValueError(
                f"burst_packets: expected >= {bad / (1.0 - bad):g} for that loss_fraction, got {parameters.burst_packets:g}"
            )
        self._equilibrium = bad
        self._bad_loss = parameters.bad_loss_fraction
        self._draws = place.link_draws()
        self._passes = place.link_draws("/pass") if parameters.bad_loss_fraction < 1.0 else None
        self._bad = place.links.numbers(
            -1.0
        )  # the probability that the next packet meets the bad state; -1: equilibrium

    def judge(self, air: Air, packets: Packets) -> Verdict:
        """Step the chain of every link once for each of its packets, in the order of sending."""
        draw = self._draws.uniform(packets.link, packets.key)
        drop = np.zeros(len(packets), dtype=np.bool_)
        chance = self._bad.values
        for rows in packets.layers(air):
            link = packets.link[rows]
            likely = chance[link]
            bad = draw[rows] < np.where(likely < 0.0, self._equilibrium, likely)
            chance[link] = np.where(bad, 1.0 - self._leave, self._enter)
            drop[rows] = bad
        if self._passes is not None:
            drop &= self._passes.uniform(packets.link, packets.key) < self._bad_loss
        return Verdict(drop)
