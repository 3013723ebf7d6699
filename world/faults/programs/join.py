"""Join: programs are not started before the fault begins. Until then the bodies of the robots stand in the arena."""

from typing import ClassVar

from zwerm.world.faults import ProgramStates
from zwerm.world.faults.programs import ProgramFault


class Join(ProgramFault):
    """These nodes are late joiners."""

    lasts: ClassVar[bool] = False
    healable: ClassVar[bool] = False

    def before(self, states: ProgramStates) -> None:
        """Set the nodes down until the fault begins."""
        states.down[self.nodes] = True
