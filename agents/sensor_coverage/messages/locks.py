"""Messages with which neighbours agree that one of them leaves the complex."""

from typing import Annotated

from msgspec import Meta, Struct

Count = Annotated[int, Meta(ge=0, le=2**62)]


class _LockMessage(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, which begins with its tag."""


class NeighbourList(_LockMessage, frozen=True, tag="neighbours"):
    """The robots that the sender sees, ascending; another list always has another version.

    `released` is the number of the latest `LockRelease`, in case that message was lost.
    """

    version: Count
    listed: tuple[Count, ...]
    released: Count = 0


class LockRequest(_LockMessage, frozen=True, tag="lock-request"):
    """To all neighbours: the sender wants to leave, and relies on these (neighbour, version of its list)."""

    number: Count
    versions: tuple[tuple[Count, Count], ...]


class LockGrant(_LockMessage, frozen=True, tag="grant"):
    """The sender will stand still for the requester."""

    number: Count


class LockDenial(_LockMessage, frozen=True, tag="deny"):
    """The sender will not stand still for the requester."""

    number: Count


class LockRelease(_LockMessage, frozen=True, tag="lock-release"):
    """To all neighbours: the sender has left, or will never leave by this or an earlier request."""

    number: Count


class ListRequest(_LockMessage, frozen=True, tag="list-request"):
    """A request that these robots send their neighbour lists to the sender."""

    nodes: tuple[int, ...]


LockProtocolMessage = NeighbourList | LockRequest | LockGrant | LockDenial | LockRelease
