"""Links carry bytes between the world and its nodes: in memory within one process, or over Zenoh between processes.

A link does not interpret the bytes. Messages of one node arrive in the order sent, each exactly once, until the node is lost.
The order of messages of different nodes is undefined.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, Final, NamedTuple, Protocol

from zwerm.wire.refusals import Refusals


class Arrival(NamedTuple):
    """A message from a node. `payload` None means that the node is lost: its process ended without a goodbye."""

    node: int
    payload: bytes | None


# Makes an Arrival from a pair. Faster than Arrival(...), whose constructor is a Python function.
arrival: Final[Callable[[Iterable[Any]], Arrival]] = partial(tuple.__new__, Arrival)


class WorldLink(Protocol):
    """The world's end of the link to all nodes. `refusals` counts the messages that the link refused."""

    refusals: Refusals

    def send(self, node: int, payload: bytes) -> None:
        """Send one message to a node that has joined."""

    def send_many(self, messages: Iterable[tuple[int, bytes]]) -> None:
        """Send messages to nodes that have joined, each as soon as `messages` yields it."""

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout_s` seconds without one."""

    def receive_many(self, count: int, timeout_s: float) -> Sequence[tuple[int, bytes | None]]:
        """Return all arrivals, as pairs, once there are `count`, or a node is lost, or `timeout_s` seconds have passed."""

    def idle(self, nodes: Sequence[int], timeout_s: float) -> list[int]:
        """Dismiss `nodes`, whose answers are missing, and return those that leave within `timeout_s` without an answer.

        Their programs are not busy: the observation or the answer was lost on the way.
        """

    def evict(self, node: int) -> None:
        """Drop all messages of a node from now on."""

    def close(self) -> None:
        """Release all resources of the link; idempotent."""


class NodeProcesses(Protocol):
    """Control of the nodes' processes, for faults."""

    def kill(self, node: int) -> None:
        """Kill a node's process; the link then reports the node lost."""

    def start(self, node: int) -> None:
        """Start a node's process, as its next incarnation if it ran before; return when it has joined."""

    def pause(self, node: int) -> None:
        """Pause a node's process."""

    def resume(self, node: int) -> None:
        """Resume a paused process."""

    def end_of(self, node: int, wait_s: float) -> str:
        """Return how a lost node's process ended, waiting for its end at most `wait_s`; "" where that is not known."""


Answer = Callable[[bytes], bytes]
