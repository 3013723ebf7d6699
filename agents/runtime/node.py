"""A node without its transport: bytes of an observation in, bytes of a command out.

The same object runs behind the memory link and inside a robot process, so both answer with the same bytes.
"""

import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import msgspec

from zwerm.agents.runtime.contract import Setup, Stepper
from zwerm.agents.runtime.controllers import make
from zwerm.link import Answer
from zwerm.wire.messages import MESSAGE_BYTES_MAX, Command, Failure, Observation, decode_observation, encode

if TYPE_CHECKING:
    from zwerm.link.peer_radio import PeerRadio

# So that a failure fits into a message, whatever its characters.
ERROR_CHARS_MAX: Final = 2_000
TRACEBACK_CHARS_MAX: Final = 10_000


def _nothing() -> None:
    """Be told of a failure, and do nothing about it."""


class Node:
    """One node: its controller and the wire format around it.

    `answer` returns the encoded command for one encoded observation, or the encoded Failure if the controller raises; before
    that it calls `on_failure`. It is one function that has all it needs at hand: between two ticks of a big swarm a
    processor forgets a robot, and what has to be looked up again is what an answer costs.
    """

    def __init__(self, controller: str, setup: Setup, on_failure: Callable[[], object] = _nothing) -> None:
        self.id = setup.node
        self._on_failure = on_failure
        self._controller: Stepper = make(controller, setup)
        self.answer: Answer = self._answering(self._controller.step)

    def go_on_air(self, radio: "PeerRadio") -> None:
        """From now on hear what `radio` hears, and nothing else, and send by it what the controller sends."""
        step, began = self._controller.step, radio.begin

        def step_on_air(observation: Observation) -> Command:
            began()
            tick = observation.tick
            command = step(msgspec.structs.replace(observation, inbox=radio.take(tick)))
            for message in command.outbox:
                radio.send(tick, message)
            return command

        self.answer = self._answering(step_on_air)

    def _answering(self, step: Callable[[Observation], Command]) -> Answer:
        decode, write, fail = decode_observation, encode, self._fail

        def answer(payload: bytes) -> bytes:
            observation = decode(payload)
            tick = observation.tick
            try:
                command = step(observation)
                command.tick = tick
                said = write(command)
                if len(said) > MESSAGE_BYTES_MAX:
                    raise ValueError(f"the command takes {len(said)} bytes, at most {MESSAGE_BYTES_MAX} are allowed")
                return said
            except KeyboardInterrupt:  # Ctrl-C, for whoever runs nodes inline
                raise
            except BaseException as error:
                return fail(tick, error)

        return answer

    def _fail(self, tick: int, error: BaseException) -> bytes:
        self._on_failure()
        return encode(
            Failure(
                tick,
                _printable(f"{type(error).__name__}: {error}")[:ERROR_CHARS_MAX],
                _printable(traceback.format_exc())[-TRACEBACK_CHARS_MAX:],
            )
        )


def _printable(text: str) -> str:
    return text.encode(errors="backslashreplace").decode()
