"""Log-distance path loss with log-normal shadowing, and the fraction of packets that a received power lets through.

    P_r = tx_power_dbm - reference_loss_db - 10 exponent log10(d / reference_m) - X - walls,    X ~ N(0, shadowing_sd_db)

Rappaport: Wireless Communications, 2nd ed. 2002, eq. 4.69. X belongs to a pair of robots, the same in both directions and
for the whole run; `fading_sd_db` adds a random number of its own to every packet. "walls" is the attenuation by an earlier
`wall_attenuation`. The probability of reception is logistic in P_r: one half at `sensitivity_dbm`, from 12 % to 88 % over 4
`width_db`, the transitional region of Zuniga, Krishnamachari: Analyzing the transitional region in low power wireless
links. SECON 2004.

A broadcast beyond `reach_m` is dropped without a draw: its probability of reception is at most `negligible_probability`.

The defaults are those of an IEEE 802.15.4 radio (0 dBm, -94 dBm) indoors.
"""

import math
from collections.abc import Mapping
from statistics import NormalDist
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from zwerm.scenario.types import Finite, NonNegative, Positive
from zwerm.world.radio import ModelContext, Packets, RadioModel, RadioModelTable, Transmissions, Verdict
from zwerm.world.scene import Floats


class PathLossTable(RadioModelTable):
    """Powers [dBm], losses and deviations [dB], distances [m]."""

    tx_power_dbm: Finite = 0.0
    reference_loss_db: Finite = 40.2  # free space, 1 m, 2.45 GHz
    reference_m: Positive = 1.0
    exponent: Positive = 3.0
    shadowing_sd_db: NonNegative = 4.0
    fading_sd_db: NonNegative = 0.0
    sensitivity_dbm: Finite = -94.0
    width_db: Positive = 1.0
    negligible_probability: Annotated[float, Field(gt=0, le=0.01)] = 1e-9


class PathLoss(RadioModel):
    """Drops packets with a probability that depends on the received power."""

    cause: ClassVar[str] = "weak-signal"
    needs_positions: ClassVar[bool] = True
    memoryless: ClassVar[bool] = True
    Parameters: ClassVar[type[RadioModelTable]] = PathLossTable
    example: ClassVar[Mapping[str, Any]] = {"tx_power_dbm": -50.0}

    def __init__(self, parameters: PathLossTable, context: ModelContext) -> None:
        self._table = parameters
        self._reach_m = reach_m(parameters)
        self._context = context
        self._random = context.link_random()
        self._fading = context.link_random("/fading")
        self._shadow_db = context.links.numbers(np.nan)

    @property
    def reach_m(self) -> float:
        """The distance beyond which a packet passes with at most `negligible_probability` [m]."""
        return self._reach_m

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Compare one random number of each packet with its probability of reception."""
        with np.errstate(over="ignore"):
            chance = 1.0 / (
                1.0 + np.exp((self._table.sensitivity_dbm - self.power_dbm(sent, packets)) / self._table.width_db)
            )
        return Verdict(self._random.uniform(packets.link, packets.key) >= chance)

    def power_dbm(self, sent: Transmissions, packets: Packets) -> Floats:
        """Return (k,) the received power of each packet [dBm]."""
        table, position = self._table, sent.scene.position
        offset = position[packets.sender] - position[packets.receiver]
        # The model does not apply below the reference distance: the power is constant there.
        distance = np.maximum(np.hypot(offset[:, 0], offset[:, 1]) / table.reference_m, 1.0)
        power: Floats = table.tx_power_dbm - table.reference_loss_db - 10.0 * table.exponent * np.log10(distance)
        if table.shadowing_sd_db:
            power = power - self._shadowing_db(packets)
        if table.fading_sd_db:
            power = power - table.fading_sd_db * self._fading.normal(packets.link, packets.key)
        return power if packets.attenuation_db is None else power - packets.attenuation_db

    def _shadowing_db(self, packets: Packets) -> Floats:
        """Return (k,) the shadowing of the pair of robots of each packet [dB], constant over a run."""
        shadow = self._shadow_db.values
        new = np.isnan(shadow[packets.link])
        if new.any():
            link, sender, receiver = packets.link[new], packets.sender[new], packets.receiver[new]
            draw = self._context.draws.normal(
                self._context.purpose + "/shadowing", np.minimum(sender, receiver), np.maximum(sender, receiver)
            )
            shadow[link] = self._table.shadowing_sd_db * draw
        drawn: Floats = shadow[packets.link]
        return drawn

    @classmethod
    def network_rule(cls, parameters: PathLossTable) -> None:
        """Raise ValueError: the probability of loss depends on the distance."""
        raise ValueError("its loss depends on the distance: use the models range and loss")


def reach_m(table: PathLossTable) -> float:
    """Return the distance [m] beyond which a packet passes with at most `negligible_probability`; infinite beyond any number.

    Over the distances at which the mean power is `sensitivity_dbm` - margin: a normal random number above z deviations has
    probability p / 2, and so has a draw below the logistic function at - width_db ln(2 / p).
    """
    half = table.negligible_probability / 2.0
    deviation_db = math.hypot(table.shadowing_sd_db, table.fading_sd_db)
    margin_db = -NormalDist().inv_cdf(half) * deviation_db - table.width_db * math.log(half)
    budget_db = table.tx_power_dbm - table.reference_loss_db - table.sensitivity_dbm + margin_db
    try:
        return table.reference_m * max(1.0, math.pow(10.0, budget_db / (10.0 * table.exponent)))
    except OverflowError:
        return math.inf
