"""Messages between the coordinator and the robots and base stations, on the uplink.

Directions are bearings in the frame of the robot that receives or sends the message; the coordinator translates. No
message contains a position. The only distances are those that a robot drives by its own odometry.

The uplink may lose, repeat, delay and corrupt messages. So a command is a `Request` with a number, which is sent again
until it is answered. An answer is a `Response` to that number. Both have a checksum. A node that starts again has a new
random incarnation number.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from msgspec import Struct

from zwerm.wire.checksum import Sealed

UPLINK: Final = "uplink"

# Ends of drives to walls and along them. There is no wall; the way on is blocked; the drive has its full length; no
# robot further on is in sight; a robot to meet is in sight.
OPEN: Final = "open"
SHUT: Final = "shut"
STRETCH: Final = "stretch"
LOST: Final = "lost"
MET: Final = "met"


# An arc (start, width) [rad].
NearArcs = tuple[tuple[float, float], ...]


class NearWalls(NamedTuple):
    """The arcs around a slot in which its robot `followed` walls close to it, and those `past_ends` of them.

    A body does not pass beside the touched point at an end, but what is in sight there is not known: the wall may end.
    `begins` are the parts of `followed` beyond the touched point where the way along a wall begins.
    """

    followed: NearArcs = ()
    past_ends: NearArcs = ()
    begins: NearArcs = ()

    def turned(self, by: float) -> "NearWalls":
        """Return the same arcs turned by an angle [rad]."""
        return NearWalls(*(turned_arcs(each, by) for each in self))


def turned_arcs(arcs: NearArcs, by: float) -> NearArcs:
    """Return arcs turned by an angle [rad]."""
    return tuple((start + by, width) for start, width in arcs)


class _UplinkPart(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A part of a message."""


class _UplinkMessage(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, which begins with its tag."""


class Sighting(_UplinkPart, frozen=True):
    """A visible robot and its bearing [rad], averaged while nothing moved."""

    node: int
    bearing_rad: float


class Landmark(_UplinkPart, frozen=True):
    """The bearing [rad] of a robot as seen from the goal of a move. `still`: the robot does not move meanwhile."""

    node: int
    bearing_rad: float
    still: bool


class Waypoint(_UplinkPart, frozen=True):
    """A point of a walk along walls: the position [m] by odometry, and the bearings [rad] of what the robot sees and touches.

    `touched` are bearings of touched walls. `robots` are touched robots. `start_rad` is the bearing, by odometry, of the place
    where the robot stood before it drove to the wall, if that is close and in line of sight.
    """

    x_m: float
    y_m: float
    sightings: tuple[Sighting, ...]
    touched: tuple[float, ...]
    robots: tuple[int, ...]
    start_rad: float | None = None

    def sees(self, node: int) -> bool:
        """Return whether the walking robot sees another one."""
        return any(each.node == node for each in self.sightings)


# --- to a robot -----------------------------------------------------------------------------------------------------


class RollCall(_UplinkMessage, frozen=True, tag="roll-call"):
    """To all: stop, average bearings again, and report."""

    cycle: int


class ScanRequest(_UplinkMessage, frozen=True, tag="scan"):
    """Report visible robots and touched walls. The robots in `moved` have moved since the last scan."""

    cycle: int
    moved: tuple[int, ...]


class NegotiateLeave(_UplinkMessage, frozen=True, tag="negotiate-leave"):
    """Leave the complex if the neighbours agree, and report. Sent to robots that are not on the fence."""

    cycle: int


class Release(_UplinkMessage, frozen=True, tag="release"):
    """To a base station: release a robot from the depot."""

    cycle: int


class Deploy(_UplinkMessage, frozen=True, tag="deploy"):
    """Drive into unknown space along a bearing [rad], up to `hop_m`. Drive back if a wall stops the robot before `clear_m`."""

    cycle: int
    bearing_rad: float
    hop_m: float
    clear_m: float


class Move(_UplinkMessage, frozen=True, tag="move"):
    """Drive to the slot about `hop_m` away along a bearing [rad], from which the landmarks have the given bearings."""

    cycle: int
    bearing_rad: float
    hop_m: float
    landmarks: tuple[Landmark, ...]


class Correct(_UplinkMessage, frozen=True, tag="correct"):
    """Correct the scale: break and re-establish the visual link to each anchor in turn.

    `anchors` give the approximate bearing of each.
    """

    cycle: int
    anchors: tuple[Sighting, ...]


class ComeBack(_UplinkMessage, frozen=True, tag="come-back"):
    """Drive back on the way by which the robot came, until it sees a robot that is not one of `apart`."""

    cycle: int
    apart: tuple[int, ...]


class ToWall(_UplinkMessage, frozen=True, tag="to-wall"):
    """Drive along a bearing [rad] to a wall within `hop_m`, and along it until `clear_m` from the start.

    The robot returns if there is no such way. `hand` is +1 if the wall is on the left, else -1. Once clear, the robot goes on
    until it is past the direction `half_rad` beside the bearing, if that is not 0.
    """

    cycle: int
    bearing_rad: float
    hop_m: float
    clear_m: float
    hand: int
    half_rad: float


class Probe(_UplinkMessage, frozen=True, tag="probe"):
    """Drive along a bearing [rad] to a wall within `hop_m`, and along it past the direction `half_rad` beside it; return.

    `hand` is +1 if the wall is on the left, else -1.
    """

    cycle: int
    bearing_rad: float
    hop_m: float
    hand: int
    half_rad: float


class FollowWall(_UplinkMessage, frozen=True, tag="follow-wall"):
    """Follow the wall in touch for `length_m`, in sight of a robot of `keep`, or of any robot if `keep` is empty.

    Stop where a robot of `meet` is in sight, and one that is not of `meet`.
    """

    cycle: int
    length_m: float
    hand: int
    keep: tuple[int, ...]
    meet: tuple[int, ...]


class ToWallPastDead(ToWall, frozen=True, tag="to-wall-past-dead"):
    """The same drive to a wall. The robots in `dead` do not answer, and may be pushed."""

    dead: tuple[int, ...]


class FollowWallPastDead(FollowWall, frozen=True, tag="follow-wall-past-dead"):
    """The same drive along a wall. The robots in `dead` do not answer, and may be pushed."""

    dead: tuple[int, ...]


class ProbePastDead(Probe, frozen=True, tag="probe-past-dead"):
    """The same drive along a wall and back. The robots in `dead` do not answer, and may be pushed."""

    dead: tuple[int, ...]


# --- from a robot ---------------------------------------------------------------------------------------------------


class Report(_UplinkMessage, frozen=True, tag="report"):
    """The answer to a scan request or a roll call.

    `sightings` is None if nothing has changed. `touched` are bearings [rad] of touched walls, and `robots` are touched
    robots. `home`: the robot still stands where it came out of the depot. `pushed` is the way (x, y) [m], in its own frame, by
    which others have pushed it away for good since its latest report.
    """

    cycle: int
    sightings: tuple[Sighting, ...] | None
    touched: tuple[float, ...]
    home: bool = False
    robots: tuple[int, ...] = ()
    pushed: tuple[float, float] = (0.0, 0.0)


class LeftComplex(Report, frozen=True, tag="left-complex"):
    """The same report from a robot that has left the complex by agreement, and whose body still stands there."""


class Released(_UplinkMessage, frozen=True, tag="released"):
    """The base station's answer to a release: the robot that came out, or None."""

    robot: int | None


class Emerged(_UplinkMessage, frozen=True, tag="emerged"):
    """The robot has come out of the depot and sees these robots."""

    sightings: tuple[Sighting, ...]


class Cleared(_UplinkMessage, frozen=True, tag="cleared"):
    """The deploying robot has driven far enough for its follower to take its slot."""

    cycle: int


class Arrived(_UplinkMessage, frozen=True, tag="arrived"):
    """The end of a drive.

    With `ok` False the robot is back at its start, or did not reach its goal. `used_odometry`: bearings did not
    determine the distance. `used_moving_landmarks`: the landmarks that stood still did not determine the goal, but others
    were driving themselves. `touched` are bearings [rad] of touched walls. `way` is the way (x, y) [m] by odometry from the
    place where the robot stood before it was deployed or moved to another slot.
    """

    cycle: int
    ok: bool
    used_odometry: bool
    used_moving_landmarks: bool
    driven_m: float
    touched: tuple[float, ...]
    way: tuple[float, float] = (0.0, 0.0)


class Walked(_UplinkMessage, frozen=True, tag="walked"):
    """The end of a drive to a wall or along it, after `driven_m`; `end` is one of OPEN, SHUT, STRETCH, LOST and MET.

    (x, y) [m] is the way from the place where the robot stood before it drove to the wall, by odometry. `near` are
    the walls close to that place which the robot followed, `near_beside` has their arcs for a robot that stands a little beside
    that place, and `radius_m` is that of its body.
    """

    cycle: int
    end: str
    x_m: float
    y_m: float
    driven_m: float
    waypoints: tuple[Waypoint, ...]
    near: NearWalls = NearWalls()
    radius_m: float = 0.0
    start: tuple[float, float] = (0.0, 0.0)
    near_beside: NearArcs = ()


class Ack(_UplinkMessage, frozen=True, tag="ack"):
    """The command has arrived and is being carried out."""


RobotCommand = (
    RollCall
    | ScanRequest
    | NegotiateLeave
    | Release
    | Deploy
    | Move
    | Correct
    | ComeBack
    | ToWall
    | Probe
    | FollowWall
    | ToWallPastDead
    | FollowWallPastDead
    | ProbePastDead
)
Answer = Report | LeftComplex | Released | Emerged | Cleared | Arrived | Walked | Ack

# --- how they cross the radio ---------------------------------------------------------------------------------------

# Incarnation number of a node of which nothing is known, and the bound of all others.
UNKNOWN: Final = 0
INCARNATIONS: Final = 2**16


class Request(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A command: the `number`-th to this robot from this `incarnation` of the coordinator, sent for the `attempt`-th time.

    It is for the incarnation `to_incarnation` of the robot, or for any if that is UNKNOWN. Number 0 is the roll call.
    """

    incarnation: int
    number: int
    attempt: int
    to_incarnation: int
    command: RobotCommand


class Response(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """An answer of an `incarnation` of a robot to the request `number` of the incarnation `to_incarnation` of the coordinator.

    `heard` counts the copies of the request that arrived, up to its attempt `attempt`. A robot that has come out of the
    depot answers no request, and all these numbers are 0.
    """

    incarnation: int
    to_incarnation: int
    number: int
    attempt: int
    heard: int
    answer: Answer


_requests: Final = Sealed(Request)
_responses: Final = Sealed(Response)
write: Final[Callable[[Request | Response], bytes]] = _requests.write
read_request: Final[Callable[[bytes], Request | None]] = _requests.read
read_response: Final[Callable[[bytes], Response | None]] = _responses.read
