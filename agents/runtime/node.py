"""A node without its transport: from the bytes of an observation to the bytes of a command.

The memory link and the robot process run the same object, so both return the same bytes.
"""

import inspect
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec

from zwerm.agents.runtime.contract import Setup, Stepper
from zwerm.agents.runtime.controllers import make, step_place
from zwerm.link import Answer
from zwerm.wire.messages import (
    MESSAGE_BYTES_MAX,
    Command,
    Failure,
    Observation,
    check_records,
    decode_observation,
    encode,
)
from zwerm.wire.text import printable, printable_line

if TYPE_CHECKING:
    from zwerm.link.peer_radio import PeerRadio

# Limits of a Failure, so that it fits into a message even if each character takes several bytes.
ERROR_CHARS_MAX: Final = 2_000
TRACEBACK_CHARS_MAX: Final = 10_000


def _nothing() -> None:
    """Ignore a failure."""


class Node:
    """One node: its controller and the wire format around it.

    `answer` returns the encoded command for one encoded observation. If the controller raises, it calls `on_failure` and
    returns the encoded Failure. `answer` is a closure over local names, because attribute look-ups cost most of an
    answer. In a large swarm the objects of a robot leave the processor's cache between two ticks.

    A KeyboardInterrupt passes if the node is `interruptible`. In a process without Ctrl-C the controller has raised it.
    """

    def __init__(
        self,
        controller: str,
        setup: Setup,
        on_failure: Callable[[], object] = _nothing,
        *,
        interruptible: bool = True,
    ) -> None:
        self.id = setup.node
        self._on_failure = on_failure
        self._interruptible = interruptible
        self._controller: Stepper = make(controller, setup)
        self.answer: Answer = self._answering(self._controller.step)

    def use_radio(self, radio: "PeerRadio") -> None:
        """From now on receive packets from `radio` only, and send the controller's packets over it."""
        step, began = self._controller.step, radio.begin

        def step_with_radio(observation: Observation) -> Command:
            began()
            tick = observation.tick
            command = step(msgspec.structs.replace(observation, inbox=radio.take(tick)))
            for message in command.outbox:
                radio.send(tick, message)
            return command

        self.answer = self._answering(step_with_radio)

    def _answering(self, step: Callable[[Observation], Command]) -> Answer:
        decode, write, fail, interruptible = decode_observation, encode, self._fail, self._interruptible

        def answer(payload: bytes) -> bytes:
            observation = decode(payload)
            tick = observation.tick
            try:
                command = step(observation)
                if command.__class__ is not Command:
                    raise TypeError(f"step() returned {command!r:.80}, expected a Command")
                command.tick = tick
                if command.telemetry or command.snapshot:
                    check_records(command)
                payload_out = write(command)
                if len(payload_out) > MESSAGE_BYTES_MAX:
                    raise ValueError(
                        f"the command takes {len(payload_out)} bytes, at most {MESSAGE_BYTES_MAX} are allowed"
                    )
                return payload_out
            except BaseException as error:
                if interruptible and isinstance(error, KeyboardInterrupt):  # Ctrl-C during an inline run
                    raise
                return fail(tick, error)

        return answer

    def _fail(self, tick: int, error: BaseException) -> bytes:
        self._on_failure()
        return encode(
            Failure(
                tick,
                printable_line(f"{type(error).__name__}: {_text_of(error)}")[:ERROR_CHARS_MAX] + self._place(error),
                printable("".join(_formatted(error)))[-TRACEBACK_CHARS_MAX:],
            )
        )

    def _place(self, error: BaseException) -> str:
        """Return the last line of the controller's own file that led to `error`, or the place of its `step`."""
        own = inspect.unwrap(type(self._controller).step).__code__.co_filename
        frames = [each for each in traceback.extract_tb(error.__traceback__) if each.filename == own]
        if not frames:
            return step_place(type(self._controller))
        return f" ({Path(own).name}:{frames[-1].lineno}, in {frames[-1].name})"


def _text_of(error: BaseException) -> str:
    """Return the text of an error; the class of a controller's own may raise instead."""
    try:
        return str(error)
    except Exception:
        return "its text cannot be made"


def _formatted(error: BaseException) -> list[str]:
    """Return the traceback of an error from the controller's frame on.

    It is empty where the error is about the command that `step` returned: no frame is the controller's own.
    """
    trace = error.__traceback__
    trace = None if trace is None else trace.tb_next
    if trace is None or trace.tb_frame.f_code.co_filename == check_records.__code__.co_filename:
        return []
    return traceback.format_exception(type(error), error, trace)
