"""Reports of landmark exploration: snapshots in bytes from its nodes to the observers of a run.

No node receives them.
"""

from collections.abc import Sequence
from typing import Final

import msgspec
from msgspec import Struct

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot


class MapReport(Struct, frozen=True, forbid_unknown_fields=True, tag="landmark-map"):
    """The part of a map that is new since the last report: `simplices` with the bearings at which they were seen.

    A coordinator also reports its open `frontiers`, and the robots `assigned`, as (robot, a, b). A robot reports how
    many frontiers it has `open`, and whether it is `done`.
    """

    simplices: tuple[tuple[int, ...], ...]
    bearings: tuple[tuple[int, ...], ...]
    open: int
    done: bool = False
    of_robot: bool = False
    frontiers: tuple[tuple[int, int], ...] = ()
    assigned: tuple[tuple[int, int, int], ...] = ()


class GoalReport(Struct, frozen=True, forbid_unknown_fields=True, tag="landmark-goal"):
    """The end of a path to a goal, a set of landmarks."""

    goal: tuple[int, ...]
    arrived: bool
    iterations: int


MapOrGoalReport = MapReport | GoalReport

_encode: Final = msgspec.msgpack.Encoder().encode
_decoder: Final = msgspec.msgpack.Decoder(MapReport | GoalReport)


def write_report(report: MapOrGoalReport) -> bytes:
    """Return a report as bytes."""
    return _encode(report)


def read_report(snapshot: bytes) -> MapOrGoalReport | None:
    """Return a report, or None where the bytes are none."""
    try:
        report: MapOrGoalReport = _decoder.decode(snapshot)
    except msgspec.MsgspecError:
        return None
    return report


def columns(seen: Sequence[BearingSnapshot]) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """Return the landmarks and the bearings of observations."""
    return tuple(each.landmarks for each in seen), tuple(each.bearings for each in seen)
