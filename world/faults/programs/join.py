"""Join: programs are not started before the fault begins. The bodies of robots stand in the arena without power until then."""

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
