"""The landmark complex, the bearing look-up table and the navigation graph, kept up to date observation by observation.

Algorithm 2 of Ramaithitima and Bhattacharya 2018 with free simplices only: the complex is the set of observations that are no
face of another one. The navigation graph (section IV-B) joins two of them that share at least `SHARED_MIN` landmarks; its
edge costs 1 / (shared - 1) (section IV-C). The result does not depend on the order of the observations.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Final

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot

# n_l of section IV-B: the number of landmarks that fix a bearing-only target.
SHARED_MIN: Final = 2

# Of two snapshots of the same landmarks the one with the smaller rank is kept: (number in its origin's log, origin).
Rank = tuple[int, int]

Simplex = tuple[int, ...]


class LandmarkComplex:
    """Free simplices, each with a number of its own and its neighbours.

    `simplices[v]` are the landmarks of vertex v, ascending; `neighbours[v]` maps the vertices next to v to how many landmarks
    they share. Both hold vertices that are free now; `landmarks_of` also those that were.
    """

    def __init__(self) -> None:
        self.simplices: dict[int, Simplex] = {}
        self.neighbours: dict[int, dict[int, int]] = {}
        self._ever: list[Simplex] = []
        self._holders: dict[int, set[int]] = {}  # landmark: the vertices that contain it
        self._bearings: dict[Simplex, tuple[Rank, tuple[int, ...]]] = {}

    @property
    def vertices(self) -> int:
        """Number of vertices ever added; all vertex numbers are lower."""
        return len(self._ever)

    def landmarks_of(self, vertex: int) -> Simplex:
        """Return the landmarks of a vertex that is or was free."""
        return self._ever[vertex]

    def snapshot_of(self, vertex: int) -> BearingSnapshot:
        """Return a vertex as it was observed: its entry in the bearing look-up table."""
        simplex = self._ever[vertex]
        return BearingSnapshot(simplex, self._bearings[simplex][1])

    def bearings_of(self, simplex: Simplex) -> tuple[int, ...] | None:
        """Return the bearings at which exactly these landmarks were observed, or None where they never were."""
        found = self._bearings.get(simplex)
        return found and found[1]

    @property
    def table(self) -> dict[Simplex, tuple[int, ...]]:
        """The bearing look-up table, by landmarks ascending."""
        return {simplex: self._bearings[simplex][1] for simplex in sorted(self._bearings)}

    def smallest_landmark(self) -> int | None:
        """Return the smallest id of all landmarks, or None without any."""
        return min(self._holders, default=None)

    def contains(self, landmarks: Iterable[int]) -> bool:
        """Return whether these landmarks are a face of the complex. No landmarks are one."""
        common: set[int] | None = None
        for landmark in landmarks:
            holders = self._holders.get(landmark)
            if holders is None:
                return False
            common = holders if common is None else common & holders
            if not common:
                return False
        return True

    def containing(self, a: int, b: int) -> set[int]:
        """Return the vertices that contain two landmarks."""
        return self._holders.get(a, set()) & self._holders.get(b, set())

    def update(self, snapshot: BearingSnapshot, rank: Rank = (0, 0)) -> bool:
        """Add an observation (algorithm 2); return whether the complex has a new simplex."""
        simplex = snapshot.landmarks
        known = self._bearings.get(simplex)
        if known is not None:
            if rank < known[0]:
                self._bearings[simplex] = rank, snapshot.bearings
            return False
        if not simplex:
            return False
        self._bearings[simplex] = rank, snapshot.bearings
        shared = self.shared_with(simplex)
        if max(shared.values(), default=0) == len(simplex):
            return False  # it is a face
        self._insert(simplex, shared)
        return True

    def shared_with(self, landmarks: Sequence[int]) -> Mapping[int, int]:
        """Return the vertices that share landmarks with these, and how many."""
        holders = self._holders
        return Counter(chain.from_iterable([holders[each] for each in landmarks if each in holders]))

    def adjacent(self, landmarks: Sequence[int]) -> dict[int, int]:
        """Return the vertices that share enough landmarks with these to navigate by, and how many."""
        return {vertex: count for vertex, count in self.shared_with(landmarks).items() if count >= SHARED_MIN}

    def _insert(self, simplex: Simplex, shared: Mapping[int, int]) -> None:
        vertex = len(self._ever)
        self._ever.append(simplex)
        around: dict[int, int] = {}
        for other, count in shared.items():
            if count == len(self.simplices[other]):
                self._remove(other)
            elif count >= SHARED_MIN:
                around[other] = count
                self.neighbours[other][vertex] = count
        self.simplices[vertex] = simplex
        self.neighbours[vertex] = around
        for landmark in simplex:
            self._holders.setdefault(landmark, set()).add(vertex)

    def _remove(self, vertex: int) -> None:
        for landmark in self.simplices.pop(vertex):
            self._holders[landmark].discard(vertex)
        for other in self.neighbours.pop(vertex):
            del self.neighbours[other][vertex]

    def edges(self) -> set[tuple[int, int]]:
        """Return the edges of the 1-skeleton of the complex, each (smaller id, larger id)."""
        return {(a, b) for simplex in self.simplices.values() for i, a in enumerate(simplex) for b in simplex[i + 1 :]}
