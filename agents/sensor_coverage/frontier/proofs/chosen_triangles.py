"""Triangles of a slot, a neighbour and points of walks: which of them count on each side of the edge between the slots."""

from collections.abc import Collection, Iterable, Iterator
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.proofs.walk_arcs import relies_on_less
from zwerm.agents.sensor_coverage.messages.pushes import ProvedArc, WalkTriangle

# Triangles that are kept on a side of an edge. Without the others more arcs may be open.
KEPT_MAX: Final = 60
# Triangles whose angles at both slots differ by less than this [rad] are one.
EQUAL_RAD: Final = 1e-6


class _KeptTriangle(NamedTuple):
    """A triangle, and its arc at the slot."""

    arc: ProvedArc
    triangle: WalkTriangle

    @property
    def rank(self) -> tuple[float, int, int]:
        """A number that is smaller for a larger sum of angles at both slots, and the number of the point."""
        return -self.arc.width_rad - self.triangle.there_rad, self.triangle.walk, self.triangle.number


class ChosenTriangles:
    """The triangles of one slot, by their arcs there.

    Two triangles with different points may cross. If one slot relied on one of them and its neighbour on the other, each
    would be responsible for space between the two points that neither sees. It has a wall around it if the walk led from one
    point to the other around this space, along one stretch of wall: where a stretch ends, a robot may have stood in front of an
    opening. If it led round the other way, or the points are of different stretches, only the triangle with the larger sum of
    its angles at the two slots counts, which both know.
    """

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int], list[_KeptTriangle]] = {}  # by the slot beside and the side
        # The same of those that could count at the latest question, and the arcs that were chosen of them.
        self._chosen: dict[tuple[int, int], tuple[list[_KeptTriangle], list[ProvedArc]]] = {}
        # The slots of the latest question, and the answer, until something changes.
        self._latest: tuple[Collection[int], list[ProvedArc]] | None = None

    def add(self, arc: ProvedArc, triangle: WalkTriangle) -> None:
        """Take in the arc of a triangle, unless it is within another one that relies on less."""
        key, fresh = (triangle.beside, triangle.side), _KeptTriangle(arc, triangle)
        known = self._kept.get(key, [])
        if not any(_is_within(fresh, each) for each in known):
            found = [*(each for each in known if not _is_within(each, fresh)), fresh]
            found.sort(key=lambda each: each.rank)
            self._kept[key] = _without_inner(found)[:KEPT_MAX]
            self._latest = None

    def lose(self, slots: Collection[int]) -> None:
        """Forget the triangles with points that one of these slots saw."""
        self._latest = None
        for key, known in self._kept.items():
            self._kept[key] = [each for each in known if not any(slot in each.arc.seen for slot in slots)]

    def counting(self, standing: Collection[int]) -> list[ProvedArc]:
        """Return the arcs that count while these slots stand. The same collection has the same slots later."""
        if self._latest is None or self._latest[0] is not standing:
            self._latest = standing, self._find_counting(standing)
        return self._latest[1]

    def _find_counting(self, standing: Collection[int]) -> list[ProvedArc]:
        found, stand = list[ProvedArc](), frozenset(standing)
        for key, known in self._kept.items():
            counts = [each for each in known if stand.issuperset(each.arc.needed)]
            if key not in self._chosen or self._chosen[key][0] != counts:
                self._chosen[key] = counts, _chosen_of(counts)
            found += self._chosen[key][1]
        return found

    def all(self) -> Iterator[ProvedArc]:
        """Yield all arcs, also those that do not count."""
        for known in self._kept.values():
            yield from (each.arc for each in known)


def _chosen_of(known: Iterable[_KeptTriangle]) -> list[ProvedArc]:
    """Return the arcs of triangles that count together, by falling rank."""
    chosen = list[_KeptTriangle]()
    for each in known:
        if not any(_exclude(each, one) for one in chosen):
            chosen.append(each)
    return [each.arc for each in chosen]


def _exclude(a: _KeptTriangle, b: _KeptTriangle) -> bool:
    """Return whether two triangles cross, and no followed wall leads from one point to the other around the space between."""
    wider, there = a.arc.width_rad - b.arc.width_rad, a.triangle.there_rad - b.triangle.there_rad
    if wider * there >= -(EQUAL_RAD**2):
        return False
    if (a.triangle.walk, a.triangle.stretch) != (b.triangle.walk, b.triangle.stretch):
        return True
    later_is_wider = (a.triangle.number - b.triangle.number) * wider > 0.0
    return later_is_wider != (a.triangle.hand * a.triangle.side < 0)


def _is_within(a: _KeptTriangle, b: _KeptTriangle) -> bool:
    """Return whether a triangle is within another one that relies on less."""
    return (
        a.arc.width_rad <= b.arc.width_rad + EQUAL_RAD
        and a.triangle.there_rad <= b.triangle.there_rad + EQUAL_RAD
        and relies_on_less((b.arc.needed, b.arc.seen), (a.arc.needed, a.arc.seen))
    )


def _without_inner(found: Iterable[_KeptTriangle]) -> list[_KeptTriangle]:
    """Return the triangles that have, of those of a stretch with the same witnesses, the best rank or the largest angle."""
    groups = dict[object, list[_KeptTriangle]]()
    for each in found:
        key = each.triangle.walk, each.triangle.stretch, each.arc.needed, each.arc.seen
        groups.setdefault(key, []).append(each)
    outer = [
        each
        for group in groups.values()
        for each in (
            group[0],
            max(group, key=lambda one: one.arc.width_rad),
            max(group, key=lambda one: one.triangle.there_rad),
        )
    ]
    kept = {id(each) for each in outer}
    return [each for each in found if id(each) in kept]
