"""The coordinator's post: orders out, again and again until they are answered, and answers in, each once.

A story is a generator that yields when it wants to go on: at the next packet, or at a time. Several may be told at once;
each takes from the mail what is its own.
"""

from collections.abc import Callable, Collection, Generator, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from zwerm.agents.sensor_coverage.messages.commands import (
    UNKNOWN,
    Ack,
    Answer,
    Cleared,
    Emerged,
    Order,
    Report,
    Request,
    Response,
    RollCall,
    read_reply,
    write,
)
from zwerm.coordinator.sensor_coverage.retry_policy import AGAIN_TICKS, BUSY_TICKS, RetryPolicy
from zwerm.wire.messages import Packet, Transmission, Wake

T = TypeVar("T")
Story = Generator[Wake, None, T]
Letter = tuple[int, Answer]

# Where so many fall silent at once, and this share of all, it is the radio rather than they: how much longer to wait then.
JAMMED_MIN: Final = 3
JAMMED_FRACTION: Final = 0.25
JAMMED_TIMES: Final = 10
# Who carries an order out and does not come to its end in so many times its time never will.
STUCK_TIMES: Final = 3
# A burst lasts for so many packets, not for so long: after that many attempts they follow each other without a pause.
URGENT_TRIES: Final = 6
# An answer is overdue after this part of the time that it may take.
OVERDUE: Final = 4
# A coordinator that begins anew is in haste until its first order after the muster is heard: how often it says the muster to
# all at once, and, where things get lost, an order to one at every tick.
MUSTER_COPIES: Final = 8
HASTE_COPIES: Final = 3


@dataclass
class _PendingRequest:
    """An order that is not answered yet."""

    said: Request
    ticks_max: int
    since: int  # the tick at which it was said first, or heard of first
    due: int
    tries: int = 0  # since anything was heard
    heard: bool = False
    cleared: bool = False
    ping: bool = False


class CommandMailbox:
    """Mail in and out, of a coordinator in its `life`. `survey_ticks` and `drive_ticks` are how long answers may take."""

    def __init__(self, dt_s: float, life: int = 1, survey_ticks: int = 80, drive_ticks: int = 300) -> None:
        self.now_s = 0.0
        self.patience = RetryPolicy()
        self.spoken: dict[int, int] = {}  # who has ever said anything, and its life
        self._life = life
        self._dt_s = dt_s
        self._ticks = survey_ticks, drive_ticks
        self._mail: list[Letter] = []
        self._outbox: list[Transmission] = []
        self._open: dict[int, _PendingRequest] = {}
        self._number: dict[int, int] = {}
        self._mustered: tuple[Request, int] | None = None
        self._hasty = False
        self._second_tick: int | None = None

    @property
    def tick(self) -> int:
        """The present tick."""
        return round(self.now_s / self._dt_s)

    # --- in ---------------------------------------------------------------------------------------------------------

    def take(self, now_s: float, inbox: Sequence[Packet]) -> None:
        """Take the mail of this moment, and give up who is silent for too long."""
        self.now_s = now_s
        for packet in inbox:
            reply = read_reply(packet.payload)
            if reply is not None and packet.sender is not None:
                self._read(packet.sender, reply)
        for node, order in list(self._open.items()):
            if self._hopeless(order):
                del self._open[node]

    def _read(self, node: int, reply: Response) -> None:
        if isinstance(reply.answer, Emerged):
            before = self.spoken.get(node)
            if before != reply.life:
                self.spoken[node] = reply.life
                self._mail.append((node, reply.answer))
                if before is not None:  # it remembers no order
                    self._open.pop(node, None)
            return
        if reply.to_life != self._life:
            return
        if reply.number == 0:
            self.expect(node)
        order = self._open.get(node)
        if order is None or reply.number != order.said.number:
            return
        self.spoken[node] = reply.life
        self._hasty = self._hasty and reply.number == 0
        order.tries = 0
        self.patience.lossy = self.patience.lossy or reply.heard < reply.attempt
        if isinstance(reply.answer, Ack | Cleared):
            if not order.heard:
                order.heard, order.since = True, self.tick
            order.due = self.tick + (BUSY_TICKS if self.patience.lossy else order.ticks_max // OVERDUE)
            if isinstance(reply.answer, Cleared) and not order.cleared:
                order.cleared = True
                self._mail.append((node, reply.answer))
            return
        self.patience.note(reply.attempt, reply.heard)
        self._mail.append((node, reply.answer))
        del self._open[node]
        self._expect_seen(reply)

    def _hopeless(self, order: _PendingRequest) -> bool:
        """Tell whether no answer to an order will come."""
        waited = self.tick - order.since
        if order.ping:
            return waited >= order.ticks_max
        silent = sum(not each.heard and not each.ping for each in self._open.values())
        jammed = silent >= max(JAMMED_MIN, JAMMED_FRACTION * len(self.spoken))
        if order.heard and order.tries <= 2:
            return waited >= STUCK_TIMES * order.ticks_max
        return waited >= order.ticks_max * (JAMMED_TIMES if jammed else 1) and order.tries >= self.patience.tries_max

    # --- out --------------------------------------------------------------------------------------------------------

    def muster(self, order: RollCall, copies: int = 1) -> None:
        """Say to all who hear it, so often, that they shall answer, whoever they are."""
        self._mustered = self._call(Request(self._life, 0, 0, UNKNOWN, order), copies), self.tick
        self._hasty = copies > 1
        self._second_tick = self.tick + AGAIN_TICKS if self._hasty else None

    def _call(self, said: Request, copies: int) -> Request:
        """Say an order to all so often, and return how it was said last."""
        for _ in range(copies):
            said = _again(said)
            self._outbox.append(Transmission("uplink", write(said)))
        return said

    def _call_again(self) -> None:
        """Say the muster again if anything was lost and nobody had time to look: who missed it must begin to look soon.

        Where nothing is lost, who is expected has said by now at least that it has heard.
        """
        self._second_tick = None
        if self._mustered is None or not (self.patience.lossy or any(not each.heard for each in self._open.values())):
            return
        said, tick = self._mustered
        self._mustered = self._call(said, MUSTER_COPIES), tick
        for order in self._open.values():
            order.said = self._mustered[0]
            order.tries += MUSTER_COPIES
            order.due = max(order.due, self.tick + self.patience.again_ticks)

    def expect(self, node: int) -> None:
        """Wait for a node's answer to the muster."""
        if self._mustered is not None and node not in self._number:
            self._number[node] = 0
            said, tick = self._mustered
            due = tick + self.patience.again_ticks
            self._open[node] = _PendingRequest(said, self._ticks[0], tick, due, tries=said.attempt)

    def _expect_seen(self, reply: Response) -> None:
        """Wait for the answers to the muster of all whom somebody sees that has answered it: theirs should be here too."""
        if reply.number == 0 and isinstance(reply.answer, Report):
            self._second_tick = None
            for each in reply.answer.sightings or ():
                self.expect(each.node)
                order = self._open.get(each.node)
                if order is not None and order.said.number == 0 and self.patience.lossy:
                    order.due = min(order.due, self.tick)

    def say(self, node: int, order: Order, drive: bool = False, ping: bool = False) -> None:
        """Send an order, and say it again until it is answered; a `ping` is said once."""
        number = self._number[node] = self._number.get(node, 0) + 1
        self._mail = [each for each in self._mail if each[0] != node or isinstance(each[1], Emerged)]
        said = Request(self._life, number, 0, self.spoken.get(node, UNKNOWN), order)
        due = self.tick + self._again_ticks(self._ticks[drive])
        self._open[node] = _PendingRequest(said, self._ticks[drive], self.tick, due, ping=ping)
        self._utter(node, self._open[node])

    def waits_for(self, node: int) -> bool:
        """Tell whether an order of a node is not answered yet."""
        return node in self._open

    def close(self, node: int) -> None:
        """Say nothing more of the order that a node has."""
        self._open.pop(node, None)

    def sent(self) -> tuple[Transmission, ...]:
        """Return what was said since the last time, and what is to be said again."""
        if self._second_tick is not None and self.tick >= self._second_tick:
            self._call_again()
        for node, order in self._open.items():
            if self.tick >= order.due and not order.ping:
                self._utter(node, order)
                urgent = order.tries > URGENT_TRIES or self._copies > 1
                order.due = self.tick + (1 if urgent else self.patience.again_ticks)
        outbox, self._outbox = tuple(self._outbox), []
        return outbox

    def next_s(self) -> float | None:
        """Return when something is to be said again, or somebody to be given up."""
        due = [order.since + order.ticks_max if order.ping else order.due for order in self._open.values()]
        return min(due) * self._dt_s if due else None

    def _utter(self, node: int, order: _PendingRequest) -> None:
        """Say an order, as often as haste wants."""
        for _ in range(1 if order.ping else self._copies):
            order.said = _again(order.said)
            order.tries += 1
            self._outbox.append(Transmission("uplink", write(order.said), node))

    @property
    def _copies(self) -> int:
        """How many copies an order to one has."""
        return HASTE_COPIES if self._hasty and self.patience.lossy else 1

    def _again_ticks(self, ticks_max: int) -> int:
        """Return after how long an order is said again: if nothing ever got lost, only when its answer is overdue."""
        if self._copies > 1:
            return 1
        return self.patience.again_ticks if self.patience.lossy else ticks_max // OVERDUE

    # --- waiting ----------------------------------------------------------------------------------------------------

    def rest(self) -> list[Letter]:
        """Return the mail that nobody took, and throw it away."""
        mail, self._mail = self._mail, []
        return mail

    def answers(self, nodes: Collection[int], *kinds: type[Answer]) -> Story[dict[int, Answer]]:
        """Wait until each of `nodes` has given an answer of these kinds or was given up, and return the answers by node."""
        found: dict[int, Answer] = {}
        while True:
            rest: list[Letter] = []
            for node, answer in self._mail:
                if node in nodes and node not in found and isinstance(answer, kinds):
                    found[node] = answer
                else:
                    rest.append((node, answer))
            self._mail = rest
            if all(node in found or node not in self._open for node in nodes):
                return found
            yield Wake(on_packet=True)

    def first(self, wanted: Callable[[int, Answer], bool], node: int, ticks: int | None = None) -> Story[Letter | None]:
        """Wait for the first letter that is wanted, until the order of `node` is over, or so many ticks have passed."""
        until_s = None if ticks is None else self.now_s + ticks * self._dt_s
        while True:
            for number, each in enumerate(self._mail):
                if wanted(*each):
                    return self._mail.pop(number)
            if node not in self._open if until_s is None else self.now_s >= until_s - 1e-9:
                return None
            yield Wake(at_s=until_s, on_packet=True)

    def suspect(self) -> bool:
        """Take a silence for the first loss, and be more patient from now on; tell whether nothing had been lost before."""
        news = not self.patience.lossy
        self.patience.lossy = True
        return news

    def pause(self, ticks: int = 1) -> Story[None]:
        """Wait for so many ticks."""
        until_s = self.now_s + ticks * self._dt_s
        while self.now_s < until_s - 1e-9:
            yield Wake(at_s=until_s)


def _again(said: Request) -> Request:
    """Return an order as it is said the next time."""
    return Request(said.life, said.number, said.attempt + 1, said.to_life, said.order)


def together(stories: Sequence[Story[T]]) -> Story[list[T]]:
    """Tell stories at once, and return what each returned when all have ended."""
    ends: dict[int, T] = {}
    while True:
        wakes: list[Wake] = []
        for number, story in enumerate(stories):
            if number in ends:
                continue
            try:
                wakes.append(next(story))
            except StopIteration as end:
                ends[number] = end.value
        if not wakes:
            return [ends[number] for number in range(len(stories))]
        times = [wake.at_s for wake in wakes if wake.at_s is not None]
        yield Wake(at_s=min(times, default=None), on_packet=any(wake.on_packet for wake in wakes))
