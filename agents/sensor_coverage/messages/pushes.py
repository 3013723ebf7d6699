"""Messages of a decentralised push, and the reliable segments that carry them.

Each message of a push goes to one neighbour as a `Segment`, which the neighbour acknowledges. Directions are in the
frame of the base.
"""

from typing import NamedTuple

from msgspec import Struct


class WalkTriangle(NamedTuple):
    """A triangle of two slots and a point of a walk, for one of the slots; the other one is `beside`.

    The point is on one `side` of the direction to that slot, +1 left, -1 right. `there_rad` is the angle at that slot. The
    point has a `number` in a `walk`, and is on the `stretch` of wall with this number of its first point, -1 on none, with the
    wall at the `hand`, +1 left, -1 right.
    """

    beside: int
    side: int
    there_rad: float
    walk: int
    stretch: int
    number: int
    hand: int


class ProvedArc(NamedTuple):
    """An arc that a walk closed: the slots `needed` must stand, and the slots `seen` saw the walk there.

    It ends at a followed wall, or is the angle of a `triangle`.
    """

    needed: tuple[int, ...]
    seen: tuple[int, ...]
    start_rad: float
    width_rad: float
    triangle: WalkTriangle | None = None


# A direction [rad] in which a slot lost sight of a walk, or saw it first, the slots that saw it beyond, and those that saw it
# there: an edge of sight.
LostSight = tuple[float, tuple[int, ...], tuple[int, ...]]


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
    `explored` are directions [rad] of attempts to follow a wall, and `probed` those of probes of walls close by.
    `proved` has the arcs that walks closed. `distances_m` has (neighbouring slot, distance [m]) where a walk measured it.
    `edges` has the edges of sight. `ways` has (slot, x, y): the way [m] in the base's frame by which a robot came from there.
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
    explored: tuple[float, ...] = ()
    proved: tuple[ProvedArc, ...] = ()
    distances_m: tuple[tuple[int, float], ...] = ()
    probed: tuple[float, ...] = ()
    edges: tuple[LostSight, ...] = ()
    ways: tuple[tuple[int, float, float], ...] = ()


# The robots of a push, rear to front, each as (slot before the push, robot).
Chain = tuple[tuple[int, int], ...]


class PushToken(_PushMessage, frozen=True, tag="token"):
    """A push searches its leader: forward along the path vectors, first to `via`. `fresh` is the new slot.

    With `wall_rad` the receiver leads from the base's point, into an open arc of the base in this direction, and follows
    the wall there with its `hand`.
    """

    push: int
    fresh: int
    chain: Chain
    via: int
    wall_rad: float | None = None
    hand: int = 1


class LeaderReady(_PushMessage, frozen=True, tag="ready"):
    """The leader to its follower: this will be your slot once I am gone. The leader stands there since drive `epoch`.

    `walk`: the leader follows a wall once the others stand. If a wall stops the leader, it is back `back_ticks` after it got
    out of sight; 0: it does not know when.
    """

    push: int
    chain: Chain
    memory: SlotMemory
    epoch: int
    walk: bool = False
    back_ticks: int = 0


class TakeSlot(_PushMessage, frozen=True, tag="take-slot"):
    """To the follower: take my slot, because I leave it now. `walk`: the leader follows a wall once the others stand."""

    push: int
    chain: Chain
    memory: SlotMemory
    walk: bool = False


class PushAborted(_PushMessage, frozen=True, tag="aborted"):
    """The push has ended and no robot has moved. `tried`: its leader tried to drive.

    `near` and `past_ends` have the arcs (start, width) [rad] of walls close to the base's point that the leader followed
    (`commands.NearWalls`).
    """

    push: int
    tried: bool
    near: tuple[tuple[float, float], ...] = ()
    past_ends: tuple[tuple[float, float], ...] = ()


class AllStanding(_PushMessage, frozen=True, tag="all-standing"):
    """All robots ahead of the receiver stand still.

    From the leader to its follower, or from the base's point to the base, `near` and `past_ends` have the
    arcs (start, width) [rad] of walls close to the slot that the leader has left, which it followed (`commands.NearWalls`).
    """

    push: int
    near: tuple[tuple[float, float], ...] = ()
    past_ends: tuple[tuple[float, float], ...] = ()


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
