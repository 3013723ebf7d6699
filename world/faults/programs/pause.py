"""Pause: programs are stopped and resume later (SIGSTOP, SIGCONT in processes).

The motors of a paused robot stop after `time.deadman_s`; its packets wait.
"""

from zwerm.world.faults import ProgramStates
from zwerm.world.faults.programs import DrawnProgramFault


class Pause(DrawnProgramFault):
    """These nodes are stopped."""

    def on_programs(self, states: ProgramStates) -> None:
        """Set the nodes paused."""
        states.paused[self.nodes] = True
