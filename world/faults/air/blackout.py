"""Blackout: no packet passes on a channel."""

from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults.air import RadioFault
from zwerm.world.radio import Packets, Transmissions, Verdict


class Blackout(RadioFault):
    """Drops all packets."""

    cause: ClassVar[str] = "blackout"
    in_network: ClassVar[bool] = True

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Drop every packet."""
        return Verdict(np.ones(len(packets), dtype=np.bool_))

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return one of the channels."""
        channels = [name for name, there in (("robots", scenario.radio), ("uplink", scenario.coordinator)) if there]
        return {"channel": channels[int(stream.integers(len(channels)))]}

    @classmethod
    def impossible(cls, scenario: Scenario) -> str:
        """Return that there is no channel, if so."""
        return "" if scenario.coordinator is not None else super().impossible(scenario)
