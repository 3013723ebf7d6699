"""Slow: programs take `every_ticks` ticks for each answer.

A slow node is observed once in that many ticks, and its commands take effect that much later.
"""

from typing import Annotated, Any, ClassVar, Final

import numpy as np
from pydantic import Field

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.faults import FaultTable, ProgramStates
from zwerm.world.faults.programs import DrawnProgramFault, ProgramFaultTable

# Range of `every_ticks` in random schedules: least, and one more than the greatest.
_RANDOM_TICKS: Final = (2, 10)


class SlowTable(ProgramFaultTable):
    """The nodes, and the ticks that each takes for an answer."""

    every_ticks: Annotated[int, Field(ge=2, le=10_000)]


class Slow(DrawnProgramFault):
    """These nodes answer late."""

    Parameters: ClassVar[type[FaultTable]] = SlowTable
    touches_programs: ClassVar[bool] = False  # the world holds the answers back
    in_network: ClassVar[bool] = True

    def on_programs(self, states: ProgramStates) -> None:
        """Slow the nodes; of two such faults the slower counts."""
        states.every_ticks[self.nodes] = np.maximum(states.every_ticks[self.nodes], self.parameters.every_ticks)

    @classmethod
    def random_parameters(cls, stream: np.random.Generator, scenario: Scenario, arena: Arena) -> dict[str, Any] | None:
        """Return one node and its ticks."""
        nodes = super().random_parameters(stream, scenario, arena) or {}
        return nodes | {"every_ticks": int(stream.integers(*_RANDOM_TICKS))}
