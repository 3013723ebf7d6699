"""The only message of a team: a beacon that every robot broadcasts, with all that teammates must know.

Beacons carry states, not changes: any beacon may be lost, late or copied, and the next one makes up for it. Robots
forward statuses, so a team may be larger than the radio's range.
"""

from collections.abc import Callable
from typing import Final

import msgspec
from msgspec import Struct

from zwerm.agents.robot_teams.mapping.facts import End, FrontierCut, Return, SweptSegment, TracedArc, Void
from zwerm.wire.checksum import Sealed

# The phases of a robot's work on its slice, in order.
READY: Final = 0  # has finished the plan
TRAVELS: Final = 1
SWEEPS: Final = 2
HUNTS: Final = 3


class View(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """The robots of a team: its `members`, ascending, and the one that decides for it. A later `epoch` replaces earlier
    ones."""

    epoch: int
    lead: int
    members: tuple[int, ...]


class CorridorPlan(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """One corridor: move over from the end `anchor` in x-direction `direction`, one slice a robot; `order` is from the
    lag (first) to the lead (last).

    The lag's slice is the anchor's own if its segment is not swept (`own_slice`), else the next. Sweeps end at the height
    `frontier_mm` of the team's virtual frontier, if there is one.
    """

    epoch: int
    number: int
    anchor: End
    direction: int
    own_slice: bool
    order: tuple[int, ...]
    frontier_mm: int | None = None


class Status(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """The activity of one robot: `beat` grows with every status. `at` is the end where it last was.

    In the corridor it `found` a new segment on its slice, is `spare`, takes slice `claim`, found room for `room`
    robots. It is `sweeping` a slice now. `team` is the epoch and the lead of its view; `epoch` and `number` are of its
    plan.
    """

    node: int
    beat: int
    x_mm: int
    y_mm: int
    epoch: int
    number: int
    phase: int
    at: End | None
    found: bool
    spare: bool
    claim: int | None
    room: int | None
    sweeping: int | None
    team: tuple[int, int]


class TeamBeacon(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """The broadcast of a robot. `views` are its own team's, then those that its lead has made of it, then those of
    teams that were met.

    `digest` and `count` describe its facts, `segments`, `arcs`, `voids`, `returns` and `cuts` are some of them.
    """

    sender: int
    views: tuple[View, ...]
    met: tuple[View, ...]
    plans: tuple[CorridorPlan, ...]
    statuses: tuple[Status, ...]
    digest: int
    count: int
    segments: tuple[SweptSegment, ...] = ()
    arcs: tuple[TracedArc, ...] = ()
    voids: tuple[Void, ...] = ()
    returns: tuple[Return, ...] = ()
    cuts: tuple[FrontierCut, ...] = ()


class FoundSnapshot(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """The findings of one robot, for metrics and pictures: no node receives them.

    `slices` are x, bottom and top of swept segments [m], `critical_points` are x and y [m]; `team` is the lead's id.
    """

    team: int
    slices: tuple[tuple[float, float, float], ...]
    critical_points: tuple[tuple[float, float], ...]


encode_snapshot: Final = msgspec.msgpack.Encoder().encode
_decode_snapshot: Final = msgspec.msgpack.Decoder(FoundSnapshot).decode


def decode_snapshot(payload: bytes) -> FoundSnapshot | None:
    """Return the snapshot in `payload`, or None where it holds none."""
    try:
        found: FoundSnapshot = _decode_snapshot(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None
    return found


_beacons: Final = Sealed(TeamBeacon)
write_beacon: Final[Callable[[TeamBeacon], bytes]] = _beacons.write
read_beacon: Final[Callable[[bytes], TeamBeacon | None]] = _beacons.read
