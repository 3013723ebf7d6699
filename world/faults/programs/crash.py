"""Crash: programs die (SIGKILL in processes) and are down while the fault lasts.

At its end they are started again, as new incarnations without memory. The fault strikes `nodes`, or a `fraction` of the robots
in the arena, one at least, which the seed chooses when the fault begins. Base stations and robots that are down are not chosen.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.faults import FaultTable, Nodes, ProgramStates, Share
from zwerm.world.faults.programs import DrawnProgramFault
from zwerm.world.scene import Scene


class CrashTable(FaultTable):
    """The nodes that crash, or the fraction of the robots in the arena."""

    nodes: Nodes | None = None
    fraction: Share | None = None


class Crash(DrawnProgramFault):
    """These nodes are down."""

    Parameters: ClassVar[type[FaultTable]] = CrashTable
    healable: ClassVar[bool] = False

    @classmethod
    def check(cls, parameters: Any, scenario: Scenario) -> list[str]:
        """Return the mistakes in `nodes` and `fraction`."""
        found = super().check(parameters, scenario)
        if (parameters.nodes is None) == (parameters.fraction is None):
            found.append(": expected either nodes or fraction")
        return found

    def strike(self, scene: Scene, dead: Sequence[int]) -> Sequence[int]:
        """Choose the robots, as soon as there is one to choose from."""
        fraction = self.parameters.fraction
        if fraction is None or self.nodes:
            return ()
        base = self.context.scenario.base
        stations = base.stations if base is not None else 0
        robots = np.setdiff1d(scene.present_ids(), [*range(stations), *dead])
        lot = scene.draws.uniform(f"{self.context.purpose}/struck", robots)
        struck = robots[np.argsort(lot, kind="stable")[: max(1, round(fraction * len(robots)))]]
        self.nodes = sorted(struck.tolist())
        return self.nodes

    def on_programs(self, states: ProgramStates) -> None:
        """Set the nodes down."""
        states.down[self.nodes] = True
