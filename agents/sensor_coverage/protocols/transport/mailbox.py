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
        self._bodies = 0  # in all queues
        self._received: dict[int, int] = {}
        self._tick = 0

    @property
    def empty(self) -> bool:
        """True if every body was acknowledged or given up."""
        return not self._bodies

    def write(self, to: int, body: Body) -> None:
        """Send a body to a robot, after all earlier bodies to it."""
        self._queues.setdefault(to, _Queue()).bodies.append(body)
        self._bodies += 1

    def drop(self, push: int) -> None:
        """Send no more bodies of a push."""
        for queue in self._queues.values():
            kept = [each for each in queue.bodies if each.push != push]
            if len(kept) < len(queue.bodies):
                if queue.tries and queue.bodies[0].push == push:
                    queue.tries = 0
                self._bodies -= len(queue.bodies) - len(kept)
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
            self.sent.append((sender, self._take(queue)))

    def restarted(self, node: int, tick: int) -> None:
        """Give up what was to be sent to a former incarnation, and number segments of the new one from the start."""
        queue = self._queues.pop(node, None)
        if queue is not None:
            self._bodies -= len(queue.bodies)
            self.lost += [(node, body) for body in queue.bodies]
        self._received.pop(node, None)

    def is_idle(self, tick: int) -> bool:
        """Return whether no acknowledgement, and no body that was given up, waits for its sender."""
        return not (self.sent or self.lost)

    def poll(self, tick: int) -> None:
        """Set the time of this tick."""
        self._tick = tick

    def outgoing(self) -> list[Outgoing]:
        """Return the segments to send now; give up bodies that were sent TRIES_MAX times."""
        found: list[Outgoing] = []
        if not self._bodies:
            return found
        for to, queue in self._queues.items():
            if not queue.bodies:
                continue
            if queue.tries >= TRIES_MAX and self._tick >= queue.due:
                self.lost.append((to, self._take(queue)))
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
        if not self._bodies:
            return None
        waiting = [queue.due if queue.tries else 0 for queue in self._queues.values() if queue.bodies]
        return min(waiting, default=None)

    def _take(self, queue: _Queue) -> Body:
        """Take the body in flight out of its queue."""
        queue.tries = 0
        self._bodies -= 1
        return queue.bodies.popleft()
