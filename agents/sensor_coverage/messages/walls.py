"""Messages of a walk along a wall without a coordinator: between the walking robot and the robots that it passes.

Directions are in the frame of the base.
"""

from msgspec import Struct


class _WalkMessagePart(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A part of a message."""


class WallEnd(_WalkMessagePart, frozen=True):
    """An end of a stretch of wall: the walking robot's place [m], and the point of the wall that it touched.

    Places are by odometry, from any origin. `robots` were in touch, and robots that are `seen` were in sight.
    """

    at: tuple[float, float]
    touched: tuple[float, float]
    robots: tuple[int, ...]
    seen: tuple[int, ...]


class WallStretch(_WalkMessagePart, frozen=True):
    """A stretch of wall that was followed: the numbers of its first and last points, its ends, and a body's radius [m]."""

    first_number: int
    last_number: int
    first: WallEnd
    last: WallEnd
    radius_m: float


class _WalkMessage(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, which begins with its tag."""


class PassedPoint(_WalkMessage, frozen=True, tag="passed"):
    """To all: the `number`-th point of the walk of a push. The wall is at the `hand` (+1 left, -1 right).

    `seen` has (robot, direction [rad] from that robot to the point). `walls` are directions of touched walls, and
    `robots` touched robots. The walking robot follows the wall since the point with the number `touch_since`.
    `at` is its place [m], and `stretch` the latest stretch of wall. `hidden` has, for each robot that sees the walking robot
    again, the number of the last point that it saw before, and for the points between the robots that saw them. For a robot
    that sees it for the first time, it has 0, and the robots that saw the point before.
    """

    push: int
    number: int
    hand: int
    touch_since: int
    seen: tuple[tuple[int, float], ...]
    walls: tuple[float, ...]
    robots: tuple[int, ...]
    at: tuple[float, float]
    stretch: WallStretch | None
    hidden: tuple[tuple[int, int, tuple[tuple[int, ...], ...]], ...] = ()


class ArcClosed(_WalkMessage, frozen=True, tag="arc-closed"):
    """To the walking robot: a point of the walk has closed a part of an open arc around the sender."""

    push: int


class NeighbourProved(_WalkMessage, frozen=True, tag="neighbour-proved"):
    """To the robot at a slot: the sender has proved an arc there, by points of a walk that the receiver did not see.

    `arc` is a `ProvedArc`, as in the messages of pushes.
    """

    slot: int
    arc: tuple[tuple[int, ...], tuple[int, ...], float, float, tuple[int, int, float, int, int, int, int] | None]


class DeadInSight(_WalkMessage, frozen=True, tag="dead-in-sight"):
    """To the walking robot: it sees or touches these robots, and the sender has found that they are dead."""

    push: int
    robots: tuple[int, ...]


class WalkOver(_WalkMessage, frozen=True, tag="walk-over"):
    """To all, forwarded once by each robot: the walk of a push has ended.

    `stretches` are the stretches of wall that were followed. The walking robot stands at the slot
    `end`, where the last of them ends, or this is NOWHERE.
    """

    push: int
    end: int
    stretches: tuple[WallStretch, ...]


WalkMessage = PassedPoint | ArcClosed | NeighbourProved | DeadInSight | WalkOver
