"""Faults of programs, of robots, base stations and the coordinator: one file per kind.

The effect of a fault on a program is the same at the same tick inline and in processes.
"""

from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import Fault, FaultContext, FaultTable, Nodes, unknown_nodes


class ProgramFaultTable(FaultTable):
    """The nodes that the fault strikes."""

    nodes: Nodes


class ProgramFault(Fault):
    """A fault of the programs of some nodes. `nodes` are their ids."""

    Parameters: ClassVar[type[FaultTable]] = ProgramFaultTable
    touches_programs: ClassVar[bool] = True

    def __init__(self, parameters: Any, context: FaultContext) -> None:
        super().__init__(parameters, context)
        self.nodes = context.ids(parameters.nodes or ())

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return a line for each node that does not exist."""
        return unknown_nodes(parameters.nodes, ".nodes", scenario)


class DrawnProgramFault(ProgramFault):
    """A fault of programs that a random schedule may have."""

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return one node, with equal chances for robots and coordinator."""
        count = scenario.robots.count
        node = int(stream.integers(count + (scenario.coordinator is not None)))
        return {"nodes": ["coordinator" if node == count else node]}
