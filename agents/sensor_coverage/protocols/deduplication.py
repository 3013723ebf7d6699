"""What a robot was ordered last and answered to it: an order that comes again is not carried out again, but answered again.

Orders are numbered, so one that was late, or comes twice, is known; a coordinator with another life counts anew, and is
obeyed. The more often an order was missed before it came, the more copies its answer is worth.
"""

from collections.abc import Iterable
from typing import Final

from zwerm.agents.sensor_coverage.messages.commands import (
    UNKNOWN,
    Ack,
    Answer,
    Emerged,
    Order,
    Request,
    Response,
    read_dispatch,
    write,
)

COPIES_MAX: Final = 4


class RequestDeduplicator:
    """The order that a robot in its `life` is at."""

    def __init__(self, life: int) -> None:
        self._life = life
        self._order: Request | None = None
        self._heard = 0
        self._answer: Answer | None = None
        self._emerged: Emerged | None = None
        self._again = False  # the order has come again
        self._mistaken = False  # an order has come for a robot that this one no longer is

    def take(self, payload: bytes) -> Order | None:
        """Return the order in a packet, if it is new and for this robot."""
        said = read_dispatch(payload)
        if said is None:
            return None
        if said.to_life not in (UNKNOWN, self._life):
            self._mistaken = True
            return None
        known = self._order
        if known is not None and known.life == said.life and known.number >= said.number:
            if known.number == said.number:
                self._again = True
                self._heard += 1
                self._order = max(known, said, key=lambda each: each.attempt)
            return None
        self._order, self._heard, self._answer, self._again = said, 1, None, False
        return said.order

    def say(self, answers: Iterable[Answer]) -> list[bytes]:
        """Return what to send now: these answers, or the last one again if it was asked for again."""
        news = list(answers)
        if self._mistaken and self._emerged is not None:
            news.insert(0, self._emerged)
        payloads: list[bytes] = []
        for answer in news:
            if isinstance(answer, Emerged):
                self._emerged, self._mistaken = answer, False
                payloads.append(write(Response(self._life, UNKNOWN, 0, 0, 0, answer)))
            else:
                self._answer, self._again = answer, False
                payloads += self._replies(answer)
        if self._again:
            self._again = False
            payloads += self._replies(self._answer or Ack())
        return payloads

    def _replies(self, answer: Answer) -> list[bytes]:
        order = self._order
        if order is None:
            return []
        missed = order.attempt - self._heard
        copies = 1 if isinstance(answer, Ack) else max(1, min(COPIES_MAX, 1 + missed))
        return [write(Response(self._life, order.life, order.number, order.attempt, self._heard, answer))] * copies
