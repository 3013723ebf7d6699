"""Letters between neighbours: one at a time to each, sent again until it is acknowledged, and read once.

Stop and wait. A letter that is never acknowledged is given up after a while; it may have been read all the same, so whoever
writes one must be able to live with either.
"""

from collections import deque
from typing import Final

from zwerm.agents.sensor_coverage.messages.peers import Body, Segment, SegmentAck, Word

RETRY_TICKS: Final = 2
# Bursts last: about 16 packets where they are long, so this many tries outlast nearly all.
TRIES_MAX: Final = 160


class _Outbox:
    """What one robot has yet to be told."""

    def __init__(self) -> None:
        self.letters: deque[Body] = deque()
        self.number = 0
        self.tries = 0
        self.due = 0


class ReliableMailbox:
    """One robot's letters. `sent` and `lost` are what was acknowledged and what was given up, with whom it was for."""

    def __init__(self) -> None:
        self.sent: list[tuple[int, Body]] = []
        self.lost: list[tuple[int, Body]] = []
        self._boxes: dict[int, _Outbox] = {}
        self._read: dict[int, int] = {}

    def write(self, to: int, body: Body) -> None:
        """Have a letter sent."""
        self._boxes.setdefault(to, _Outbox()).letters.append(body)

    def take(self, sender: int, letter: Segment) -> tuple[SegmentAck, Body | None]:
        """Return the receipt for a letter, and what it says if it is new."""
        new = letter.number > self._read.get(sender, 0)
        if new:
            self._read[sender] = letter.number
        return SegmentAck(letter.number), letter.body if new else None

    def acknowledge(self, sender: int, receipt: SegmentAck) -> None:
        """Take in a receipt."""
        box = self._boxes.get(sender)
        if box is not None and box.tries and receipt.number == box.number:
            self.sent.append((sender, box.letters.popleft()))
            box.tries = 0

    def drop(self, push: int) -> None:
        """Send nothing more of a push."""
        for box in self._boxes.values():
            kept = [each for each in box.letters if each.push != push]
            if len(kept) < len(box.letters):
                if box.tries and box.letters[0].push == push:
                    box.tries = 0
                box.letters = deque(kept)

    def due(self, tick: int) -> list[tuple[int, Word]]:
        """Return what is to be sent now, with whom it is for; give up what was sent often enough."""
        found: list[tuple[int, Word]] = []
        for to, box in self._boxes.items():
            if box.letters and box.tries >= TRIES_MAX and tick >= box.due:
                self.lost.append((to, box.letters.popleft()))
                box.tries = 0
            if not box.letters or (box.tries and tick < box.due):
                continue
            if not box.tries:
                box.number += 1
            box.tries += 1
            box.due = tick + RETRY_TICKS
            found.append((to, Segment(box.number, box.letters[0])))
        return found

    def next_tick(self) -> int | None:
        """Return when something is to be sent again."""
        waiting = [box.due if box.tries else 0 for box in self._boxes.values() if box.letters]
        return min(waiting) if waiting else None
