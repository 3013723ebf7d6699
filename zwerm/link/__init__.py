"""Links carry bytes between the world and its nodes: in memory within one process, or over Zenoh between processes.

A link knows nothing of what the bytes mean and makes no promise on order between nodes; from one node, messages arrive
in the order they were sent, each exactly once, until the node is lost.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final, NamedTuple, Protocol


class Arrival(NamedTuple):
    """A message from a node; `payload` None says that the node is lost: its process ended without a word."""

    node: int
    payload: bytes | None


# An Arrival of a pair, without the call of a Python function that its own constructor is.
arrival: Final[Callable[[Iterable[Any]], Arrival]] = partial(tuple.__new__, Arrival)


class WorldLink(Protocol):
    """The world's end of the link to all nodes."""

    def send(self, node: int, payload: bytes) -> None:
        """Send one message to a node that has joined."""

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout_s` seconds without one."""

    def receive_many(self, count: int, timeout_s: float) -> list[Arrival]:
        """Return all that has arrived, as soon as there are `count`, or a loss, or after `timeout_s` seconds."""

    def close(self) -> None:
        """Release all that the link holds; idempotent."""


class NodeProcesses(Protocol):
    """Whoever runs the nodes' programs, and can do to them what faults demand."""

    def kill(self, node: int) -> None:
        """End a node's program without a word; the link then reports the node lost."""

    def start(self, node: int) -> None:
        """Start a node's program, its next incarnation if it ran before; return when it has joined."""

    def pause(self, node: int) -> None:
        """Stop a node's program where it is."""

    def resume(self, node: int) -> None:
        """Let it go on."""


Answer = Callable[[bytes], bytes]
