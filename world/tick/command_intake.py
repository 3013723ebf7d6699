"""Answers: what nodes say to the observations of one tick, who still owes one, and what no node may say.

Promises: each node that was asked is heard once a tick, and only with what this world can carry out; whatever else comes is
refused for a reason, counted, and changes nothing. In real time an answer to an earlier tick is heard too, in order.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from typing import Final

from zwerm.errors import ProtocolError
from zwerm.wire.messages import BodyVelocity, Command, Failure, WheelSpeeds, open_answer, traced_bytes
from zwerm.world.radio.medium import Medium

NO_ANSWER: Final = b""


class CommandIntake:
    """The answers to one tick's observations at a time. `late_count` is how many came after their tick."""

    def __init__(
        self, drive: type[BodyVelocity] | type[WheelSpeeds], body: str, fixed: Collection[int], medium: Medium
    ) -> None:
        """A `body` of that kind takes the drive `drive`; the nodes `fixed` have no body that moves."""
        self.refused: Counter[str] = Counter()
        self.late_allowed = False
        self.late_count = 0
        self._drive = drive
        self._drives = (drive, type(None))
        self._body = body
        self._fixed = fixed
        self._medium = medium
        self._tick = -1
        self._nodes: Sequence[int] = ()
        self._owing: dict[int, None] = {}
        self._heard: dict[int, tuple[bytes, Command | Failure]] = {}
        self._traced: dict[int, bytes] = {}  # what the trace covers of commands with telemetry
        self._late: list[tuple[int, Command | Failure]] = []
        self._newest: dict[int, int] = {}  # the tick that a node answered last, where answers may be late

    def ask(self, nodes: Sequence[int], tick: int) -> None:
        """Take note that `nodes`, ascending, have been sent the observations of `tick`."""
        self._tick, self._nodes = tick, nodes
        self._owing = dict.fromkeys(nodes)
        self._heard = {}
        self._traced = {}

    def hear(self, node: int, payload: bytes) -> Command | Failure:
        """Return what a node says, once it has been taken note of.

        Raises ProtocolError, and counts its reason, for what is malformed or unasked for; the node still owes its answer
        then.
        """
        try:
            answer = open_answer(payload)
            late = answer.tick != self._tick or node not in self._owing
            if late:
                self._check_late(node, answer.tick)
            if type(answer) is Command and (
                answer.outbox or type(answer.drive) not in self._drives or node in self._fixed
            ):
                self._check_content(node, answer)
        except ProtocolError as error:
            self.refused[error.reason] += 1
            raise
        if late:
            self._late.append((node, answer))
            self.late_count += 1
        else:
            self._heard[node] = payload, answer
            del self._owing[node]
            if type(answer) is Command and (answer.telemetry or answer.snapshot):
                self._traced[node] = traced_bytes(answer, payload)
        if self.late_allowed:
            self._newest[node] = answer.tick
        return answer

    def owing(self) -> list[int]:
        """Return the nodes that were asked and have not been heard, ascending."""
        return list(self._owing)

    def close(self) -> tuple[list[bytes], list[bytes], list[tuple[int, Command | Failure]]]:
        """End the tick: return the bytes of each node that was asked, in order; what the trace covers of them; the answers.

        Late answers come first. The second list is the first, less telemetry and snapshots.
        """
        heard = self._heard
        payloads = [heard[node][0] if node in heard else NO_ANSWER for node in self._nodes]
        traced = payloads
        if self._traced:
            traced = [self._traced.get(node, payload) for node, payload in zip(self._nodes, payloads, strict=True)]
        answers = self._late + [(node, heard[node][1]) for node in self._nodes if node in heard]
        self._late = []
        self.ask((), self._tick + 1)
        return payloads, traced, answers

    def _check_late(self, node: int, tick: int) -> None:
        """Raise ProtocolError, unless late answers are allowed and this one comes in order."""
        if self.late_allowed and self._newest.get(node, -1) < tick < self._tick:
            return
        if tick != self._tick:
            raise ProtocolError("out-of-order", f"node {node} answers tick {tick} at tick {self._tick}")
        if node not in self._heard:
            raise ProtocolError("unasked", f"node {node} was sent no observation at tick {tick}")
        raise ProtocolError("duplicate", f"node {node} answers tick {tick} again")

    def _check_content(self, node: int, command: Command) -> None:
        """Raise ProtocolError for a command that this world cannot carry out."""
        if command.drive is not None and type(command.drive) is not self._drive:
            raise ProtocolError("wrong-drive", f"a {self._body} body takes no {command.drive!r}")
        if command.drive is not None and node in self._fixed:
            raise ProtocolError("wrong-drive", f"node {node} has no drive")
        for message in command.outbox:
            refused = self._medium.refuses(node, message)
            if refused:
                raise ProtocolError("wrong-packet", refused)
