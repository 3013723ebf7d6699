"""The map of ends, ports and mates, derived from a set of facts, and the certificate of complete coverage.

Every end of a segment has a mate, the other end, once the segment is swept. It also has two ports, the arcs of the
boundary that leave it to either side. Coverage is complete if and only if no end lacks its mate and no port is open.
Then every slab between two slices is bounded by swept segments and traced arcs only. The spacing must be at most twice
the footprint's radius. It must also be at most the sum of the footprint's radius and the body's diameter. Then an
obstacle between two slices that no arc reaches hides nothing.

A wreck may hide ends. They are ignored while the wreck is there: its own footprint covers that place, and arcs lead
around it. A wreck also blocks ways that were free. Ways therefore prefer segments and arcs that were observed beside
the wreck. An end may have no way to any open end or port. Then all that a robot can reach from it is covered if and
only if every end within reach has a mate and two arcs, none of them blocked. The rest of the map is still open.

A slice may graze an obstacle: one robot stops there, and another sweeps past. An end inside a swept segment ends no
space that is left to cover, and is ignored too.

A virtual frontier cuts a slice into two parts. The two ends there need mates, and have no ports: nothing of the boundary is
there. A way leads across, from the one to the other. After a later sweep past the frontier they are ignored.

Ends that two robots measured a little differently are one: those of one slice and side are joined where neighbours are at most
`TOLERANCE_MM` apart. The joined ends are a function of the set of facts alone, so maps may be merged in any order.
"""

import heapq
from collections.abc import Collection, Iterable
from typing import Final, NamedTuple

from zwerm.agents.robot_teams.mapping.facts import LEFT, RIGHT, End, Fact, FactSet, SweptSegment, TracedArc, Void, Wreck

TOLERANCE_MM: Final = 120

# The direction of the step across a virtual frontier.
ACROSS: Final = 2

# A port: an end, and the side on which the arc leaves.
Port = tuple[End, int]


class Step(NamedTuple):
    """One way from an end to another: along the swept segment (`direction` 0), along the arc on that side, or `ACROSS`."""

    direction: int
    stop: End
    length_mm: int


class CoverageCertificate(NamedTuple):
    """The reason why coverage is complete, or the ends and ports that are missing."""

    ends: int
    ends_without_mate: tuple[End, ...]
    open_ports: tuple[Port, ...]

    @property
    def complete(self) -> bool:
        """True if at least one end is known and nothing is open."""
        return self.ends > 0 and not self.ends_without_mate and not self.open_ports


class SliceMap:
    """A robot's map of the free space: its facts, and the graph of ends that follows from them."""

    def __init__(self) -> None:
        self.facts = FactSet()
        self._known = -1
        self._levels: dict[tuple[int, int], list[tuple[int, int, End]]] = {}
        self._mates: dict[End, Step] = {}
        self._arcs: dict[Port, Step] = {}
        self._by_slice: dict[int, list[SweptSegment]] = {}
        self._voids: list[Void] = []
        self._wrecks: frozenset[Wreck] = frozenset()
        self._across: dict[End, Step] = {}
        self._closed: dict[End, bool] = {}
        self._distances: dict[End, dict[End, int]] = {}
        self._certificate = CoverageCertificate(0, (), ())

    def add(self, fact: Fact) -> bool:
        """Add one fact; return whether it is new."""
        return self.facts.add(fact)

    def merge(self, facts: Iterable[Fact]) -> int:
        """Add all of `facts`; return how many are new."""
        return sum([self.facts.add(fact) for fact in facts])

    def end(self, end: End) -> End | None:
        """Return the known end that `end` is a measurement of, or None."""
        self._derive()
        nearest, apart = None, TOLERANCE_MM + 1
        for low, high, known in self._levels.get((end.slice, end.side), ()):
            distance = max(low - end.y_mm, end.y_mm - high, 0)
            if distance < apart:
                nearest, apart = known, distance
        return nearest

    def mate(self, end: End) -> Step | None:
        """Return the way along the swept segment of a known end, or None while it is not swept, or blocked."""
        self._derive()
        return self._mates.get(end)

    def arc(self, end: End, direction: int) -> Step | None:
        """Return the way along the arc that leaves a known end on the side `direction`, or None while it is open."""
        self._derive()
        return self._arcs.get((end, direction))

    def is_swept(self, k: int, y_mm: int) -> bool:
        """Return whether a swept segment of slice k reaches within the tolerance of the height y."""
        self._derive()
        low, high = y_mm - 4 * TOLERANCE_MM, y_mm + 4 * TOLERANCE_MM
        return any(segment.bottom_mm <= high and segment.top_mm >= low for segment in self._by_slice.get(k, ()))

    @property
    def arcs_known(self) -> bool:
        """True if any arc was traced."""
        self._derive()
        return bool(self._arcs)

    @property
    def certificate(self) -> CoverageCertificate:
        """The open ends and ports, sorted."""
        self._derive()
        return self._certificate

    @property
    def voids(self) -> list[Void]:
        """The ends that wrecks hide."""
        self._derive()
        return self._voids

    @property
    def wrecks(self) -> frozenset[Wreck]:
        """The wrecks that any fact names: each may divide the space that was joined before."""
        self._derive()
        return self._wrecks

    def complete_from(self, at: End | None) -> bool:
        """Return whether all is covered that a robot at the known end `at` can reach; None: it is somewhere else."""
        certificate = self.certificate
        return certificate.complete or (certificate.ends > 0 and at is not None and self._is_closed(at))

    def openings(self, reached: Collection[End]) -> CoverageCertificate:
        """Return which of the ends in `reached` lack a mate, or arcs, that nothing blocks."""
        self._derive()
        ends = sorted(reached)
        return CoverageCertificate(
            len(ends),
            tuple([end for end in ends if end not in self._mates]),
            tuple([port for port in self._ports(ends) if port not in self._arcs]),
        )

    def is_virtual(self, end: End) -> bool:
        """Return whether a known end is one at a virtual frontier."""
        self._derive()
        return end in self._across

    def _is_closed(self, at: End) -> bool:
        if at not in self._closed:
            reached = self.distances(at)
            self._closed.update(dict.fromkeys(reached, self.openings(reached).complete))
        return self._closed[at]

    def distances(self, start: End) -> dict[End, int]:
        """Return the length [mm] of the shortest known way from a known end to every end that can be reached."""
        self._derive()
        found = self._distances.get(start)
        if found is None:
            found = {end: length for end, (length, _) in self._shortest(start).items()}
            self._distances[start] = found
        return found

    def route(self, start: End, stop: End, avoid: Collection[Port] = ()) -> list[tuple[End, Step]] | None:
        """Return the shortest known way as (end, step) pairs; empty where start is stop, None where there is none.

        It leaves no end in a direction that `avoid` has for it.
        """
        found = self._shortest(start, avoid)
        if stop not in found:
            return None
        steps: list[tuple[End, Step]] = []
        while stop != start:
            previous = found[stop][1]
            assert previous is not None
            steps.append(previous)
            stop = previous[0]
        return steps[::-1]

    def _shortest(self, start: End, avoid: Collection[Port] = ()) -> dict[End, tuple[int, tuple[End, Step] | None]]:
        self._derive()
        found: dict[End, tuple[int, tuple[End, Step] | None]] = {start: (0, None)}
        heap = [(0, start)]
        while heap:
            length, end = heapq.heappop(heap)
            if length > found[end][0]:
                continue
            for step in (
                self._mates.get(end),
                self._arcs.get((end, LEFT)),
                self._arcs.get((end, RIGHT)),
                self._across.get(end),
            ):
                if step is None or (avoid and (end, step.direction) in avoid):
                    continue
                total = length + step.length_mm
                if step.stop not in found or total < found[step.stop][0]:
                    found[step.stop] = total, (end, step)
                    heapq.heappush(heap, (total, step.stop))
        return found

    def _derive(self) -> None:
        """Compute ends, mates and arcs again if facts were added."""
        if len(self.facts) == self._known:
            return
        self._known = len(self.facts)
        self._closed.clear()
        self._distances.clear()
        segments, arcs, voids = self.facts.segments, self.facts.arcs, self.facts.voids
        self._voids = voids
        named = [fact.wrecks for fact in segments] + [fact.wrecks for fact in arcs] + [fact.wrecks for fact in voids]
        self._wrecks = frozenset([wreck for wrecks in named for wreck in wrecks])
        measured = [end for arc in arcs for end in (arc.start, arc.stop)]
        measured += [end for segment in segments for end in segment.ends]
        measured += [end for cut in self.facts.cuts for end in cut.ends]
        self._levels = _joined([end for end in measured if not any(_hides(void, end) for void in voids)])
        self._mates, self._arcs, self._by_slice = {}, {}, {}
        ends = sorted(end for level in self._levels.values() for _, _, end in level)
        mated: set[End] = set()
        joined: set[Port] = set()
        # An observation beside a wreck comes first: it is the way that is free now.
        for segment in sorted(segments, key=_wrecks_first):
            self._by_slice.setdefault(segment.slice, []).append(segment)
            top, bottom = map(self._known_end, segment.ends)
            mated.update([known for known in (top, bottom) if known is not None])
            if top is None or bottom is None or any(_blocks(void, segment) for void in voids):
                continue
            length = segment.top_mm - segment.bottom_mm
            self._mates.setdefault(top, Step(0, bottom, length))
            self._mates.setdefault(bottom, Step(0, top, length))
        for arc in sorted(arcs, key=_wrecks_first):
            (one, there), (other, back) = arc.ports
            start, stop = self._known_end(one), self._known_end(other)
            joined.update([(known, side) for known, side in ((start, there), (stop, back)) if known is not None])
            if start is not None and stop is not None:
                self._arcs.setdefault((start, there), Step(there, stop, arc.length_mm))
                self._arcs.setdefault((stop, back), Step(back, start, arc.length_mm))
        self._find_across()
        counting = [end for end in ends if not self._is_passed(end)]
        self._certificate = CoverageCertificate(
            len(ends),
            tuple([end for end in counting if end not in mated]),
            tuple([port for port in self._ports(counting) if port not in joined]),
        )

    def _known_end(self, end: End) -> End | None:
        """Return the name of a measured end; None where a wreck hides it."""
        for low, high, known in self._levels.get((end.slice, end.side), ()):
            if low <= end.y_mm <= high:
                return known
        return None

    def _ports(self, ends: Iterable[End]) -> list[Port]:
        return [(end, side) for end in ends if end not in self._across for side in (LEFT, RIGHT)]

    def _find_across(self) -> None:
        """Find the ways across frontiers: where both ends of a cut are joined with no measured end of the boundary."""
        self._across = {}
        for cut in self.facts.cuts:
            lower, upper = cut.ends
            levels = [(level, end) for end in (lower, upper) for level in self._levels.get((end.slice, end.side), ())]
            alone = [level[2] for level, end in levels if level == (end.y_mm, end.y_mm, end)]
            if len(alone) == 2:
                self._across[lower] = Step(ACROSS, upper, 0)
                self._across[upper] = Step(ACROSS, lower, 0)

    def _is_passed(self, end: End) -> bool:
        """Return whether a robot swept past an end."""
        low, high = end.y_mm - TOLERANCE_MM, end.y_mm + TOLERANCE_MM
        return any(segment.bottom_mm < low and high < segment.top_mm for segment in self._by_slice.get(end.slice, ()))


def _wrecks_first(fact: SweptSegment | TracedArc) -> tuple[bool, int, SweptSegment | TracedArc]:
    """Return the rank of a way: beside a wreck before others, and of two segments the longer one."""
    return not fact.wrecks, fact.bottom_mm - fact.top_mm if isinstance(fact, SweptSegment) else 0, fact


def _blocks(void: Void, segment: SweptSegment) -> bool:
    return void.slice == segment.slice and void.low_mm < segment.top_mm and segment.bottom_mm < void.high_mm


def _hides(void: Void, end: End) -> bool:
    return void.slice == end.slice and void.low_mm <= end.y_mm <= void.high_mm


def _joined(ends: Iterable[End]) -> dict[tuple[int, int], list[tuple[int, int, End]]]:
    """Return by slice and side the groups of neighbouring ends, ascending: the lowest, the highest, and its name."""
    levels: dict[tuple[int, int], list[tuple[int, int, End]]] = {}
    for end in sorted(set(ends)):
        level = levels.setdefault((end.slice, end.side), [])
        if level and end.y_mm - level[-1][1] <= TOLERANCE_MM:
            low, _, known = level[-1]
            level[-1] = low, end.y_mm, known
        else:
            level.append((end.y_mm, end.y_mm, end))
    return levels
