"""Reliable messages to one neighbour: stop and wait, with repetition until a segment is acknowledged.

A segment that is never acknowledged is given up after a while. It may have been received all the same, so a sender must
be able to live with either.
"""

from collections import deque
from typing import ClassVar, Final

from zwerm.agents.sensor_coverage.messages.peers import CHANNEL
from zwerm.agents.sensor_coverage.messages.pushes import Body, Segment, SegmentAck
from zwerm.agents.sensor_coverage.protocols.component import Component, Outgoing

RETRY_TICKS: Final = 2
# Attempts before a segment is given up. Long bursts lose about 16 packets, so this outlasts nearly all of them.
TRIES_MAX: Final = 160


class _Queue:
    """The bodies that one robot has not acknowledged, and the segment in flight."""

    def __init__(self) -> None:
        self.bodies: deque[Body] = deque()
        self.number = 0
        self.tries = 0
        self.due = 0


class ReliableMailbox(Component):
    """One robot's segments. `sent` and `lost` have the bodies that were acknowledged or given up, with their receivers."""

    channel: ClassVar[str] = CHANNEL
    accepts: ClassVar[tuple[type, ...]] = (SegmentAck,)

    def __init__(self) -> None:
        self.sent: list[tuple[int, Body]] = []
        self.lost: list[tuple[int, Body]] = []
        self._queues: dict[int, _Queue] = {}
        self._received: dict[int, int] = {}
        self._tick = 0

    @property
    def empty(self) -> bool:
        """True if every body was acknowledged or given up."""
        for queue in self._queues.values():  # noqa: SIM110 (asked at every step: a generator takes twice as long)
            if queue.bodies:
                return False
        return True

    def write(self, to: int, body: Body) -> None:
        """Send a body to a robot, after all earlier bodies to it."""
        self._queues.setdefault(to, _Queue()).bodies.append(body)

    def drop(self, push: int) -> None:
        """Send no more bodies of a push."""
        for queue in self._queues.values():
            kept = [each for each in queue.bodies if each.push != push]
            if len(kept) < len(queue.bodies):
                if queue.tries and queue.bodies[0].push == push:
                    queue.tries = 0
                queue.bodies = deque(kept)

    def accept(self, sender: int, segment: Segment) -> Body | None:
        """Return the body of a segment if it is new; the caller acknowledges the segment in any case."""
        if segment.number <= self._received.get(sender, 0):
            return None
        self._received[sender] = segment.number
        return segment.body

    def receive(self, sender: int, message: SegmentAck, tick: int) -> None:
        """Take in an acknowledgement."""
        queue = self._queues.get(sender)
        if queue is not None and queue.tries and message.number == queue.number:
            self.sent.append((sender, queue.bodies.popleft()))
            queue.tries = 0

    def restarted(self, node: int, tick: int) -> None:
        """Give up what was to be sent to a former incarnation, and number segments of the new one from the start."""
        queue = self._queues.pop(node, None)
        self.lost += [(node, body) for body in queue.bodies] if queue is not None else []
        self._received.pop(node, None)

    def poll(self, tick: int) -> None:
        """Set the time of this tick."""
        self._tick = tick

    def outgoing(self) -> list[Outgoing]:
        """Return the segments to send now; give up bodies that were sent TRIES_MAX times."""
        found: list[Outgoing] = []
        for to, queue in self._queues.items():
            if not queue.bodies:
                continue
            if queue.tries >= TRIES_MAX and self._tick >= queue.due:
                self.lost.append((to, queue.bodies.popleft()))
                queue.tries = 0
            if not queue.bodies or (queue.tries and self._tick < queue.due):
                continue
            if not queue.tries:
                queue.number += 1
            queue.tries += 1
            queue.due = self._tick + RETRY_TICKS
            found.append(Outgoing(to, Segment(queue.number, queue.bodies[0])))
        return found

    def next_wake(self) -> int | None:
        """Return the tick of the next repetition."""
        waiting = [queue.due if queue.tries else 0 for queue in self._queues.values() if queue.bodies]
        return min(waiting, default=None)
