"""Visibility: the pairs of robots within range whose connecting line is free.

Visibility is mutual, and is computed once per unordered pair for all sensors and the radio. A result is kept until one end
moves; turning on the spot is not moving. With a range the cost is near-linear in the number of robots; without one it is
quadratic, and cubic if robots also occlude each other. Headings, noise and radio models have no part here.
"""

import math
from typing import NamedTuple

import numpy as np

from zwerm.world.arena.arena import Arena
from zwerm.world.geometry.pairs import every_pair
from zwerm.world.geometry.search_tree import FEW_ROBOTS, tree_of
from zwerm.world.scene import Bools, Floats, Ints, Scene

# Occluding robots are tested against this many lines at a time: it bounds memory and fits the cache.
_TRIPLES_AT_ONCE = 1 << 15

# Up to this fraction of the present robots, observers are measured against all robots: the other pairs are not needed.
_FEW_OBSERVERS = 0.25

# Robots this much farther away than the range are kept as candidates of a few observers, as a fraction of the range.
_MARGIN_FRACTION = 0.5
_HALF_MARGIN_ON_AXIS = 0.5 * _MARGIN_FRACTION / math.sqrt(2.0)


class VisiblePairs(NamedTuple):
    """Pairs (observer, seen), sorted; robot `robots[r]` is the observer in rows `ends[r - 1]` to `ends[r]`."""

    observer: Ints  # (k,) ids
    seen: Ints  # (k,) ids
    ends: Ints  # (len(robots),)


class WallVerdicts:
    """Results of wall tests for lines between two items, by the key of the line, kept until an end moves."""

    def __init__(self) -> None:
        self._keys: Ints = np.empty(0, dtype=np.int64)
        self._blocked: Bools = np.empty(0, dtype=np.bool_)

    @property
    def keys(self) -> Ints:
        """The keys of the lines that are known, ascending."""
        return self._keys

    def keep(self, still: Bools) -> None:
        """Drop the results of all lines except those of `keys` where `still`."""
        self._keys, self._blocked = self._keys[still], self._blocked[still]

    def blocked(self, arena: Arena, keys: Ints, start: Floats, end: Floats) -> Bools:
        """Return (k,) whether a wall blocks the lines `keys` (k,) from start to end (k, 2); only new lines are tested."""
        if len(self._keys) == 0:
            blocked = arena.blocked(start, end)
            self._learn(keys, blocked)
            return blocked
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        blocked = self._blocked[at]
        new = np.flatnonzero(self._keys[at] != keys)
        if len(new):
            blocked[new] = arena.blocked(start[new], end[new])
            self._learn(keys[new], blocked[new])
        return blocked

    def _learn(self, keys: Ints, blocked: Bools) -> None:
        keys, blocked = np.concatenate([self._keys, keys]), np.concatenate([self._blocked, blocked])
        order = np.argsort(keys, kind="stable")
        self._keys, self._blocked = keys[order], blocked[order]


class NearPairs:
    """The pairs of robots within a range, for any range and one scene, which is searched once if the ranges are known.

    `known_m` is the longest range of a query in an earlier scene: it is searched before the first query.
    """

    def __init__(self, known_m: float = 0.0) -> None:
        self.asked_m = 0.0
        self._known_m = known_m
        self._reach_m = -1.0
        self._pairs: Ints = np.empty((0, 2), dtype=np.int64)
        self._apart2: Floats = np.empty(0)

    def within(self, scene: Scene, range_m: float | None) -> Ints:
        """Return (k, 2) ids i < j of present robots at most range_m apart, ascending."""
        if range_m is None:
            ids = scene.present_ids()
            everyone: Ints = ids[np.column_stack(every_pair(len(ids)))]
            return everyone
        self.asked_m = max(self.asked_m, range_m)
        if range_m > self._reach_m:
            self._search(scene, max(range_m, self._known_m))
        found: Ints = self._pairs[self._apart2 <= range_m**2]
        return found

    def _search(self, scene: Scene, reach_m: float) -> None:
        ids = scene.present_ids()
        position = scene.position[ids]
        # Slightly too far, so that the comparison in `pairs` alone decides at the edge.
        farther_m = reach_m * (1.0 + 1e-9)
        if len(ids) <= FEW_ROBOTS:
            first, second = every_pair(len(ids))
            x, y = position.T
            apart2 = (x[second] - x[first]) ** 2 + (y[second] - y[first]) ** 2
            near = np.flatnonzero(apart2 <= farther_m**2)
            pairs, apart2 = np.column_stack([first[near], second[near]]), apart2[near]
        else:
            pairs = tree_of(position).query_pairs(farther_m, output_type="ndarray")
            pairs = pairs[np.argsort(pairs[:, 0] * len(ids) + pairs[:, 1])]
            dx, dy = position[pairs[:, 1]].T - position[pairs[:, 0]].T
            apart2 = dx**2 + dy**2
        self._reach_m, self._pairs, self._apart2 = reach_m, ids[pairs], apart2


class FewObservers:
    """The robots within a range of a few observers, for any range and one scene, which is measured once.

    `robots` are the observers, as bytes. The cost grows with observers times robots, and no work is done for the pairs of
    other robots. Candidates are found within the range and a margin. They are those of the next scenes, too, until a robot
    has moved half the margin.
    """

    def __init__(self) -> None:
        self._searched: Floats = np.empty((0, 2))  # the positions at which the candidates were found
        self._position: Floats = np.empty((0, 2))  # the positions at which they were measured
        self._present: Bools = np.empty(0, dtype=np.bool_)
        self.robots = b""
        self._reach_m = -1.0
        self._row: Ints = np.empty(0, dtype=np.int64)
        self._observer: Ints = np.empty(0, dtype=np.int64)
        self._seen: Ints = np.empty(0, dtype=np.int64)
        self._apart2: Floats = np.empty(0)

    def within(self, scene: Scene, robots: Ints, range_m: float) -> tuple[Ints, Ints]:
        """Return pairs (k,), (k,) of a row of `robots` and a present robot at most range_m from it, sorted."""
        known = scene.present is self._present and range_m <= self._reach_m and robots.tobytes() == self.robots
        if not known or not self._measured_again(scene.position):
            self._search(scene, robots, max(range_m, self._reach_m))
        near = self._apart2 <= range_m**2
        return self._row[near], self._seen[near]

    def _measured_again(self, position: Floats) -> bool:
        """Measure the candidates at these positions (n, 2), unless a robot has moved too far since they were found."""
        if position is self._position:
            return True
        # A robot that moved by no more along each axis moved by no more than half the margin.
        axis_m = _HALF_MARGIN_ON_AXIS * self._reach_m
        moved = position - self._searched
        if not -axis_m <= np.minimum.reduce(moved, axis=None, initial=0.0) or not (
            np.maximum.reduce(moved, axis=None, initial=0.0) <= axis_m
        ):
            return False
        apart = position[self._seen] - position[self._observer]
        apart *= apart
        self._apart2 = apart[:, 0] + apart[:, 1]
        self._position = position
        return True

    def _search(self, scene: Scene, robots: Ints, reach_m: float) -> None:
        x, y = scene.position.T
        apart2 = (x - x[robots][:, None]) ** 2 + (y - y[robots][:, None]) ** 2
        # Slightly too far, so that the comparison in `within` alone decides at the edge.
        near = apart2 <= (reach_m * (1.0 + _MARGIN_FRACTION + 1e-9)) ** 2
        near &= scene.present
        near[np.arange(len(robots)), robots] = False
        self._row, self._seen = near.nonzero()
        self._observer = robots[self._row]
        self._apart2 = apart2[self._row, self._seen]
        self._searched = self._position = scene.position
        self._present, self.robots, self._reach_m = scene.present, robots.tobytes(), reach_m


class Visibility:
    """The visible pairs of one run, kept from scene to scene."""

    def __init__(self) -> None:
        self._position: Floats = np.empty((0, 2))
        self._present: Bools = np.empty(0, dtype=np.bool_)
        self._verdicts = WallVerdicts()
        self._near = NearPairs()
        # One for the robots that are awake, one for the sleepers that watch.
        self._few = [FewObservers(), FewObservers()]
        self._pairs: dict[tuple[float | None, bool, bool], Ints] = {}
        self._sightings: dict[tuple[float | None, bool, bool], tuple[Ints, Ints]] = {}

    def pairs(
        self, scene: Scene, range_m: float | None = None, through_walls: bool = False, robots_occlude: bool = False
    ) -> Ints:
        """Return (k, 2) ids i < j of the present robots that see each other, ascending. The array is shared: do not write.

        They are at most `range_m` apart, no wall blocks the line between their centres, unless `through_walls`, and no
        third robot's disc touches it, if `robots_occlude`.
        """
        self._advance(scene)
        settings = (range_m, through_walls, robots_occlude)
        found = self._pairs.get(settings)
        if found is None:
            found = self._settle(scene, range_m, through_walls or scene.arena.is_convex, robots_occlude)
            found.flags.writeable = False
            self._pairs[settings] = found
        return found

    def sightings(
        self,
        scene: Scene,
        robots: Ints,
        range_m: float | None = None,
        through_walls: bool = False,
        robots_occlude: bool = False,
    ) -> VisiblePairs:
        """Return both directions of `pairs`, for the observers `robots` (ascending ids of present robots)."""
        if range_m is not None and not robots_occlude and len(robots) <= _FEW_OBSERVERS * len(scene.present):
            return self._few_sightings(scene, robots, range_m, through_walls)
        pairs = self.pairs(scene, range_m, through_walls, robots_occlude)
        settings = (range_m, through_walls, robots_occlude)
        directed = self._sightings.get(settings)
        if directed is None:
            count = len(scene.present)
            keys = np.concatenate([pairs[:, 0] * count + pairs[:, 1], pairs[:, 1] * count + pairs[:, 0]])
            keys.sort()
            observer = keys // count
            seen = keys - observer * count
            observer.flags.writeable = seen.flags.writeable = False
            directed = self._sightings[settings] = (observer, seen)
        observer, seen = directed
        if len(robots) < np.count_nonzero(scene.present):
            asked = np.zeros(len(scene.present), dtype=np.bool_)
            asked[robots] = True
            rows = asked[observer]
            observer, seen = observer[rows], seen[rows]
        return VisiblePairs(observer, seen, np.searchsorted(observer, robots, side="right"))

    def _few_sightings(self, scene: Scene, robots: Ints, range_m: float, through_walls: bool) -> VisiblePairs:
        """Return the sightings of a few robots without those of all others; a range and walls are all that limits them."""
        if robots.tobytes() != self._few[0].robots:
            self._few.reverse()
        row, seen = self._few[0].within(scene, robots, range_m)
        if not len(row):
            return VisiblePairs(row, seen, np.zeros(len(robots), dtype=np.int64))
        if not (through_walls or scene.arena.is_convex):
            observer = robots[row]
            first, second = np.minimum(observer, seen), np.maximum(observer, seen)
            free = ~scene.arena.blocked(scene.position[first], scene.position[second])
            row, seen = row[free], seen[free]
        return VisiblePairs(robots[row], seen, np.searchsorted(row, np.arange(len(robots)), side="right"))

    def _advance(self, scene: Scene) -> None:
        """Drop results that no longer hold. Positions are compared, so the sequence of queried scenes does not matter."""
        if len(self._present) != len(scene.present):
            changed = np.ones(len(scene.present), dtype=np.bool_)
            self._verdicts = WallVerdicts()
        else:
            x, y = (scene.position != self._position).T
            changed = ((x | y) & scene.present) | (scene.present != self._present)
        if not changed.any():
            return
        self._near = NearPairs(self._near.asked_m)
        self._pairs.clear()
        self._sightings.clear()
        keys, count = self._verdicts.keys, len(changed)
        if len(keys):
            self._verdicts.keep(~(changed[keys // count] | changed[keys % count]))
        self._position, self._present = scene.position.copy(), scene.present.copy()

    def _settle(self, scene: Scene, range_m: float | None, through_walls: bool, robots_occlude: bool) -> Ints:
        pairs = self._near.within(scene, range_m)
        if not through_walls:
            start, end = scene.position[pairs[:, 0]], scene.position[pairs[:, 1]]
            keys = pairs[:, 0] * len(scene.present) + pairs[:, 1]
            pairs = pairs[~self._verdicts.blocked(scene.arena, keys, start, end)]
        if robots_occlude:
            reach_m = None if range_m is None else range_m + scene.radius_m
            pairs = pairs[~_hidden(scene, pairs, self._near.within(scene, reach_m))]
        return pairs


def _hidden(scene: Scene, pairs: Ints, near: Ints) -> Bools:
    """Return (k,) whether a third robot's disc touches the line between the robots of each of `pairs` (k, 2).

    `near` (m, 2) holds every pair of robots so near that one of them can hide something from the other.
    """
    hider, of = np.concatenate([near[:, ::-1], near]).T
    order = np.argsort(of, kind="stable")
    hider = hider[order]
    ends = np.cumsum(np.bincount(of, minlength=len(scene.present)))
    degree = np.diff(ends, prepend=0)
    hidden = np.zeros(len(pairs), dtype=np.bool_)
    work = np.cumsum(degree[pairs[:, 0]])
    first = 0
    while first < len(pairs):
        done = work[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(work, done + _TRIPLES_AT_ONCE, side="right")))
        i = pairs[first:last, 0]
        row = np.repeat(np.arange(first, last), degree[i])
        # The number of each candidate within its pair: a running count minus the start of the pair.
        k = hider[np.arange(len(row)) + np.repeat(ends[i] - (work[first:last] - done), degree[i])]
        third = k != pairs[row, 1]
        row, k = row[third], k[third]
        hidden[row[_touches(scene, pairs[row, 0], pairs[row, 1], k)]] = True
        first = last
    return hidden


def _touches(scene: Scene, i: Ints, j: Ints, k: Ints) -> Bools:
    """Return whether the disc of robot k touches the segment between the centres of i and j, elementwise."""
    x, y = scene.position.T
    dx, dy, ex, ey = x[j] - x[i], y[j] - y[i], x[k] - x[i], y[k] - y[i]
    length2 = np.maximum(dx * dx + dy * dy, np.finfo(np.float64).tiny)
    along = np.clip((ex * dx + ey * dy) / length2, 0.0, 1.0)
    touches: Bools = (ex - along * dx) ** 2 + (ey - along * dy) ** 2 <= scene.radius_m**2
    return touches
