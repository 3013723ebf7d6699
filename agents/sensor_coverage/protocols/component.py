"""The interface of every protocol between neighbours, and of the protocol with the coordinator.

A component does no input or output, reads no clock and starts no task. A robot delivers messages to its components,
polls them in order, sends their messages, and sleeps until the earliest of their wake-ups.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Protocol


class Outgoing(NamedTuple):
    """A message to one node, or to all that receive the channel if `to` is None."""

    to: int | None
    message: Any


class Component(Protocol):
    """One protocol of one robot. All methods do nothing unless a component overrides them.

    `channel` is the radio channel of the outgoing messages. `accepts` are the types of the messages that it receives.
    """

    channel: ClassVar[str] = ""
    accepts: ClassVar[tuple[type[Any], ...]] = ()

    def receive(self, sender: int, message: Any, tick: int) -> bool | None:
        """Take in a message of one of the accepted types; return False if it says nothing new."""
        return None

    def restarted(self, node: int, tick: int) -> None:
        """Forget the messages of a former incarnation of another robot: it has lost its memory. Its first message follows."""
        return

    def is_idle(self, tick: int) -> bool:
        """Return whether `poll` has nothing to do before the latest `next_wake`, unless a message says something new."""
        return True

    def poll(self, tick: int) -> None:
        """Act on the state of this tick, after all messages have been received and the drive has gone on."""
        return

    def outgoing(self) -> Sequence[Outgoing]:
        """Return the messages to send in this tick, after all components have been polled; each is returned once."""
        return ()

    def next_wake(self) -> int | None:
        """Return the latest tick at which the robot must be awake, or None if only an event matters."""
        return None
