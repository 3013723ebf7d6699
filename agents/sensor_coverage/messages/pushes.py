"""Messages of a decentralised push, and the reliable segments that carry them.

Each message of a push goes to one neighbour as a `Segment`, which the neighbour acknowledges. Directions are in the
frame of the base.
"""

from msgspec import Struct


class _PushMessagePart(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A part of a message."""


class _PushMessage(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, which begins with its tag."""


class SlotVacated(_PushMessage, frozen=True, tag="vacated"):
    """To all: the leader of a push has left its slot for good. Receivers forward it `hops` times."""

    push: int
    hops: int


# --- bodies of segments ---------------------------------------------------------------------------------------------


class ReferenceBearing(_PushMessagePart, frozen=True):
    """The reference direction [rad] to another slot, the number of its readings, and the robot at that slot."""

    slot: int
    node: int
    direction_rad: float
    count: int


class SlotMemory(_PushMessagePart, frozen=True):
    """The memory of a slot, which the next occupant inherits.

    `claims` is the number of its newest claim. `obstructed` has (key of an attempt, dead robot whose body stopped it).
    """

    slot: int
    references: tuple[ReferenceBearing, ...]
    walls: tuple[float, ...]
    closed: tuple[tuple[int, ...], ...]
    failed: tuple[tuple[int, ...], ...]
    attempts: tuple[tuple[tuple[int, ...], int], ...]
    blocked: tuple[float, ...]
    claims: int = 0
    obstructed: tuple[tuple[tuple[int, ...], int], ...] = ()


# The robots of a push, rear to front, each as (slot before the push, robot).
Chain = tuple[tuple[int, int], ...]


class PushToken(_PushMessage, frozen=True, tag="token"):
    """A push searches its leader: forward along the path vectors, first to `via`. `fresh` is the new slot."""

    push: int
    fresh: int
    chain: Chain
    via: int


class LeaderReady(_PushMessage, frozen=True, tag="ready"):
    """The leader to its follower: this will be your slot once I am gone. The leader stands there since drive `epoch`."""

    push: int
    chain: Chain
    memory: SlotMemory
    epoch: int


class TakeSlot(_PushMessage, frozen=True, tag="take-slot"):
    """To the follower: take my slot, because I leave it now."""

    push: int
    chain: Chain
    memory: SlotMemory


class PushAborted(_PushMessage, frozen=True, tag="aborted"):
    """The push has ended and no robot has moved. `tried`: its leader tried to drive."""

    push: int
    tried: bool


class AllStanding(_PushMessage, frozen=True, tag="all-standing"):
    """All robots ahead of the receiver stand still."""

    push: int


class AllSettled(_PushMessage, frozen=True, tag="all-settled"):
    """All robots behind the receiver have reached their slots."""

    push: int


class PushDone(_PushMessage, frozen=True, tag="done"):
    """The push has ended, and one more robot has left the base."""

    push: int


class RedundantOffer(_PushMessage, frozen=True, tag="offer"):
    """To the base, hop by hop: a robot has left the first of `slots`, and can be called. `slots` lead back to it."""

    push: int
    slots: tuple[int, ...]


class RedundantCall(_PushMessage, frozen=True, tag="call"):
    """From the base, hop by hop: the robot that has left the first of `slots` must be the rear of a push."""

    push: int
    slots: tuple[int, ...]


class RedundantPushEnd(_PushMessage, frozen=True, tag="end"):
    """To the base, hop by hop: the push of a called robot has ended. `tried`: its leader tried. `done`: it succeeded."""

    push: int
    tried: bool
    done: bool


RelayedMessage = RedundantOffer | RedundantCall | RedundantPushEnd
PushMessage = LeaderReady | TakeSlot | PushAborted | AllStanding | AllSettled | PushDone
Body = PushToken | PushMessage | RelayedMessage


class Segment(_PushMessage, frozen=True, tag="segment"):
    """The `number`-th segment from its sender to its receiver."""

    number: int
    body: Body


class SegmentAck(_PushMessage, frozen=True, tag="segment-ack"):
    """The segment of this number has arrived."""

    number: int
