"""Cut: no packet passes from `senders` to `receivers`; with `both`, none passes in the other direction either."""

from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import FaultContext, FaultTable, Nodes, unknown_nodes
from zwerm.world.faults.air import RadioFault, RadioFaultTable
from zwerm.world.radio import Packets, Transmissions, Verdict


class CutTable(RadioFaultTable):
    """The two ends of the links."""

    senders: Nodes
    receivers: Nodes
    both: bool = False


class Cut(RadioFault):
    """Drops packets between some nodes."""

    Parameters: ClassVar[type[FaultTable]] = CutTable
    cause: ClassVar[str] = "cut"
    in_network: ClassVar[bool] = True

    def __init__(self, parameters: CutTable, context: FaultContext) -> None:
        super().__init__(parameters, context)
        self._senders = context.mask(parameters.senders)
        self._receivers = context.mask(parameters.receivers)

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Test both ends of each packet."""
        sender, receiver = packets.sender, packets.receiver
        hit = self._senders[sender] & self._receivers[receiver]
        if self.parameters.both:
            hit |= self._senders[receiver] & self._receivers[sender]
        return Verdict(hit)

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return the mistakes in both ends and `channel`."""
        ends = {".senders": parameters.senders, ".receivers": parameters.receivers}
        found = [line for path, names in ends.items() for line in unknown_nodes(names, path, scenario)]
        return found + super().check(parameters, scenario)

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return the link between two robots, in one direction or in both."""
        sender, receiver = stream.choice(scenario.robots.count, 2, replace=False).tolist()
        return {"channel": "robots", "senders": [sender], "receivers": [receiver], "both": bool(stream.integers(2))}

    @classmethod
    def impossible(cls, scenario: Scenario) -> str:
        """Return that there is no link to cut, if so."""
        return super().impossible(scenario) or ("a robot alone has no links" if scenario.robots.count < 2 else "")
