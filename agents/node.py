"""A node without its transport: bytes of an observation in, bytes of a command out.

The same object runs behind the memory link and inside a robot process, so both answer with the same bytes.
"""

import traceback

from zwerm.agents.contract import Setup, Stepper
from zwerm.agents.registry import make
from zwerm.protocol import Failure, decode_observation, encode


class Node:
    """One node: its controller and the wire format around it."""

    def __init__(self, controller: str, setup: Setup) -> None:
        self.id = setup.node
        self.failed = False
        self._controller: Stepper = make(controller, setup)
        self._step = self._controller.step

    def answer(self, payload: bytes) -> bytes:
        """Return the encoded command for one encoded observation, or the encoded Failure if the controller raises."""
        observation = decode_observation(payload)
        try:
            command = self._step(observation)
            command.tick = observation.tick
            return encode(command)
        except Exception as error:
            self.failed = True
            return encode(Failure(observation.tick, f"{type(error).__name__}: {error}", traceback.format_exc()))
