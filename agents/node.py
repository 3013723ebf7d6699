"""A node without its transport: bytes of an observation in, bytes of a command out.

The same object runs behind the memory link and inside a robot process, so both answer with the same bytes.
"""

import traceback
from collections.abc import Callable
from typing import Final

import msgspec

from zwerm.agents.contract import Setup, Stepper
from zwerm.agents.registry import make
from zwerm.link.station import Radio
from zwerm.protocol import MESSAGE_BYTES_MAX, Command, Failure, Observation, decode_observation, encode

# So that a failure fits into a message, whatever its characters.
ERROR_CHARS_MAX: Final = 2_000
TRACEBACK_CHARS_MAX: Final = 10_000


class Node:
    """One node: its controller and the wire format around it."""

    def __init__(self, controller: str, setup: Setup) -> None:
        self.id = setup.node
        self.failed = False
        self._controller: Stepper = make(controller, setup)
        self._step: Callable[[Observation], Command] = self._controller.step

    def go_on_air(self, radio: Radio) -> None:
        """From now on hear what `radio` hears, and nothing else, and send by it what the controller sends."""
        step, began = self._step, radio.begin

        def step_on_air(observation: Observation) -> Command:
            began()
            tick = observation.tick
            command = step(msgspec.structs.replace(observation, inbox=radio.take(tick)))
            for message in command.outbox:
                radio.send(tick, message)
            return command

        self._step = step_on_air

    def answer(self, payload: bytes) -> bytes:
        """Return the encoded command for one encoded observation, or the encoded Failure if the controller raises."""
        observation = decode_observation(payload)
        try:
            command = self._step(observation)
            command.tick = observation.tick
            answer = encode(command)
            if len(answer) > MESSAGE_BYTES_MAX:
                raise ValueError(f"the command takes {len(answer)} bytes, at most {MESSAGE_BYTES_MAX} are allowed")
            return answer
        except (Exception, SystemExit) as error:
            self.failed = True
            return encode(
                Failure(
                    observation.tick,
                    _printable(f"{type(error).__name__}: {error}")[:ERROR_CHARS_MAX],
                    _printable(traceback.format_exc())[-TRACEBACK_CHARS_MAX:],
                )
            )


def _printable(text: str) -> str:
    return text.encode(errors="backslashreplace").decode()
