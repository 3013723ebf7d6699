"""What nodes of landmark-based exploration report to those who watch the run: a snapshot in bytes. No node receives it."""

from collections.abc import Sequence
from typing import Final

import msgspec
from msgspec import Struct

from zwerm.agents.landmark_exploration.mapping.bearing_steps import Snapshot


class MapReport(Struct, frozen=True, forbid_unknown_fields=True, tag="landmark-map"):
    """What is new in a map since the last report: `simplices` with the bearings at which they were seen.

    Of the coordinator also its open `frontiers`, and the robots `assigned`, as (robot, a, b); of a robot its `claim`, how many
    frontiers it has `open`, and whether it is `done`.
    """

    simplices: tuple[tuple[int, ...], ...]
    bearings: tuple[tuple[int, ...], ...]
    open: int
    done: bool = False
    of_robot: bool = False
    frontiers: tuple[tuple[int, int], ...] = ()
    assigned: tuple[tuple[int, int, int], ...] = ()


class GoalReport(Struct, frozen=True, forbid_unknown_fields=True, tag="landmark-goal"):
    """The end of a way to a goal, a set of landmarks."""

    goal: tuple[int, ...]
    arrived: bool
    iterations: int


AnyReport = MapReport | GoalReport

_encode: Final = msgspec.msgpack.Encoder().encode
_decoder: Final = msgspec.msgpack.Decoder(MapReport | GoalReport)


def write_report(told: AnyReport) -> bytes:
    """Return a report as bytes."""
    return _encode(told)


def read_report(snapshot: bytes) -> AnyReport | None:
    """Return a report, or None where the bytes are none."""
    try:
        told: AnyReport = _decoder.decode(snapshot)
    except msgspec.MsgspecError:
        return None
    return told


def columns(seen: Sequence[Snapshot]) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """Return the landmarks and the bearings of observations."""
    return tuple(each.landmarks for each in seen), tuple(each.bearings for each in seen)
