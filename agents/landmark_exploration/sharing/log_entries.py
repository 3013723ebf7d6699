"""Entries of a robot's log: observations and statuses, each as a few bytes that fit into the smallest message.

    observation  kind, then landmark (2 bytes) and bearing (1 byte) for each; one of more than `LANDMARKS_AT_ONCE` landmarks
                 comes in parts, and only the last part is of the kind OBSERVATION
    statuses     kind, status, then the two landmarks (2 bytes each) of every frontier
    failure      kind, then the two landmarks of a frontier that the robot did not reach

Numbers are little-endian. The entries of a log, read in order, are complete without other data.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from struct import iter_unpack, pack, unpack
from typing import Final

from zwerm.agents.landmark_exploration.mapping.bearing_steps import STEPS, BearingSnapshot

PART: Final = 0
OBSERVATION: Final = 1
STATUSES: Final = 2
FAILURE: Final = 3

LANDMARKS_AT_ONCE: Final = 13
FRONTIERS_AT_ONCE: Final = 9

# No entry is longer.
ENTRY_BYTES_MAX: Final = 1 + 3 * LANDMARKS_AT_ONCE


def observation_entries(snapshot: BearingSnapshot) -> list[bytes]:
    """Return the entries of an observation."""
    pairs = list(zip(snapshot.landmarks, snapshot.bearings, strict=True))
    entries: list[bytes] = []
    for start in range(0, max(len(pairs), 1), LANDMARKS_AT_ONCE):
        some = pairs[start : start + LANDMARKS_AT_ONCE]
        kind = OBSERVATION if start + LANDMARKS_AT_ONCE >= len(pairs) else PART
        entries.append(bytes([kind]) + b"".join(pack("<HB", landmark, bearing) for landmark, bearing in some))
    return entries


def status_entries(keys: Sequence[int], status: int) -> list[bytes]:
    """Return the entries that set the status of frontiers."""
    return [
        bytes([STATUSES, status])
        + b"".join(pack("<HH", key >> 16, key & 0xFFFF) for key in keys[start : start + FRONTIERS_AT_ONCE])
        for start in range(0, len(keys), FRONTIERS_AT_ONCE)
    ]


def read_bearings(entry: bytes) -> list[tuple[int, int]]:
    """Return the (landmark, bearing) pairs of an observation, or of a part of one. Raises ValueError where it is none."""
    if not entry or entry[0] not in (PART, OBSERVATION) or len(entry) % 3 != 1:
        raise ValueError("an observation is its kind and 3 bytes for each landmark")
    return list(iter_unpack("<HB", entry[1:]))


def read_statuses(entry: bytes) -> tuple[int, list[int]]:
    """Return the status and the keys of the frontiers that have it. Raises ValueError where it is no such entry."""
    if len(entry) < 2 or entry[0] != STATUSES or len(entry) % 4 != 2:
        raise ValueError("statuses are their kind, a status and 4 bytes for each frontier")
    return entry[1], [a << 16 | b for a, b in iter_unpack("<HH", entry[2:])]


def failure_entry(key: int) -> bytes:
    """Return the entry of a frontier that the robot did not reach."""
    return pack("<BHH", FAILURE, key >> 16, key & 0xFFFF)


def read_failure(entry: bytes) -> int:
    """Return the key of the frontier that a robot did not reach. Raises ValueError where it is no such entry."""
    if len(entry) != 5 or entry[0] != FAILURE:
        raise ValueError("a failure is its kind and 4 bytes")
    a, b = unpack("<HH", entry[1:])
    return int(a) << 16 | int(b)


def snapshot_of(bearings: Iterable[tuple[int, int]]) -> BearingSnapshot:
    """Return the snapshot of (landmark, bearing) pairs; a landmark that occurs twice has its first bearing."""
    found: dict[int, int] = {}
    for landmark, bearing in bearings:
        found.setdefault(landmark, bearing % STEPS)
    landmarks = tuple(sorted(found))
    return BearingSnapshot(landmarks, tuple(found[landmark] for landmark in landmarks))


# Many robots of one process read the same entry.
@lru_cache(maxsize=1 << 14)
def read_observation(entry: bytes) -> BearingSnapshot:
    """Return the observation of an entry that holds all of it. Raises ValueError where it is none."""
    return snapshot_of(read_bearings(entry))
