"""Faults of the radio: one file a kind. Each judges packets before the models of its channel while it is active."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from zwerm.scenario.tables import Scenario
from zwerm.world.faults import Fault, FaultTable
from zwerm.world.radio import ROBOTS, UPLINK, PacketJudge, Packets, Transmissions, Verdict


class RadioFaultTable(FaultTable):
    """The channel of the fault, by default both."""

    channel: Literal["robots", "uplink"] | None = None


class RadioFault(Fault, ABC):
    """A fault that judges packets. A subclass that drops packets at random must leave `in_network` false."""

    Parameters: ClassVar[type[FaultTable]] = RadioFaultTable

    # The name under which the ledger counts the packets that the fault drops.
    cause: ClassVar[str] = "fault"
    # The receivers of dropped packets are out of reach. Otherwise the packets are losses.
    out_of_reach: ClassVar[bool] = False

    @abstractmethod
    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Return the effects on `packets`."""

    def on_radio(self, channel: str) -> Sequence[PacketJudge]:
        """Judge the packets of its channel, or of both."""
        return (self,) if self.parameters.channel in (None, channel) else ()

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return the mistakes in `channel`."""
        if parameters.channel == UPLINK and scenario.coordinator is None:
            return [".channel: the scenario has no coordinator to lead to, got 'uplink'"]
        if scenario.radio is None and (parameters.channel == ROBOTS or scenario.coordinator is None):
            return [": the scenario has no radio to disturb"]
        return []

    @classmethod
    def impossible(cls, scenario: Scenario) -> str:
        """Return that there is no radio between robots, if so."""
        return "the scenario has no radio" if scenario.radio is None else ""
