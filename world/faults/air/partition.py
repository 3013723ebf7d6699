"""Partition: no packet passes between nodes of different `groups`. Nodes in no group form one more group."""

from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import FaultContext, FaultTable, Nodes, unknown_nodes
from zwerm.world.faults.air import RadioFault, RadioFaultTable
from zwerm.world.radio import Packets, Transmissions, Verdict
from zwerm.world.scene import Ints


class PartitionTable(RadioFaultTable):
    """The groups."""

    groups: list[Nodes]


class Partition(RadioFault):
    """Drops packets from one group to another."""

    Parameters: ClassVar[type[FaultTable]] = PartitionTable
    cause: ClassVar[str] = "partition"
    in_network: ClassVar[bool] = True

    def __init__(self, parameters: PartitionTable, context: FaultContext) -> None:
        super().__init__(parameters, context)
        self._group: Ints = np.zeros(context.nodes, dtype=np.int64)
        for number, members in enumerate(parameters.groups, 1):
            self._group[context.ids(members)] = number

    def judge(self, sent: Transmissions, packets: Packets) -> Verdict:
        """Compare the groups of sender and receiver."""
        return Verdict(self._group[packets.sender] != self._group[packets.receiver])

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return the mistakes in `groups` and `channel`."""
        found: list[str] = []
        for number, group in enumerate(parameters.groups):
            found += unknown_nodes(group, f".groups.{number}", scenario)
        named = [name for group in parameters.groups for name in group]
        found += [f".groups: {name} is named twice" for name in sorted({str(n) for n in named if named.count(n) > 1})]
        return found + super().check(parameters, scenario)

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return a random group of robots."""
        count = scenario.robots.count
        chosen = np.flatnonzero(stream.random(count) < stream.random())
        return {"channel": "robots", "groups": [chosen.tolist() or [int(stream.integers(count))]]}

    @classmethod
    def impossible(cls, scenario: Scenario) -> str:
        """Return that there is no link to cut, if so."""
        return super().impossible(scenario) or ("a robot alone has no links" if scenario.robots.count < 2 else "")
