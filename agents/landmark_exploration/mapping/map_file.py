"""A landmark map as the text of a file, for later runs.

JSON, one object: `format` is "landmark-map/1"; `observations` is a list of [landmarks, bearings]. The landmarks are ids
of one observation, ascending. The bearings are in steps of a 256th of a turn, counter-clockwise from the compass's
zero; `closed` is a list of [a, b, status] with the frontiers that are no longer to be explored and that no observation
clears. Statuses are those of `frontier`. Observations that are faces of others may be left out.
"""

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta, Struct

from zwerm.agents.landmark_exploration.mapping.bearing_steps import LANDMARKS_MAX, STEPS, BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.frontier_status import (
    CLEAR,
    REOPENED,
    UNKNOWN,
    key_of,
    pair_of,
)
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_reports import MapReport, read_report
from zwerm.agents.landmark_exploration.sharing.log_entries import snapshot_of

FORMAT: Final = "landmark-map/1"

Landmark = Annotated[int, Meta(ge=0, lt=LANDMARKS_MAX)]
Steps = Annotated[int, Meta(ge=0, lt=STEPS)]


class MapFile(Struct, frozen=True, forbid_unknown_fields=True):
    """The contents of a map file."""

    format: str
    observations: tuple[tuple[tuple[Landmark, ...], tuple[Steps, ...]], ...]
    closed: tuple[tuple[Landmark, Landmark, Annotated[int, Meta(gt=UNKNOWN, lt=CLEAR)]], ...] = ()


def write_map(map_: LandmarkMap) -> str:
    """Return a map as the text of its file: its free simplices, and the closed frontiers that no observation clears."""
    complex_ = map_.complex
    observations = sorted(complex_.snapshot_of(vertex) for vertex in complex_.simplices)
    closed = [
        (*pair_of(key), status)
        for key, status in sorted(map_.frontiers.statuses.items())
        if UNKNOWN < status < CLEAR and key not in map_.frontiers.open
    ]
    text = msgspec.json.encode(
        MapFile(FORMAT, tuple((each.landmarks, each.bearings) for each in observations), tuple(closed))
    )
    return text.decode().replace("],[[", "],\n[[") + "\n"


def read_map(text: str) -> LandmarkMap:
    """Return the map that a file's text holds. Raises ValueError, in one line, where it holds none."""
    try:
        file: Any = msgspec.json.decode(text, type=MapFile)
    except msgspec.MsgspecError as error:
        raise ValueError(f"no landmark map: {error}") from None
    if file.format != FORMAT:
        raise ValueError(f"no landmark map: expected the format {FORMAT!r}, got {file.format!r}")
    map_ = LandmarkMap()
    for number, (landmarks, bearings) in enumerate(file.observations):
        if len(landmarks) != len(bearings):
            raise ValueError(
                f"no landmark map: observation {number} has {len(landmarks)} landmarks, {len(bearings)} bearings"
            )
        if any(a >= b for a, b in pairwise(landmarks)):
            raise ValueError(f"no landmark map: observation {number}: expected ascending ids, got {list(landmarks)}")
        snapshot: BearingSnapshot = snapshot_of(zip(landmarks, bearings, strict=True))
        map_.observe(snapshot, (number, 0))
    for a, b, status in file.closed:
        if status != REOPENED:
            map_.raise_all([key_of(a, b)], status)
    return map_


def map_of_reports(snapshots: Iterable[bytes]) -> LandmarkMap:
    """Return the map of all observations in the snapshots that the nodes of a run reported, in that order."""
    map_ = LandmarkMap()
    number = 0
    for report in map(read_report, snapshots):
        if isinstance(report, MapReport):
            for landmarks, bearings in zip(report.simplices, report.bearings, strict=True):
                map_.observe(snapshot_of(zip(landmarks, bearings, strict=True)), (number, 0))
                number += 1
    return map_
