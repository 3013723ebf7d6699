"""What robots say to each other when nobody is in charge: all of it crosses the robots' radio, under a checksum.

`StateBeacon` is broadcast when it changes, and now and then; letters go to one neighbour and are acknowledged. Directions are
told in one frame, which every robot knows by its heading; no message tells a position.
"""

from collections.abc import Callable
from typing import Final

from msgspec import Struct

from zwerm.agents.sensor_coverage.protocols import leave_lock as redundancy
from zwerm.agents.sensor_coverage.protocols.census import CensusTally, CensusWave
from zwerm.wire.checksum import Sealed

CHANNEL: Final = "robots"
NOWHERE: Final = -1
FAR: Final = 1000


class _Part(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A part of a message that comes in numbers."""


class _Message(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, led by its tag."""


# --- to all who hear it ---------------------------------------------------------------------------------------------


class SeenRobot(_Part, frozen=True):
    """A robot seen since it last moved, for the `epoch`-th time, the place that it holds, and its direction."""

    node: int
    epoch: int
    place: int
    direction_rad: float


class Attempt(_Part, frozen=True):
    """What the sender tried at one side of the edge between its place and another."""

    other: int
    sign: int
    attempts: int
    failed: bool
    closed: bool


class Route(_Part, frozen=True):
    """The way to the nearest robot at the frontier: what it costs, and the places on it, the sender's first.

    `since`: the tick from which on the last place is at the frontier.
    """

    cost: float
    places: tuple[int, ...]
    since: int = 0


class PathVector(_Message, frozen=True, tag="w"):
    """The way from a place, by who stands there; `number` counts what the sender says of ways.

    `ended`: places, the newest last, that are not at the frontier any more as they were at a tick. `home` is how many hops it
    is to the base (FAR: not known).
    """

    number: int
    place: int
    route: Route | None
    ended: tuple[tuple[int, int], ...] = ()
    home: int = FAR


# What was said of ways before anything was.
UNSAID: Final = PathVector(0, NOWHERE, None)


class StateBeacon(_Message, frozen=True, tag="s"):
    """All that neighbours need to know of a robot.

    `number` counts its states, `epoch` its drives, `samples` how often it has looked around. `could` are the sides, as
    (other place, sign), that it could expand. `waiting`: it stands at the base, ready to go. `spare`: it has left the
    complex, and stands at its place no more but in body.
    """

    number: int
    place: int
    epoch: int
    moving: bool
    waiting: bool
    samples: int
    seen: tuple[SeenRobot, ...]
    tries: tuple[Attempt, ...]
    could: tuple[tuple[int, int], ...]
    way: PathVector
    spare: bool = False


class StateRequest(_Message, frozen=True, tag="a"):
    """These robots shall tell their state again."""

    nodes: tuple[int, ...]


class ListRequest(_Message, frozen=True, tag="q"):
    """These robots shall tell the sender whom they see, as an agreement needs it."""

    nodes: tuple[int, ...]


class SlotVacated(_Message, frozen=True, tag="g"):
    """The leader of a push has left its place for good. Told on `hops` times."""

    push: int
    hops: int


# --- letters --------------------------------------------------------------------------------------------------------


class ReferenceBearing(_Part, frozen=True):
    """The direction in which another place is remembered, from how many looks, and who is there."""

    place: int
    node: int
    direction_rad: float
    count: int


class SlotMemory(_Part, frozen=True):
    """What is remembered of a place, whoever stands there."""

    place: int
    references: tuple[ReferenceBearing, ...]
    walls: tuple[float, ...]
    closed: tuple[tuple[int, ...], ...]
    failed: tuple[tuple[int, ...], ...]
    attempts: tuple[tuple[tuple[int, ...], int], ...]
    blocked: tuple[float, ...]


# The robots of a push, rear to front, each with the place it stands at before.
Chain = tuple[tuple[int, int], ...]


class PushToken(_Message, frozen=True, tag="T"):
    """A push looks for its leader: go on along the gradient, `via` somebody first. `fresh` is the new place."""

    push: int
    fresh: int
    chain: Chain
    via: int


class LeaderReady(_Message, frozen=True, tag="R"):
    """The leader to who follows it: this will be your place, once I am gone. It stands here since its drive `epoch`."""

    push: int
    chain: Chain
    memory: SlotMemory
    epoch: int


class TakeSlot(_Message, frozen=True, tag="K"):
    """Take my place: I go now."""

    push: int
    chain: Chain
    memory: SlotMemory


class PushAborted(_Message, frozen=True, tag="A"):
    """The push is over and nobody has moved. `tried`: its leader did try."""

    push: int
    tried: bool


class AllStanding(_Message, frozen=True, tag="S"):
    """All ahead of you stand."""

    push: int


class AllSettled(_Message, frozen=True, tag="P"):
    """All behind you have found their places."""

    push: int


class PushDone(_Message, frozen=True, tag="D"):
    """The push is over, and has brought a robot out."""

    push: int


class RedundantOffer(_Message, frozen=True, tag="O"):
    """To the base, hop by hop: a robot has left the place that comes first, and can be called. The places are the way back."""

    push: int
    places: tuple[int, ...]


class RedundantCall(_Message, frozen=True, tag="C"):
    """From the base, hop by hop: the robot that has left the place that comes first shall be the rear of a push."""

    push: int
    places: tuple[int, ...]


class RedundantPushEnd(_Message, frozen=True, tag="E"):
    """To the base, hop by hop: a push from a robot that was called is over. `tried`: its leader did try; `done`: it is out."""

    push: int
    tried: bool
    done: bool


Errand = RedundantOffer | RedundantCall | RedundantPushEnd
Body = PushToken | LeaderReady | TakeSlot | PushAborted | AllStanding | AllSettled | PushDone | Errand


class Segment(_Message, frozen=True, tag="l"):
    """The `number`-th letter from its sender to its receiver."""

    number: int
    body: Body


class SegmentAck(_Message, frozen=True, tag="r"):
    """The letter of this number has come."""

    number: int


Word = (
    CensusWave
    | CensusTally
    | StateBeacon
    | PathVector
    | StateRequest
    | ListRequest
    | SlotVacated
    | Segment
    | SegmentAck
    | redundancy.Message
)

_sealed: Final = Sealed(Word)
write: Final[Callable[[Word], bytes]] = _sealed.write
read: Final[Callable[[bytes], Word | None]] = _sealed.read
