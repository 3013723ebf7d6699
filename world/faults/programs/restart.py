"""Restart: programs die and are started again at the same tick, as new incarnations without memory."""

from typing import ClassVar

from zwerm.world.faults import ProgramStates
from zwerm.world.faults.programs import ProgramFault


class Restart(ProgramFault):
    """These nodes lose their memory."""

    lasts: ClassVar[bool] = False
    healable: ClassVar[bool] = False

    def on_programs(self, states: ProgramStates) -> None:
        """Restart the nodes."""
        states.restarted[self.nodes] = True
