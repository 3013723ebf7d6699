"""A controller that nobody may import as root: for tests of robots that have users of their own."""

import os

from zwerm.agents.runtime.contract import Controller
from zwerm.wire.messages import Command, Observation

if os.geteuid() == 0:
    raise PermissionError("root runs the code of a controller")


class Untrusted(Controller):
    """Does nothing."""

    def step(self, observation: Observation) -> Command:
        return Command(telemetry={"user": float(os.geteuid())})
