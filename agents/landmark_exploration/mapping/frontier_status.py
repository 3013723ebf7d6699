"""Frontiers: ordered pairs of landmarks, and the status of the region to the left of each.

The frontier <a, b> is the region left of the line from landmark a to landmark b (Ramaithitima and Bhattacharya 2018, section
IV-A). A status only ever rises, so that statuses from several robots merge by maximum, in any order.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

from zwerm.agents.landmark_exploration.mapping.bearing_steps import HALF, STEPS, BearingSnapshot, widest_gap

UNKNOWN: Final = 0
UNEXPLORED: Final = 1
TIMED_OUT: Final = 2  # explored until the time limit: a potential obstacle boundary
REOPENED: Final = 3  # to be explored once more, because the trace of the 1-skeleton contradicts a boundary here
ABANDONED: Final = 4  # timed out again
BOUNDARY: Final = 5  # an obstacle was touched there
CLEAR: Final = 6

_IS_OPEN: Final = (False, True, False, True, False, False, False)

# The widest angle between adjacent bearings of an observer that is certainly inside: 14 degrees less than a half turn, which
# is 5 standard deviations of the sensor.
AREA_GAP_MAX: Final = HALF - 10

Pair = tuple[int, int]


def key_of(a: int, b: int) -> int:
    """Return the key of the frontier <a, b>."""
    return a << 16 | b


def pair_of(key: int) -> Pair:
    """Return the frontier of a key."""
    return key >> 16, key & 0xFFFF


# A frontier of an observed set of landmarks: (i, j, key) with the numbers of both landmarks in the set.
Undecided = tuple[int, int, int]


class ObservationVerdict(NamedTuple):
    """The conclusions from one observation: the frontiers that it clears, the others, and whether it proves an area."""

    clear: tuple[int, ...]
    other: tuple[Undecided, ...]
    has_area: bool


# Robots share observations, and one process may hold many robots.
@lru_cache(maxsize=1 << 14)
def verdict(snapshot: BearingSnapshot) -> ObservationVerdict:
    """Return the conclusions from an observation, by the rule of Frontiers.note."""
    landmarks, bearings = snapshot
    count = len(landmarks)
    other = [(i, j, landmarks[i] << 16 | landmarks[j]) for j in range(1, count) for i in range(j)]
    other += [(j, i, landmarks[j] << 16 | landmarks[i]) for i, j, _ in other]
    gap = widest_gap(bearings)
    clear: list[int] = []
    if gap < HALF:
        inside = [0 < (bearings[j] - bearings[i]) % STEPS < HALF for i, j, _ in other]
        clear = [each[2] for each, is_clear in zip(other, inside, strict=True) if is_clear]
        other = [each for each, is_clear in zip(other, inside, strict=True) if not is_clear]
    return ObservationVerdict(tuple(clear), tuple(other), gap <= AREA_GAP_MAX)


class Frontiers:
    """The status of every frontier. `open` holds the keys of those to be explored.

    `has_area` is true after an observation that was certainly inside the hull of its landmarks. An observer on the line
    between landmarks may seem to be inside because bearings are noisy.
    """

    def __init__(self) -> None:
        self.has_area = False
        self.statuses: dict[int, int] = {}
        self.open: dict[int, None] = {}
        self.open_of: dict[int, set[int]] = {}  # landmark: the keys of the open frontiers that it is part of
        # By observed set of landmarks: its frontiers that were not clear at the last observation.
        self._undecided: dict[tuple[int, ...], list[Undecided]] = {}

    def status(self, a: int, b: int) -> int:
        """Return the status of <a, b>."""
        return self.statuses.get(a << 16 | b, UNKNOWN)

    def is_open(self, a: int, b: int) -> bool:
        """Return whether <a, b> is to be explored."""
        return a << 16 | b in self.open

    def raise_to(self, key: int, status: int) -> bool:
        """Raise a frontier to a status; return whether its status rose."""
        known = self.statuses.get(key, UNKNOWN)
        if status <= known:
            return False
        self.statuses[key] = status
        if _IS_OPEN[status] != _IS_OPEN[known]:
            a, b, open_of = key >> 16, key & 0xFFFF, self.open_of
            if _IS_OPEN[status]:
                self.open[key] = None
                for landmark in (a, b):
                    if landmark in open_of:
                        open_of[landmark].add(key)
                    else:
                        open_of[landmark] = {key}
            else:
                del self.open[key]
                open_of[a].discard(key)
                open_of[b].discard(key)
        return True

    def open_at(self, landmark: int) -> int:
        """Return how many open frontiers a landmark is part of."""
        return len(self.open_of.get(landmark, ()))

    def note(self, snapshot: BearingSnapshot) -> bool:
        """Process an observation; return whether any status rose.

        Seen from inside the hull of the landmarks, every frontier that the observer is in is clear. All others become
        unexplored if they were unknown. A pair in line with the observer is neither left nor right.
        """
        landmarks, bearings = snapshot
        undecided = self._undecided.get(landmarks)
        if undecided is None:
            return self._note_first(snapshot)
        if not undecided:
            return False
        gap = widest_gap(bearings)
        self.has_area |= gap <= AREA_GAP_MAX
        if gap >= HALF:
            return False
        news, statuses, left = False, self.statuses, []
        for each in undecided:
            i, j, key = each
            if statuses[key] == CLEAR:
                continue
            if 0 < (bearings[j] - bearings[i]) % STEPS < HALF:
                news = self.raise_to(key, CLEAR) or news
            else:
                left.append(each)
        self._undecided[landmarks] = left
        return news

    def _note_first(self, snapshot: BearingSnapshot) -> bool:
        """Process the first observation of a set of landmarks; return whether any status rose."""
        clear, other, has_area = verdict(snapshot)
        self.has_area |= has_area
        statuses = self.statuses
        risen = [key for key in clear if statuses.get(key) != CLEAR]
        for key in risen:
            self.raise_to(key, CLEAR)
        fresh = [key for _, _, key in other if key not in statuses]
        for key in fresh:
            self.raise_to(key, UNEXPLORED)
        self._undecided[snapshot.landmarks] = [each for each in other if statuses[each[2]] != CLEAR]
        return bool(risen or fresh)

    def sharing(self, key: int) -> int:
        """Return how many open frontiers have a landmark in common with this one, itself included if it is open."""
        a, b = pair_of(key)
        both = (key in self.open) + (b << 16 | a in self.open)
        return self.open_at(a) + self.open_at(b) - both

    def with_status(self, status: int) -> Iterator[int]:
        """Yield the keys of all frontiers of a status, ascending."""
        return iter(sorted(key for key, each in self.statuses.items() if each == status))
