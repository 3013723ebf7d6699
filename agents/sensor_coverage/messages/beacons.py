"""Broadcast messages between neighbours: the state of a robot, and its route to the frontier.

A robot broadcasts a `StateBeacon` when its state changes, and periodically. Directions are in the frame of the base,
which each robot knows by its heading. No message contains a position.
"""

from typing import Final

from msgspec import Struct

# Slot of a robot that occupies none.
NOWHERE: Final = -1
# This number of hops to the base means unknown.
FAR: Final = 1000


class _BeaconPart(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A part of a message."""


class _BeaconMessage(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A whole message, which begins with its tag."""


class SeenRobot(_BeaconPart, frozen=True):
    """A visible robot: the number of its latest drive, the slot that it holds, and its direction [rad]."""

    node: int
    epoch: int
    slot: int
    direction_rad: float


class Attempt(_BeaconPart, frozen=True):
    """The sender's attempts at one side of the edge between its slot and the slot `other`."""

    other: int
    sign: int
    attempts: int
    failed: bool
    closed: bool


class Route(_BeaconPart, frozen=True):
    """The route to the nearest frontier robot: its cost, and its slots, the sender's first.

    `claim` is the number of the claim of the last slot that it is at the frontier. Each slot counts its own claims.
    """

    cost: float
    slots: tuple[int, ...]
    claim: int = 0


class PathVector(_BeaconMessage, frozen=True, tag="path"):
    """The route from a slot, by the robot at the slot; `number` counts the sender's path vectors.

    `ended` has (slot, claim): this claim of the slot and all earlier ones have ended, the newest last. `home` is the
    number of hops to the base, or FAR if unknown, and `base_count` the base's count that came that way.
    """

    number: int
    slot: int
    route: Route | None
    ended: tuple[tuple[int, int], ...] = ()
    home: int = FAR
    base_count: int = 0


# The path vector of a robot that has sent none.
NO_PATH_VECTOR: Final = PathVector(0, NOWHERE, None)


class StateBeacon(_BeaconMessage, frozen=True, tag="state"):
    """The state of a robot, as its neighbours need it.

    `number` counts the sender's states, `epoch` its drives, and `samples` its averages of bearings. `expandable` has the
    sides, as (other slot, sign), that it could expand. `waiting`: it stands at the base, ready to go. `redundant`: it
    has left the complex, and its body still stands at its slot. `guests` are the robots that stand at the base's own
    point; only a base station names them. `displaced`: it was pushed away from its slot, and sees other walls than from there.
    """

    number: int
    slot: int
    epoch: int
    moving: bool
    waiting: bool
    samples: int
    seen: tuple[SeenRobot, ...]
    attempts: tuple[Attempt, ...]
    expandable: tuple[tuple[int, int], ...]
    path_vector: PathVector
    redundant: bool = False
    guests: tuple[int, ...] = ()
    displaced: bool = False

    @property
    def is_at_slot(self) -> bool:
        """True if the robot stands at a slot of the complex, and sees of walls what is seen from there."""
        return self.slot != NOWHERE and not (self.moving or self.redundant or self.displaced)


class StateRequest(_BeaconMessage, frozen=True, tag="state-request"):
    """A request that these robots, or all if there are none, broadcast their states."""

    nodes: tuple[int, ...]
