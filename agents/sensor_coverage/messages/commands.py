"""What robots, base and coordinator say to each other to deploy a swarm by pushing: all of it crosses the radio.

Directions are bearings in the frame of the robot that is spoken to, or that speaks; the coordinator translates. No message
tells a position, and no distance but those that a robot drove by its own odometry.

The uplink may lose, repeat, delay and damage. So an order comes as a `Request` with a number of its own, again and again until
it is answered, and an answer as a `Response` to that number; both under a checksum. Who begins anew has a new life.
"""

from collections.abc import Callable
from typing import Final

from msgspec import Struct

from zwerm.wire.checksum import Sealed


class _Part(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A part of a message that comes in numbers."""


class _Message(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, led by its name."""


class Sighting(_Part, frozen=True):
    """A robot seen, and its bearing, averaged while nothing moved."""

    node: int
    bearing_rad: float


class Landmark(_Part, frozen=True):
    """Where a robot shall be seen from the place to go to. `still`: it does not move meanwhile."""

    node: int
    bearing_rad: float
    still: bool


# --- to a robot -----------------------------------------------------------------------------------------------------


class RollCall(_Message, frozen=True, tag="muster"):
    """To all: stand still, look around anew, and say what you see and touch."""

    cycle: int


class ScanRequest(_Message, frozen=True, tag="survey"):
    """Say what you see and touch. These robots have moved since the last survey."""

    cycle: int
    moved: tuple[int, ...]


class NegotiateLeave(_Message, frozen=True, tag="confer"):
    """To a robot that is not on the fence: leave the complex, if your neighbours agree, and report."""

    cycle: int


class Release(_Message, frozen=True, tag="release"):
    """To the base: let a robot out."""

    cycle: int


class Deploy(_Message, frozen=True, tag="deploy"):
    """Drive into the unknown along a bearing.

    If a wall stops it before `clear_m`, the robot drives back; else it goes on to `hop_m`.
    """

    cycle: int
    bearing_rad: float
    hop_m: float
    clear_m: float


class Move(_Message, frozen=True, tag="move"):
    """Take the place about `hop_m` away along a bearing, from which the landmarks are seen as told."""

    cycle: int
    bearing_rad: float
    hop_m: float
    landmarks: tuple[Landmark, ...]


class Correct(_Message, frozen=True, tag="correct"):
    """Correct the scale: break and re-establish the visual link to each anchor, one after the other.

    `anchors` give the bearing at which each should about be.
    """

    cycle: int
    anchors: tuple[Sighting, ...]


# --- from a robot ---------------------------------------------------------------------------------------------------


class Report(_Message, frozen=True, tag="report"):
    """The answer to a survey or a muster.

    `sightings` None: nothing has changed. `touched` are bearings of walls touched. `home`: it still stands where it came out.
    """

    cycle: int
    sightings: tuple[Sighting, ...] | None
    touched: tuple[float, ...]
    home: bool = False


class LeftComplex(Report, frozen=True, tag="aside"):
    """The same from a robot that has left the complex by agreement with its neighbours, and stands there in body."""


class Released(_Message, frozen=True, tag="released"):
    """The base's answer to a release: the robot that came out, if one did."""

    robot: int | None


class Emerged(_Message, frozen=True, tag="emerged"):
    """A robot came out of the depot and sees this."""

    sightings: tuple[Sighting, ...]


class Cleared(_Message, frozen=True, tag="cleared"):
    """The robot that deploys has gone far enough to be replaced."""

    cycle: int


class Arrived(_Message, frozen=True, tag="arrived"):
    """The end of a drive.

    `ok` False: the robot is back where it was, or never got to its place. `loose`: bearings did not tell how far to go,
    odometry did. `leaned`: robots that were driving themselves had to serve as landmarks. `touched` are bearings of walls
    touched, `driven_m` is how far it came.
    """

    cycle: int
    ok: bool
    loose: bool
    leaned: bool
    driven_m: float
    touched: tuple[float, ...]


class Ack(_Message, frozen=True, tag="heard"):
    """The order has come, and is being carried out."""


Order = RollCall | ScanRequest | NegotiateLeave | Release | Deploy | Move | Correct
Answer = Report | LeftComplex | Released | Emerged | Cleared | Arrived | Ack

# --- how they cross the radio ---------------------------------------------------------------------------------------

# The life of whom nothing is known; and below this there are so many others.
UNKNOWN: Final = 0
LIVES: Final = 2**16


class Request(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """An order: the `number`-th to this robot in the coordinator's `life`, said for the `attempt`-th time.

    It is meant for the robot in its life `to_life`, or in any if that is unknown. Everyone's number 0 is the muster.
    """

    life: int
    number: int
    attempt: int
    to_life: int
    order: Order


class Response(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """An answer of a robot in its `life` to the order `number` of the coordinator in its life `to_life`.

    `heard` is how often the order was heard up to its attempt `attempt`. A robot that came out answers nobody: all are 0.
    """

    life: int
    to_life: int
    number: int
    attempt: int
    heard: int
    answer: Answer


_dispatches: Final = Sealed(Request)
_replies: Final = Sealed(Response)
write: Final[Callable[[Request | Response], bytes]] = _dispatches.write
read_dispatch: Final[Callable[[bytes], Request | None]] = _dispatches.read
read_reply: Final[Callable[[bytes], Response | None]] = _replies.read
