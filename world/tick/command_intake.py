"""Command intake: collects the answers to one tick's observations and refuses forbidden messages.

Each observed node is accepted once a tick, and only with a command that this world can carry out. Every other message is
refused for a reason, counted, and changes nothing. If the driver allows late answers (real time), an answer to an
earlier tick is accepted too, in order.
"""

from collections.abc import Collection, Iterator, Sequence
from typing import Final, NamedTuple, Protocol

from zwerm.errors import ProtocolError
from zwerm.wire.messages import BodyVelocity, Command, Failure, Transmission, WheelSpeeds, open_answer, traced_bytes
from zwerm.wire.refusals import Refusals

NO_ANSWER: Final = b""

NodeAnswer = tuple[int, Command | Failure]


class Addressing(Protocol):
    """The part of the radio that knows which transmissions are possible."""

    def refuses(self, sender: int, message: Transmission) -> str:
        """Return the reason why a transmission can never be sent, or an empty string."""


class Exchange(NamedTuple):
    """The messages of one tick: parallel sequences by node id, ascending. A node without an answer has b"".

    `traced` is the part of `commands` that the trace covers: all but telemetry and snapshots.
    """

    tick: int
    nodes: Sequence[int]
    observations: Sequence[bytes]
    commands: Sequence[bytes]
    traced: Sequence[bytes]


class CommandIntake:
    """Collects the answers of one tick at a time.

    `exchange` holds the messages of the tick that ended last. `observed_count` counts observations, `late_count` answers that
    came after their tick.
    """

    def __init__(
        self,
        drive: type[BodyVelocity] | type[WheelSpeeds],
        body: str,
        fixed: Collection[int],
        addressing: Addressing,
    ) -> None:
        """A body of kind `body` takes the drive type `drive`; the nodes in `fixed` have no body that moves."""
        self.exchange = Exchange(-1, (), (), (), ())
        self.refusals = Refusals()
        self.late_count = 0
        self.observed_count = 0
        self._drive = drive
        self._drives = (drive, type(None))
        self._body = body
        self._fixed = fixed
        self._addressing = addressing
        self._tick = -1
        self._nodes: Sequence[int] = ()
        self._observations: Sequence[bytes] = ()
        # By observed node, ascending: its answer, None while it is pending, and the bytes of it.
        self._answers: dict[int, Command | Failure | None] = {}
        self._payloads: dict[int, bytes] = {}
        self._traced: dict[int, bytes] = {}  # the traced bytes of the accepted commands with telemetry
        self._late: list[NodeAnswer] = []
        self._newest: dict[int, int] = {}  # the tick that a node answered last, where answers may be late

    def begin_tick(self, tick: int, nodes: Sequence[int], observations: Sequence[bytes]) -> None:
        """Expect an answer from each of `nodes`, ascending, which are sent `observations` at `tick`."""
        self._tick, self._nodes, self._observations = tick, nodes, observations
        self._answers = dict.fromkeys(nodes)
        self._payloads = dict.fromkeys(nodes, NO_ANSWER)
        self._traced = {}
        self.observed_count += len(nodes)

    def accept_plain(
        self, arrivals: Iterator[tuple[int, bytes | None]], crashed: Collection[int]
    ) -> tuple[int, tuple[int, bytes | None] | None]:
        """Accept plain answers from `arrivals` up to the first that is not plain; return their number and that arrival.

        A plain answer is a valid command for this tick, of a node that is not in `crashed`. `accept` does the same with it, but
        takes more time.
        """
        answers, payloads, drives, fixed, tick = self._answers, self._payloads, self._drives, self._fixed, self._tick
        accepted = 0
        for arrival in arrivals:
            node, payload = arrival
            if payload is None or node in crashed or answers.get(node, arrival) is not None:
                return accepted, arrival
            try:
                answer = open_answer(payload)
                if answer.tick != tick or type(answer) is not Command:
                    return accepted, arrival
                if answer.outbox or type(answer.drive) not in drives or node in fixed:
                    self._check_content(node, answer)
            except ProtocolError:
                return accepted, arrival
            answers[node] = answer
            payloads[node] = payload
            if answer.telemetry or answer.snapshot:
                self._traced[node] = traced_bytes(answer, payload)
            accepted += 1
        return accepted, None

    def accept(self, node: int, payload: bytes, late_allowed: bool = False) -> Command | Failure:
        """Accept a node's answer and return it decoded; with `late_allowed` also an answer to an earlier tick.

        Raises ProtocolError, and counts its reason, for a malformed or unexpected answer; the node stays pending then.
        """
        try:
            answer = open_answer(payload)
            late = answer.tick != self._tick or self._answers.get(node, answer) is not None
            if late:
                self._check_late(node, answer.tick, late_allowed)
            if type(answer) is Command and (
                answer.outbox or type(answer.drive) not in self._drives or node in self._fixed
            ):
                self._check_content(node, answer)
        except ProtocolError as error:
            self.refusals.count(node, error.reason)
            raise
        if late:
            self._late.append((node, answer))
            self.late_count += 1
        else:
            self._answers[node] = answer
            self._payloads[node] = payload
            if type(answer) is Command and (answer.telemetry or answer.snapshot):
                self._traced[node] = traced_bytes(answer, payload)
        if late_allowed:
            self._newest[node] = answer.tick
        return answer

    def is_pending(self, node: int) -> bool:
        """Return whether a node's answer to the observation of this tick has not been accepted."""
        return node in self._answers and self._answers[node] is None

    def newest_tick(self, node: int) -> int:
        """Return the tick of the newest answer accepted from a node, where answers may be late; -1 for none."""
        return self._newest.get(node, -1)

    def pending(self) -> list[int]:
        """Return the observed nodes whose answer has not been accepted, ascending."""
        return [node for node, answer in self._answers.items() if answer is None]

    def end_tick(self) -> list[NodeAnswer]:
        """End the tick: set `exchange`, and return all accepted answers, late ones first and then by node id."""
        commands = list(self._payloads.values())
        answers = self._late + [(node, answer) for node, answer in self._answers.items() if answer is not None]
        traced = commands
        if self._traced:
            traced = list((self._payloads | self._traced).values())
        self.exchange = Exchange(self._tick, self._nodes, self._observations, commands, traced)
        self._late = []
        self.begin_tick(self._tick + 1, (), ())
        return answers

    def _check_late(self, node: int, tick: int, allowed: bool) -> None:
        """Raise ProtocolError, unless late answers are `allowed` and this one comes in order."""
        if allowed and self._newest.get(node, -1) < tick < self._tick:
            return
        if tick != self._tick:
            raise ProtocolError("out-of-order", f"node {node} answers tick {tick} at tick {self._tick}")
        if self._answers.get(node) is None:
            raise ProtocolError("unasked", f"node {node} was sent no observation at tick {tick}")
        raise ProtocolError("duplicate", f"node {node} answers tick {tick} again")

    def _check_content(self, node: int, command: Command) -> None:
        """Raise ProtocolError for a command that this world cannot carry out."""
        if command.drive is not None and type(command.drive) is not self._drive:
            expected = f"a {self._body} body takes {self._drive.__name__}"
            raise ProtocolError("wrong-drive", f"drive: {expected}, got {command.drive!r}")
        if command.drive is not None and node in self._fixed:
            raise ProtocolError("wrong-drive", f"drive: node {node} has no drive, got {command.drive!r}")
        for message in command.outbox:
            refused = self._addressing.refuses(node, message)
            if refused:
                raise ProtocolError("wrong-packet", f"outbox: {refused}")
