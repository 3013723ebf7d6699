"""Reach: the receivers of broadcasts, found by their positions, so that the cost grows with receivers and not with pairs.

A receiver is in reach if it is present, its program runs, and it is not farther away than the bound of the channel's models.
All others are counted without a search: absent, switched off, or beyond the bound. A search for few senders compares
distances. For many senders it keeps the pairs within the bound and a margin, until a robot has moved half the margin.
"""

from typing import Final, NamedTuple

import numpy as np

from zwerm.world.geometry.search_tree import tree_of
from zwerm.world.scene import Bools, Floats, Ints, Scene

# The search is slightly too far, so that the model alone decides at the edge of its range.
_SLACK: Final = 1.0 + 1e-9

# Up to this many distances, comparing all is faster than keeping pairs (measured). A sender counts once, however many packets
# it sends: in real time a delayed world gets the packets of many ticks at once. It must not import a library then.
_DENSE_PAIRS: Final = 20_000

# The margin of kept pairs, as a fraction of the bound.
_MARGIN_FRACTION: Final = 0.2


class Receivers(NamedTuple):
    """The receivers of broadcasts: `ids` (k,), ascending within each sender, and how many each sender has, `counts` (t,).

    `absent`, `off` and `beyond` (t,) count the other nodes.
    """

    ids: Ints
    counts: Ints
    absent: Ints
    off: Ints
    beyond: Ints


class Reach:
    """The receivers among `members`, ids from 0 of which robots come first; a `bound_m` of infinity bounds nothing."""

    def __init__(self, members: range) -> None:
        self._members = members
        self._present: Bools | None = None
        self._off: Bools | None = None
        self._listening: Bools = np.zeros(0, dtype=np.bool_)
        self._ids: Ints = np.zeros(0, dtype=np.int64)
        self._absent = 0
        self._pairs: _NearPairs | None = None

    def find(self, scene: Scene, off: Bools, senders: Ints, bound_m: float) -> Receivers:
        """Return the receivers of one broadcast of each of `senders` (t,). `off` (nodes,) must not change in place."""
        if scene.present is not self._present or off is not self._off:
            self._listen(scene, off)
        hears = self._listening[senders]
        everyone = len(self._ids) - hears
        if bound_m == np.inf:
            ids, counts = self._all(senders, everyone)
        elif min(len(senders), len(self._ids)) * len(self._ids) <= _DENSE_PAIRS or not hears.all():
            ids, counts = self._near(scene.position, senders, bound_m * _SLACK)
        else:
            ids, counts = self._kept(scene.position, senders, bound_m * _SLACK)
        absent = np.full(len(senders), self._absent)
        if not hears.all():
            bodies = senders < len(scene.present)
            absent[bodies] -= ~scene.present[senders[bodies]]
        return Receivers(ids, counts, absent, len(self._members) - 1 - absent - everyone, everyone - counts)

    def _listen(self, scene: Scene, off: Bools) -> None:
        """Find the members that are present and switched on."""
        there = np.ones(len(off), dtype=np.bool_)
        there[: len(scene.present)] = scene.present
        chosen = np.zeros(len(off), dtype=np.bool_)
        chosen[self._members.start : self._members.stop] = True
        self._listening = chosen & there & ~off
        self._ids = np.flatnonzero(self._listening)
        self._absent = int(np.count_nonzero(chosen & ~there))
        self._present, self._off, self._pairs = scene.present, off, None

    def _all(self, senders: Ints, others: Ints) -> tuple[Ints, Ints]:
        ids = np.tile(self._ids, len(senders))
        return ids[ids != np.repeat(senders, len(self._ids))], others

    def _near(self, position: Floats, senders: Ints, bound_m: float) -> tuple[Ints, Ints]:
        """Compare the distances of all receivers, some senders at a time."""
        x, y = position[self._ids].T
        at_once = max(1, _DENSE_PAIRS // max(1, len(self._ids)))
        ids, counts = [], []
        for first in range(0, len(senders), at_once):
            chosen = senders[first : first + at_once]
            here = position[chosen]
            near = (x - here[:, :1]) ** 2 + (y - here[:, 1:]) ** 2 <= bound_m**2
            near &= self._ids != chosen[:, None]
            row, column = near.nonzero()
            ids.append(self._ids[column])
            counts.append(np.bincount(row, minlength=len(chosen)))
        return np.concatenate(ids), np.concatenate(counts)

    def _kept(self, position: Floats, senders: Ints, bound_m: float) -> tuple[Ints, Ints]:
        """Search the kept pairs, which are within the bound and its margin."""
        if self._pairs is None or not self._pairs.valid_for(position, bound_m):
            self._pairs = _NearPairs(position, self._ids, bound_m)
        return self._pairs.receivers(position, senders)


class _NearPairs:
    """The ordered pairs of `ids` within a bound and its margin at some positions (n, 2)."""

    def __init__(self, position: Floats, ids: Ints, bound_m: float) -> None:
        self._bound_m = bound_m
        self._margin_m = _MARGIN_FRACTION * bound_m
        self._position = position
        self._ids = ids
        pairs = ids[tree_of(position[ids]).query_pairs(bound_m + self._margin_m, output_type="ndarray")]
        sender, receiver = np.concatenate([pairs, pairs[:, ::-1]]).T
        self._receiver = receiver[np.argsort(sender * len(position) + receiver)]
        self._counts = np.bincount(sender, minlength=len(position))
        self._first = np.cumsum(self._counts) - self._counts

    def valid_for(self, position: Floats, bound_m: float) -> bool:
        """Return whether every pair within `bound_m` at these positions is among the kept ones."""
        if bound_m != self._bound_m:
            return False
        moved = position[self._ids] - self._position[self._ids]
        return float(np.einsum("ij,ij->i", moved, moved).max(initial=0.0)) <= (0.5 * self._margin_m) ** 2

    def receivers(self, position: Floats, senders: Ints) -> tuple[Ints, Ints]:
        """Return the receivers (k,) of `senders` (t,) within the bound, and the number of each sender's (t,)."""
        first, counts = self._first[senders], self._counts[senders]
        which = np.repeat(np.arange(len(senders)), counts)
        receiver = self._receiver[np.arange(len(which)) + np.repeat(first - np.cumsum(counts) + counts, counts)]
        apart = position[receiver] - position[senders[which]]
        near = np.einsum("ij,ij->i", apart, apart) <= self._bound_m**2
        return receiver[near], np.bincount(which[near], minlength=len(senders))
