"""One scan of the swarm, and one planned deployment."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from zwerm.maths.simplicial import FlagComplex

# Fourth element of the keys of plans to follow a wall, plus the direction in degrees.
WALLS: Final = 1000


class ScanResult(NamedTuple):
    """The views of all slots, their Rips complex (algorithm 2), and the slots of the base stations.

    `views` has the bearing [rad] of each visible slot, by the slot that sees it.
    """

    views: Mapping[int, Mapping[int, float]]
    complex_: FlagComplex
    bases: tuple[int, ...]


class Plan(NamedTuple):
    """One deployment: the robot at `mover` drives along `direction` [rad], and the robots on the path follow.

    `key` names what is expanded: one side of an edge, or a gap around one slot. The new robot measures its distance to
    the robots at the `anchors`. `path` leads from a source to the mover, once a path is assigned. With `walk` the robot
    drives to a wall, `aside_rad` to the left of the direction, and follows it, with the wall at its `hand` (+1 left, -1 right).
    It begins past the edge of the open arc, `half_rad` beside where it drives. With `beside` it stays in sight of the mover's
    slot. It stops where it sees a slot of `meet`. With `waits` the robots behind it follow after those of all earlier
    plans of the cycle.
    """

    key: tuple[int, ...]
    mover: int
    direction: float
    hop_m: float
    clear_m: float
    anchors: tuple[int, ...]
    path: tuple[int, ...] = ()
    walk: bool = False
    hand: int = 1
    beside: bool = False
    meet: tuple[int, ...] = ()
    half_rad: float = 0.0
    aside_rad: float = 0.0
    waits: bool = False

    @property
    def aim(self) -> float:
        """The direction [rad] in which the robot drives to a wall."""
        return self.direction + self.aside_rad
