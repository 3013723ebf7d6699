"""The coordinator's mailbox: it repeats requests until they are answered, and reads each answer once.

A routine is a generator that yields its next wake-up: a packet, or a time. Several routines may run concurrently; each
takes its own answers from the mailbox.
"""

from collections.abc import Callable, Collection, Generator, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from zwerm.agents.sensor_coverage.messages.command_size import fitting
from zwerm.agents.sensor_coverage.messages.commands import (
    UNKNOWN,
    UPLINK,
    Ack,
    Answer,
    Cleared,
    Emerged,
    Report,
    Request,
    Response,
    RobotCommand,
    RollCall,
    read_response,
    write,
)
from zwerm.coordinator.sensor_coverage.retry_policy import BUSY_TICKS, REPEAT_TICKS, RetryPolicy
from zwerm.wire.messages import Packet, Transmission, Wake

T = TypeVar("T")
Routine = Generator[Wake, None, T]
# A robot and its answer.
ReceivedAnswer = tuple[int, Answer]

# If this many robots, and this fraction of all, fall silent together, the radio is jammed: wait longer by this factor.
JAMMED_MIN: Final = 3
JAMMED_FRACTION: Final = 0.25
JAMMED_FACTOR: Final = 10
# Give up on an acknowledged request after this many times its time limit.
STUCK_FACTOR: Final = 3
# A burst lasts for a number of packets, not for a time. After this many attempts requests follow each other in every
# tick.
URGENT_TRIES: Final = 6
# An answer is overdue after its time limit divided by this.
OVERDUE_DIVISOR: Final = 4
# Recovery burst of a coordinator that starts again, until a robot receives its first request after the roll call. The
# numbers are copies of the roll call, and copies of each request in every tick if messages are lost.
ROLL_CALL_COPIES: Final = 8
RECOVERY_COPIES: Final = 3


@dataclass
class _PendingRequest:
    """A request without an answer. `since` is the tick when it was first sent, or first acknowledged."""

    request: Request
    ticks_max: int
    since: int
    due: int
    tries: int = 0  # since the latest message about it
    received: bool = False
    cleared: bool = False
    ping: bool = False


class CommandMailbox:
    """Requests and answers of one `incarnation` of a coordinator.

    `survey_ticks` and `drive_ticks` are the time limits of answers to scans and drives. `incarnations` has the
    incarnation number of every robot that has ever answered.
    """

    def __init__(self, dt_s: float, incarnation: int = 1, survey_ticks: int = 80, drive_ticks: int = 300) -> None:
        self.now_s = 0.0
        self.retry_policy = RetryPolicy()
        self.incarnations: dict[int, int] = {}
        self._incarnation = incarnation
        self._dt_s = dt_s
        self._ticks = survey_ticks, drive_ticks
        self._unread: list[ReceivedAnswer] = []
        self._outbox: list[Transmission] = []
        self._pending: dict[int, _PendingRequest] = {}
        self._number: dict[int, int] = {}
        self._roll_call: tuple[Request, int] | None = None
        self._in_recovery = False
        self._second_roll_call_tick: int | None = None

    @property
    def tick(self) -> int:
        """The present tick."""
        return round(self.now_s / self._dt_s)

    # --- receiving --------------------------------------------------------------------------------------------------

    def receive(self, now_s: float, inbox: Sequence[Packet]) -> None:
        """Take in the packets of this tick, and give up requests to robots that are silent for too long."""
        self.now_s = now_s
        for packet in inbox:
            response = read_response(packet.payload)
            if response is not None and packet.sender is not None:
                self._read(packet.sender, response)
        for node, pending in list(self._pending.items()):
            if self._hopeless(pending):
                del self._pending[node]

    def _read(self, node: int, response: Response) -> None:
        if isinstance(response.answer, Emerged):
            before = self.incarnations.get(node)
            if before != response.incarnation:
                self.incarnations[node] = response.incarnation
                self._unread.append((node, response.answer))
                if before is not None:  # it has lost its request
                    self._pending.pop(node, None)
            return
        if response.to_incarnation != self._incarnation:
            return
        if response.number == 0:
            self.expect(node)
        pending = self._pending.get(node)
        if pending is None or response.number != pending.request.number:
            return
        self.incarnations[node] = response.incarnation
        self._in_recovery = self._in_recovery and response.number == 0
        pending.tries = 0
        self.retry_policy.lossy = self.retry_policy.lossy or response.heard < response.attempt
        if isinstance(response.answer, Ack | Cleared):
            if not pending.received:
                pending.received, pending.since = True, self.tick
            wait = BUSY_TICKS if self.retry_policy.lossy else pending.ticks_max // OVERDUE_DIVISOR
            pending.due = self.tick + wait
            if isinstance(response.answer, Cleared) and not pending.cleared:
                pending.cleared = True
                self._unread.append((node, response.answer))
            return
        self.retry_policy.update(response.attempt, response.heard)
        self._unread.append((node, response.answer))
        del self._pending[node]
        self._expect_seen(response)

    def _hopeless(self, pending: _PendingRequest) -> bool:
        """Return whether no answer to a request will come."""
        waited = self.tick - pending.since
        if pending.ping:
            return waited >= pending.ticks_max
        silent = sum(not each.received and not each.ping for each in self._pending.values())
        jammed = silent >= max(JAMMED_MIN, JAMMED_FRACTION * len(self.incarnations))
        if pending.received and pending.tries <= 2:
            return waited >= STUCK_FACTOR * pending.ticks_max
        limit = pending.ticks_max * (JAMMED_FACTOR if jammed else 1)
        return waited >= limit and pending.tries >= self.retry_policy.tries_max

    # --- sending ----------------------------------------------------------------------------------------------------

    def roll_call(self, command: RollCall, copies: int = 1) -> None:
        """Send this number of copies of a roll call to all robots in reach."""
        self._roll_call = self._call(Request(self._incarnation, 0, 0, UNKNOWN, command), copies), self.tick
        self._in_recovery = copies > 1
        self._second_roll_call_tick = self.tick + REPEAT_TICKS if self._in_recovery else None

    def _call(self, request: Request, copies: int) -> Request:
        """Send this number of copies of a request to all robots, and return the last one."""
        for _ in range(copies):
            request = _next_attempt(request)
            self._outbox.append(Transmission(UPLINK, write(request)))
        return request

    def _call_again(self) -> None:
        """Repeat the roll call if a message was lost before a robot could answer: a robot that missed it must begin soon.

        If nothing is lost, all expected robots have acknowledged by now.
        """
        self._second_roll_call_tick = None
        unreceived = any(not each.received for each in self._pending.values())
        if self._roll_call is None or not (self.retry_policy.lossy or unreceived):
            return
        request, tick = self._roll_call
        self._roll_call = self._call(request, ROLL_CALL_COPIES), tick
        for pending in self._pending.values():
            pending.request = self._roll_call[0]
            pending.tries += ROLL_CALL_COPIES
            pending.due = max(pending.due, self.tick + self.retry_policy.repeat_ticks)

    def expect(self, node: int) -> None:
        """Expect a robot's answer to the roll call."""
        if self._roll_call is not None and node not in self._number:
            self._number[node] = 0
            request, tick = self._roll_call
            due = tick + self.retry_policy.repeat_ticks
            self._pending[node] = _PendingRequest(request, self._ticks[0], tick, due, tries=request.attempt)

    def _expect_seen(self, response: Response) -> None:
        """Expect answers to the roll call from all robots that an answering robot sees."""
        if response.number == 0 and isinstance(response.answer, Report):
            self._second_roll_call_tick = None
            for each in response.answer.sightings or ():
                self.expect(each.node)
                pending = self._pending.get(each.node)
                if pending is not None and pending.request.number == 0 and self.retry_policy.lossy:
                    pending.due = min(pending.due, self.tick)

    def send(self, node: int, command: RobotCommand, drive: bool = False, ping: bool = False) -> None:
        """Send a command, and repeat it until it is answered; a `ping` is not repeated."""
        number = self._number[node] = self._number.get(node, 0) + 1
        self._unread = [each for each in self._unread if each[0] != node or isinstance(each[1], Emerged)]
        request = Request(self._incarnation, number, 0, self.incarnations.get(node, UNKNOWN), command)
        due = self.tick + self._repeat_ticks(self._ticks[drive])
        self._pending[node] = _PendingRequest(request, self._ticks[drive], self.tick, due, ping=ping)
        self._transmit(node, self._pending[node])

    def waits_for(self, node: int) -> bool:
        """Return whether a request to a robot is not answered yet."""
        return node in self._pending

    def cancel(self, node: int) -> None:
        """Do not repeat the request to a robot."""
        self._pending.pop(node, None)

    def outgoing(self, bytes_taken: int = 0) -> tuple[Transmission, ...]:
        """Return the packets to send now: new requests, and repeated ones.

        Messages that do not fit into one command are sent at the next ticks; `bytes_taken` of the command are in use already.
        """
        if self._second_roll_call_tick is not None and self.tick >= self._second_roll_call_tick:
            self._call_again()
        for node, pending in self._pending.items():
            if self.tick >= pending.due and not pending.ping:
                self._transmit(node, pending)
                urgent = pending.tries > URGENT_TRIES or self._copies > 1
                pending.due = self.tick + (1 if urgent else self.retry_policy.repeat_ticks)
        count = fitting(self._outbox, bytes_taken)
        outbox, self._outbox = tuple(self._outbox[:count]), self._outbox[count:]
        return outbox

    def next_wake_s(self) -> float | None:
        """Return the time of the next repetition, or of the end of a ping; the next tick while packets wait to be sent."""
        if self._outbox:
            return self.now_s + self._dt_s
        due = [each.since + each.ticks_max if each.ping else each.due for each in self._pending.values()]
        return min(due) * self._dt_s if due else None

    def _transmit(self, node: int, pending: _PendingRequest) -> None:
        """Send a request, in copies during a recovery burst."""
        for _ in range(1 if pending.ping else self._copies):
            pending.request = _next_attempt(pending.request)
            pending.tries += 1
            self._outbox.append(Transmission(UPLINK, write(pending.request), node))

    @property
    def _copies(self) -> int:
        """Number of copies of a request to one robot."""
        return RECOVERY_COPIES if self._in_recovery and self.retry_policy.lossy else 1

    def _repeat_ticks(self, ticks_max: int) -> int:
        """Return the ticks before the first repetition: before any loss, the ticks until the answer is overdue."""
        if self._copies > 1:
            return 1
        return self.retry_policy.repeat_ticks if self.retry_policy.lossy else ticks_max // OVERDUE_DIVISOR

    # --- waiting ----------------------------------------------------------------------------------------------------

    def take_unread(self) -> list[ReceivedAnswer]:
        """Return and drop the answers that no routine has taken."""
        unread, self._unread = self._unread, []
        return unread

    def answers(self, nodes: Collection[int], *kinds: type[Answer]) -> Routine[dict[int, Answer]]:
        """Wait until each robot has given an answer of these types or was given up; return the answers by robot."""
        found: dict[int, Answer] = {}
        while True:
            unread: list[ReceivedAnswer] = []
            for node, answer in self._unread:
                if node in nodes and node not in found and isinstance(answer, kinds):
                    found[node] = answer
                else:
                    unread.append((node, answer))
            self._unread = unread
            if all(node in found or node not in self._pending for node in nodes):
                return found
            yield Wake(on_packet=True)

    def first(
        self, wanted: Callable[[int, Answer], bool], node: int, ticks: int | None = None
    ) -> Routine[ReceivedAnswer | None]:
        """Wait for the first wanted answer, until the request to `node` has ended, or for `ticks`."""
        until_s = None if ticks is None else self.now_s + ticks * self._dt_s
        while True:
            for number, each in enumerate(self._unread):
                if wanted(*each):
                    return self._unread.pop(number)
            if node not in self._pending if until_s is None else self.now_s >= until_s - 1e-9:
                return None
            yield Wake(at_s=until_s, on_packet=True)

    def suspect_loss(self) -> bool:
        """Count a silence as a loss; return whether it is the first."""
        first = not self.retry_policy.lossy
        self.retry_policy.lossy = True
        return first

    def pause(self, ticks: int = 1) -> Routine[None]:
        """Wait for `ticks`."""
        until_s = self.now_s + ticks * self._dt_s
        while self.now_s < until_s - 1e-9:
            yield Wake(at_s=until_s)


def _next_attempt(request: Request) -> Request:
    """Return a request as it is sent the next time."""
    return Request(request.incarnation, request.number, request.attempt + 1, request.to_incarnation, request.command)


def run_concurrently(routines: Sequence[Routine[T]]) -> Routine[list[T]]:
    """Run routines concurrently, and return their results when all have ended."""
    ends: dict[int, T] = {}
    while True:
        wakes: list[Wake] = []
        for number, routine in enumerate(routines):
            if number in ends:
                continue
            try:
                wakes.append(next(routine))
            except StopIteration as end:
                ends[number] = end.value
        if not wakes:
            return [ends[number] for number in range(len(routines))]
        times = [wake.at_s for wake in wakes if wake.at_s is not None]
        yield Wake(at_s=min(times, default=None), on_packet=any(wake.on_packet for wake in wakes))
