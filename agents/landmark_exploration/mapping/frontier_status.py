"""Frontiers: ordered pairs of landmarks, and what is known of the region to the left of each.

The frontier <a, b> is the region left of the line from landmark a to landmark b (Ramaithitima and Bhattacharya 2018, section
IV-A). A status only ever rises, so that statuses from several robots merge by maximum, in any order.
"""

from collections.abc import Iterator
from operator import itemgetter
from typing import Final

from zwerm.agents.landmark_exploration.mapping.bearing_steps import HALF, STEPS, BearingSnapshot, widest_gap

UNKNOWN: Final = 0
UNEXPLORED: Final = 1
TIMED_OUT: Final = 2  # explored until the time limit: a potential obstacle boundary
REOPENED: Final = 3  # to be explored once more, because the trace of the 1-skeleton contradicts a boundary here
ABANDONED: Final = 4  # timed out again
BOUNDARY: Final = 5  # an obstacle was touched there
CLEAR: Final = 6

_IS_OPEN: Final = (False, True, False, True, False, False, False)

# The widest angle between adjacent bearings of an observer that is inside beyond doubt: 14 degrees less than a half turn,
# which is 5 standard deviations of the sensor.
AREA_GAP_MAX: Final = HALF - 10

Pair = tuple[int, int]


def key_of(a: int, b: int) -> int:
    """Return the key of the frontier <a, b>."""
    return a << 16 | b


def pair_of(key: int) -> Pair:
    """Return the frontier of a key."""
    return key >> 16, key & 0xFFFF


class Frontiers:
    """The status of every frontier. `open` holds the keys of those to be explored.

    `has_area` is true once an observation was inside the hull of its landmarks beyond doubt. An observer on the line between
    landmarks may seem to be inside because bearings are noisy.
    """

    def __init__(self) -> None:
        self.has_area = False
        self.statuses: dict[int, int] = {}
        self.open: dict[int, None] = {}
        self.open_at: dict[int, int] = {}  # landmark: open frontiers that it is part of
        self._open_of: dict[int, dict[int, None]] = {}  # landmark: the keys of these
        # By observed set of landmarks: its frontiers that were not clear at the last observation, as (i, j, key) with the
        # numbers of both landmarks in the set.
        self._undecided: dict[tuple[int, ...], list[tuple[int, int, int]]] = {}

    def status(self, a: int, b: int) -> int:
        """Return the status of <a, b>."""
        return self.statuses.get(a << 16 | b, UNKNOWN)

    def is_open(self, a: int, b: int) -> bool:
        """Return whether <a, b> is to be explored."""
        return a << 16 | b in self.open

    def raise_to(self, key: int, status: int) -> bool:
        """Raise a frontier to a status; return whether that was news."""
        known = self.statuses.get(key, UNKNOWN)
        if status <= known:
            return False
        self.statuses[key] = status
        if _IS_OPEN[status] != _IS_OPEN[known]:
            change = 1 if _IS_OPEN[status] else -1
            for landmark in pair_of(key):
                self.open_at[landmark] = self.open_at.get(landmark, 0) + change
                if change > 0:
                    self._open_of.setdefault(landmark, {})[key] = None
                else:
                    del self._open_of[landmark][key]
            if change > 0:
                self.open[key] = None
            else:
                del self.open[key]
        return True

    def most_at_a_pair(self) -> int:
        """Return the largest sum of `open_at` over the two landmarks of an open frontier, or 0 without any.

        Landmarks come by descending count. No pair whose larger count is half of the best sum or less can exceed it.
        """
        at, best = self.open_at, 0
        for landmark, count in sorted(at.items(), key=itemgetter(1), reverse=True):
            if 2 * count <= best:
                break
            for key in self._open_of.get(landmark, ()):
                best = max(best, at[key >> 16] + at[key & 0xFFFF])
        return best

    def note(self, snapshot: BearingSnapshot) -> bool:
        """Take in an observation; return whether any status rose.

        Seen from inside the hull of the landmarks, every frontier that the observer is in is clear. All others become
        unexplored if they were unknown. A pair in line with the observer is neither left nor right.
        """
        landmarks, bearings = snapshot
        undecided = self._undecided.get(landmarks)
        if undecided is None:
            count = len(landmarks)
            undecided = [(i, j, landmarks[i] << 16 | landmarks[j]) for j in range(1, count) for i in range(j)]
            undecided += [(j, i, landmarks[j] << 16 | landmarks[i]) for i, j, _ in undecided]
            fresh = [key for _, _, key in undecided if key not in self.statuses]
            for key in fresh:
                self.raise_to(key, UNEXPLORED)
            news = bool(fresh)
        elif not undecided:
            return False
        else:
            news = False
        gap = widest_gap(bearings)
        self.has_area |= gap <= AREA_GAP_MAX
        if gap < HALF:
            statuses, left = self.statuses, []
            for each in undecided:
                i, j, key = each
                if statuses[key] == CLEAR:
                    continue
                if 0 < (bearings[j] - bearings[i]) % STEPS < HALF:
                    news = self.raise_to(key, CLEAR) or news
                else:
                    left.append(each)
            undecided = left
        self._undecided[landmarks] = undecided
        return news

    def sharing(self, key: int) -> int:
        """Return how many open frontiers have a landmark in common with this one, itself included if it is open."""
        a, b = pair_of(key)
        both = (key in self.open) + (b << 16 | a in self.open)
        return self.open_at.get(a, 0) + self.open_at.get(b, 0) - both

    def with_status(self, status: int) -> Iterator[int]:
        """Yield the keys of all frontiers of a status, ascending."""
        return iter(sorted(key for key, each in self.statuses.items() if each == status))
