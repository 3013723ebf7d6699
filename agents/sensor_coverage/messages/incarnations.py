"""Incarnations: they distinguish messages of a robot that lost its memory from those of its former incarnations.

Every message between neighbours is in an envelope (`peers.Envelope`) with the incarnation of its sender. So every
counter in a message is the pair (incarnation, count). `Incarnations` compares the incarnations when a packet arrives.
Then the protocol that the counter belongs to compares the counts. A message to one robot also names the incarnation
that it is meant for.

A number that third parties repeat has no envelope of its own. There are two: the number of a robot's drive, which its
neighbours name in their views, and the number of a push, which is the name of a slot. Such a number has the incarnation
in its upper bits. Numbers of a first incarnation are plain counts.
"""

from typing import Annotated, Final

from msgspec import Meta

COUNT_BITS: Final = 24
# Slots that restarted robots named themselves have this bit. Pushes never reach it.
ADOPTED: Final = 1 << 56
# Bits of a robot's id in the name of an adopted slot. The bits from RETURN_BIT to that of ADOPTED count returns.
NODE_BITS: Final = 20
RETURN_BIT: Final = 52
RETURNS_MAX: Final = 16
# Means that the sender does not know the receiver's incarnation, or that the message is for all receivers.
ANY: Final = 0

Incarnation = Annotated[int, Meta(ge=0, lt=2**32)]


def first_count(incarnation: int) -> int:
    """Return the count before the first of an incarnation: all counts of earlier incarnations are smaller or equal."""
    return (incarnation - 1) << COUNT_BITS


def adopted_slot(node: int, incarnation: int, returns: int = 0) -> int:
    """Return the name of the slot where a robot stands after its restart, or after it came back into sight for the
    n-th time. No push and no other robot has this name."""
    return ADOPTED | returns % RETURNS_MAX << RETURN_BIT | incarnation << NODE_BITS | node


class Incarnations:
    """The newest incarnation of each robot that a node has heard, and its `own`."""

    def __init__(self, own: int) -> None:
        self.own = own
        self._newest: dict[int, int] = {}

    def of(self, node: int) -> int:
        """Return the newest known incarnation of a robot, or ANY."""
        return self._newest.get(node, ANY)

    def is_current(self, sender: int, incarnation: int, receiver: int) -> bool:
        """Return whether a message is from no former incarnation of its sender, and to none of this robot."""
        return incarnation >= self._newest.get(sender, ANY) and receiver in (ANY, self.own)

    def is_restart(self, sender: int, incarnation: int) -> bool:
        """Take in the incarnation of a current message; return whether this node received a former incarnation of its
        sender."""
        known = self._newest.get(sender, ANY)
        self._newest[sender] = incarnation
        return known not in (ANY, incarnation)
