"""Links carry bytes between the world and its nodes: in memory within one process, or over Zenoh between processes.

A link does not interpret the bytes. Messages from one node arrive in the order in which they were sent, each exactly once,
until the node is lost. The order between nodes is undefined.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final, NamedTuple, Protocol


class Arrival(NamedTuple):
    """A message from a node. `payload` None reports the node lost: its process ended without a message."""

    node: int
    payload: bytes | None


# Makes an Arrival of a pair without the Python call that the constructor of a named tuple is.
arrival: Final[Callable[[Iterable[Any]], Arrival]] = partial(tuple.__new__, Arrival)


class WorldLink(Protocol):
    """The world's end of the link to all nodes."""

    def send(self, node: int, payload: bytes) -> None:
        """Send one message to a node that has joined."""

    def receive(self, timeout_s: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout_s` seconds without one."""

    def receive_many(self, count: int, timeout_s: float) -> list[Arrival]:
        """Return all arrivals, as soon as there are `count`, or a loss, or after `timeout_s` seconds."""

    def close(self) -> None:
        """Release all resources of the link; idempotent."""


class NodeProcesses(Protocol):
    """Runs the programs of the nodes, and kills, starts, pauses and resumes them for faults."""

    def kill(self, node: int) -> None:
        """End a node's program without a message; the link then reports the node lost."""

    def start(self, node: int) -> None:
        """Start a node's program, as its next incarnation if it ran before; return when it has joined."""

    def pause(self, node: int) -> None:
        """Stop a node's program; its memory stays."""

    def resume(self, node: int) -> None:
        """Continue a paused program."""


Answer = Callable[[bytes], bytes]
