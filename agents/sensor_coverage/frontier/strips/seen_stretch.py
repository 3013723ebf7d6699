"""A stretch of wall as one slot saw it followed, without a coordinator: the directions of the slot that end at the wall."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import product
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.strips.crossings import (
    arcs_beside_pocket,
    crossings_of_pocket,
    crossings_of_step,
)
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import FollowedStretch, Pocket, StretchEnd
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import (
    SightEnd,
    beside_edge,
    is_passed,
    united_round,
    without_edges,
)
from zwerm.agents.sensor_coverage.frontier.strips.stretches import pocket_of
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    Arc,
    Crossing,
    WalkPoint,
    arc_between,
    arcs_into,
    overlap,
    shared_arcs,
    united,
)
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE

# Slots that saw a walk beyond an edge of sight, and are named once the walk is over.
WITNESSES_MAX: Final = 1


class SeenStep(NamedTuple):
    """A step of a walk: it closes an arc while the slots `needed` stand, until one of the slots `seen` is lost."""

    before: WalkPoint
    point: WalkPoint
    needed: tuple[int, ...]
    seen: tuple[int, ...]


class SeenTouch(NamedTuple):
    """A point with this number, at which the walking robot touched the slot's robot, and the slots that saw it."""

    number: int
    point: WalkPoint
    seen: tuple[int, ...]


class KeyedArc(NamedTuple):
    """An arc that is closed while the slots `needed` stand, until one of the slots `seen` is lost.

    Beside an edge of sight it counts until the slot is lost that saw what is beyond. As NOWHERE never stands, an arc that
    needs it counts only if no edge of sight does (see `sight_ends.with_islands`).
    """

    needed: tuple[int, ...]
    seen: tuple[int, ...]
    arc: Arc


class _Crossed(NamedTuple):
    """Directions that a step or pocket crosses, and what they depend on."""

    crossing: Crossing
    needed: tuple[int, ...]
    seen: tuple[int, ...]


class SeenStretch:
    """The part of one stretch of wall that a slot saw a robot follow, with the wall at its `hand`."""

    def __init__(self, slot: int, hand: int, stretch: FollowedStretch, before: StretchEnd | None = None) -> None:
        """Begin a stretch; `before` is the last end of the stretch before it."""
        self.stretch = stretch
        self._slot, self._hand, self._before = slot, hand, before
        self._steps: list[SeenStep] = []
        self._touches: list[SeenTouch] = []
        self._edges: list[SightEnd] = []
        self._hiding: list[SightEnd] | None = None  # until something changes
        self._arcs: tuple[object, list[Arc]] | None = None

    def extend(self, stretch: FollowedStretch) -> bool:
        """Take in how far the stretch was followed; return whether that is news. Slots that tie its ends remain known."""
        old = self.stretch
        if stretch.last_number < old.last_number:
            return False
        last = stretch.last
        if stretch.last_number == old.last_number:
            last = _merged(old.last, last)
        self.stretch = stretch._replace(first=_merged(old.first, stretch.first), last=last)
        return self.stretch != old

    def add(self, step: SeenStep) -> None:
        """Take in a step."""
        self._steps.append(step)
        self._arcs = self._hiding = None

    def add_touch(self, touch: SeenTouch) -> None:
        """Take in a contact of the walking robot with the slot's robot. It counts at an end of the stretch."""
        self._touches.append(touch)
        self._arcs = None

    def add_edge(self, edge: SightEnd) -> None:
        """Take in a direction in which the slot lost sight of the walking robot, or saw it first."""
        self._edges.append(edge)
        self._hiding = None

    def lose(self, slots: Collection[int]) -> None:
        """Forget the points that one of these slots saw."""
        self._edges = [left for each in self._edges if (left := each.without(slots)) is not None]
        self._steps = [each for each in self._steps if not any(slot in each.seen for slot in slots)]
        self._touches = [each for each in self._touches if not any(slot in each.seen for slot in slots)]
        self._arcs = self._hiding = None

    def arcs(self, standing: Collection[int], contacts: tuple[float, ...] = ()) -> list[Arc]:
        """Return the arcs that are closed while these slots stand. `contacts` are directions [rad] of walls in touch."""
        ends = tuple(each for each in self._ends() if not each.is_tied(standing))
        missing = tuple({slot: None for each in self._steps for slot in each.needed if slot not in standing})
        basis = ends, missing, self.stretch.last_number, contacts
        if self._arcs is None or self._arcs[0] != basis:
            crossed = [each for each in self._crossed(ends) if not any(slot in missing for slot in each.needed)]
            closed = arcs_into([each.crossing for each in crossed])
            self._arcs = basis, [*closed, *(each.arc for each in self._beside_pockets(contacts))]
        return self._arcs[1]

    def edged_arcs(self, standing: Collection[int], contacts: tuple[float, ...] = ()) -> list[Arc]:
        """Return the arcs that are closed while these slots stand, without the directions beside loose edges of sight."""
        closed = self.arcs(standing, contacts)
        loose = [each for each in self._hiding_edges() if not each.witnesses]
        return without_edges(closed, _beside(loose, closed))

    def keyed_arcs(self, contacts: Collection[float] = ()) -> Iterator[KeyedArc]:
        """Yield the arcs that are closed, with what they depend on: also on the slots that tie the ends.

        `contacts` are directions [rad] of walls in touch.
        """
        edges, keyed = self._hiding_edges(), list(self._keyed_arcs(contacts))
        beside = list(zip(edges, _beside(edges, [each.arc for each in keyed]), strict=True))
        for each in keyed:
            yield from _divided(each, beside)

    def _hiding_edges(self) -> list[SightEnd]:
        """Return the edges of sight behind which a wall may be hidden: without those that a walk passed in sight.

        A slot that saw the walking robot all along, from one side of the direction to the other, sees the wall there: a corner
        in front of the wall would have hidden the robot, and the wall itself hides what is behind it. So it is where a robot
        goes round an obstacle several times, and its walk ends somewhere beside it.
        """
        if self._hiding is None:
            passed = self._passed() if self._edges else []
            self._hiding = [each for each in self._edges if not is_passed(beside_edge(each), passed)]
        return self._hiding

    def _passed(self) -> list[Arc]:
        """Return the directions that the walking robot passed in sight, an arc for each part of the way without a break."""
        found, part, last = list[Arc](), list[Arc](), None
        for step in self._steps:
            if step.needed or step.before is not last:
                found += united_round(part)
                part = []
            if not step.needed:
                part.append(arc_between(step.before.seen[self._slot], step.point.seen[self._slot]))
            last = step.point
        return [*found, *united_round(part)]

    def _keyed_arcs(self, contacts: Collection[float]) -> Iterator[KeyedArc]:
        """Yield the arcs that are closed, as if no edge of sight was loose."""
        ends = self._ends()
        for ties in product(*((None, *each.ties) for each in ends)):
            crossed = list(self._crossed([end for end, slot in zip(ends, ties, strict=True) if slot is None]))
            for arc in arcs_into([each.crossing for each in crossed]):
                over = [each for each in crossed if overlap(each.crossing.arc, arc) > 0.0]
                tied = [slot for slot in ties if slot is not None]
                needed, seen = (each.needed for each in over), (each.seen for each in over)
                yield KeyedArc(_union(tied, *needed), _union(*seen), arc)
        yield from self._beside_pockets(contacts)

    def _ends(self) -> list[StretchEnd]:
        """Return the ends at which the slot saw the walking robot."""
        return [each for each in (self.stretch.first, self.stretch.last) if self._slot in each.seen]

    def _crossed(self, ends: Collection[StretchEnd]) -> Iterator[_Crossed]:
        """Yield the directions that cross the way, with these loose ends."""
        for step in self._steps:
            for crossing in crossings_of_step(self._slot, step.before, step.point, self._hand, ends):
                yield _Crossed(crossing, step.needed, step.seen)
        beside: dict[bool, tuple[Pocket, tuple[int, ...]]] = {}  # a direction crosses each end once
        for pocket, seen in self._pockets():
            if pocket.in_touch or pocket.is_last not in beside:
                beside[pocket.is_last] = pocket, seen
        for pocket, seen in beside.values():
            for crossing in crossings_of_pocket(self._hand, pocket, pocket.other in ends):
                yield _Crossed(crossing, (), seen)

    def _pockets(self) -> Iterator[tuple[Pocket, tuple[int, ...]]]:
        """Yield the pockets at the ends, and the slots that saw them."""
        ends_rad = self._ends_rad()
        for number, point, seen in self._touches:
            pocket = pocket_of(self.stretch, number, point.at, point.seen[self._slot], self._before, ends_rad)
            if pocket is not None:
                yield pocket, seen

    def _ends_rad(self) -> tuple[float | None, float | None]:
        """Return the directions [rad] in which the slot saw the walking robot at the two ends, if it did."""
        if not self._steps:
            return None, None
        first, last = self._steps[0].before, self._steps[-1].point
        return (
            first.seen[self._slot] if first.at == self.stretch.first.at else None,
            last.seen[self._slot] if last.at == self.stretch.last.at else None,
        )

    def _beside_pockets(self, contacts: Collection[float]) -> Iterator[KeyedArc]:
        """Yield the arcs beside pockets."""
        for pocket, seen in self._pockets():
            for arc in arcs_beside_pocket(self._hand, pocket, contacts):
                yield KeyedArc((), seen, arc)


def _beside(edges: Sequence[SightEnd], closed: Iterable[Arc]) -> list[Arc]:
    """Return the directions beside each edge of sight of a stretch that closes some arcs."""
    whole = united(closed) if edges else ()
    return [beside_edge(each, whole) for each in edges]


def _divided(keyed: KeyedArc, edges: Iterable[tuple[SightEnd, Arc]]) -> list[KeyedArc]:
    """Return the parts of an arc: beside an edge of sight they count until its witness is lost, or need NOWHERE.

    Each edge is with the directions beside it.
    """
    parts = [keyed]
    for edge, beside in edges:
        divided = list[KeyedArc]()
        for needed, seen, arc in parts:
            divided += (KeyedArc(needed, seen, each) for each in without_edges([arc], [beside]))
            for each in shared_arcs(arc, beside):
                divided.append(KeyedArc(_union(needed, (NOWHERE,)), seen, each))
                if NOWHERE not in needed:
                    divided += (KeyedArc(needed, _union(seen, (one,)), each) for one in edge.witnesses[:WITNESSES_MAX])
        parts = divided
    return parts


def _merged(old: StretchEnd, new: StretchEnd) -> StretchEnd:
    """Return an end with all slots that are known of it, now or before."""
    return new._replace(ties=_union(old.ties, new.ties), seen=_union(old.seen, new.seen))


def _union(*several: Iterable[int]) -> tuple[int, ...]:
    """Return all slots, each once, ascending."""
    return tuple(sorted(dict.fromkeys(each for slots in several for each in slots)))
