"""The coordinator's post: orders out, answers in, and stories that wait for them.

A story is a generator that yields when it wants to go on: at the next packet, or at a time. Several may be told at once;
each takes from the mail what is its own.
"""

from collections.abc import Callable, Generator, Sequence
from typing import TypeVar

from zwerm.orders import Answer, Order, encode, read_answer
from zwerm.protocol import Packet, Transmission, Wake

T = TypeVar("T")
Story = Generator[Wake, None, T]
Letter = tuple[int, Answer]


class Post:
    """Mail in and out."""

    def __init__(self, dt_s: float) -> None:
        self.now_s = 0.0
        self._dt_s = dt_s
        self._mail: list[Letter] = []
        self._outbox: list[Transmission] = []

    def take(self, now_s: float, inbox: Sequence[Packet]) -> None:
        """Take the mail of this moment."""
        self.now_s = now_s
        for packet in inbox:
            answer = read_answer(packet.payload)
            if answer is not None and packet.sender is not None:
                self._mail.append((packet.sender, answer))

    def say(self, node: int, order: Order) -> None:
        """Send an order."""
        self._outbox.append(Transmission("uplink", encode(order), node))

    def sent(self) -> tuple[Transmission, ...]:
        """Return what was said since the last time."""
        outbox, self._outbox = tuple(self._outbox), []
        return outbox

    def rest(self) -> list[Letter]:
        """Return the mail that nobody took, and throw it away."""
        mail, self._mail = self._mail, []
        return mail

    def wait(self, wanted: Callable[[int, Answer], bool], count: int, ticks: int) -> Story[list[Letter]]:
        """Wait until `count` answers that are wanted have come, or so many ticks have passed, and return them."""
        until_s = self.now_s + ticks * self._dt_s
        found: list[Letter] = []
        while True:
            rest: list[Letter] = []
            for each in self._mail:
                (found if len(found) < count and wanted(*each) else rest).append(each)
            self._mail = rest
            if len(found) >= count or self.now_s >= until_s - 1e-9:
                return found
            yield Wake(at_s=until_s, on_packet=True)

    def pause(self) -> Story[None]:
        """Wait for a tick."""
        yield Wake(at_s=self.now_s + self._dt_s)


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
