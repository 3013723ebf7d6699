"""A robot's end of the command protocol: each command is carried out once, and answered as often as it is repeated.

Commands have numbers, so a late or repeated command is recognised. A coordinator with another incarnation number starts
counting again, and is obeyed. The more copies of a request were lost, the more copies its answer has.
"""

from collections.abc import Callable
from typing import ClassVar, Final

from zwerm.agents.sensor_coverage.messages.commands import (
    UNKNOWN,
    UPLINK,
    Ack,
    Answer,
    Emerged,
    Request,
    Response,
    RobotCommand,
)
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing

COPIES_MAX: Final = 4


class RequestDeduplicator(Component):
    """The latest request to a robot, and the answer to it; `on_command` is called with each new command."""

    channel: ClassVar[str] = UPLINK
    accepts: ClassVar[tuple[type, ...]] = (Request,)

    def __init__(self, incarnation: int, on_command: Callable[[RobotCommand], None]) -> None:
        self._incarnation = incarnation
        self._on_command = on_command
        self._request: Request | None = None
        self._heard = 0
        self._answer: Answer | None = None
        self._emerged: Emerged | None = None
        self._repeated = False  # the request has arrived again
        self._misaddressed = False  # a request for an earlier incarnation of this robot has arrived
        self._new: list[Answer] = []

    def receive(self, sender: int, message: Request, tick: int) -> None:
        """Take in a request, and carry out its command if it is new and for this incarnation."""
        if message.to_incarnation not in (UNKNOWN, self._incarnation):
            self._misaddressed = True
            return
        known = self._request
        if known is not None and known.incarnation == message.incarnation and known.number >= message.number:
            if known.number == message.number:
                self._repeated = True
                self._heard += 1
                self._request = max(known, message, key=lambda each: each.attempt)
            return
        self._request, self._heard, self._answer, self._repeated = message, 1, None, False
        self._on_command(message.command)

    def answer(self, answer: Answer) -> None:
        """Send an answer to the latest request in this tick."""
        self._new.append(answer)

    def outgoing(self) -> list[Outgoing]:
        """Return the new answers, or the latest answer again if its request has arrived again."""
        new, self._new = self._new, []
        if self._misaddressed and self._emerged is not None:
            new.insert(0, self._emerged)
        sent: list[Outgoing] = []
        for answer in new:
            if isinstance(answer, Emerged):
                self._emerged, self._misaddressed = answer, False
                sent.append(Outgoing(None, Response(self._incarnation, UNKNOWN, 0, 0, 0, answer)))
            else:
                self._answer, self._repeated = answer, False
                sent += self._responses(answer)
        if self._repeated:
            self._repeated = False
            sent += self._responses(self._answer or Ack())
        return sent

    def _responses(self, answer: Answer) -> list[Outgoing]:
        request = self._request
        if request is None:
            return []
        missed = request.attempt - self._heard
        copies = 1 if isinstance(answer, Ack) else max(1, min(COPIES_MAX, 1 + missed))
        response = Response(
            self._incarnation, request.incarnation, request.number, request.attempt, self._heard, answer
        )
        return [Outgoing(None, response)] * copies
