"""Facts about the free space that a robot observed: swept segments and traced arcs. A set of facts only grows.

Slice `k` is the line x = origin + k * spacing. The configuration space of the body's centre meets it in segments. The upper end
of a segment is a TOP end, the lower one a BOTTOM end. An arc is the part of the boundary between two consecutive crossings of
slices. Two sets of facts merge by union, which is commutative, associative and idempotent, so lost, late and copied
messages can do no harm. Lengths are whole millimetres: equal facts are equal bytes on every robot.

A dead robot is an obstacle. A fact that a robot observed at such an obstacle names the `Wreck`. A sign of life of that
robot is a fact too. It makes all facts void that name one of the robot's earlier wrecks.
"""

from bisect import insort
from itertools import islice
from typing import Final, NamedTuple
from zlib import crc32

TOP: Final = 1
BOTTOM: Final = -1
RIGHT: Final = 1
LEFT: Final = -1

# The kinds of arc. At a critical point the arc returns to the slice it left.
PASSES: Final = 0
CONVEX: Final = 1
CONCAVE: Final = -1


class Wreck(NamedTuple):
    """Robot `node` was taken for dead at `tick`."""

    node: int
    tick: int


class End(NamedTuple):
    """The end of a segment of slice `slice`: on its side TOP or BOTTOM, at height `y_mm`."""

    slice: int
    side: int
    y_mm: int


class SweptSegment(NamedTuple):
    """A robot swept slice `slice` from `bottom_mm` to `top_mm`, wall to wall, or to one of the `wrecks`."""

    slice: int
    bottom_mm: int
    top_mm: int
    wrecks: tuple[Wreck, ...] = ()

    @property
    def ends(self) -> tuple[End, End]:
        """The upper and the lower end."""
        return End(self.slice, TOP, self.top_mm), End(self.slice, BOTTOM, self.bottom_mm)


class TracedArc(NamedTuple):
    """A robot followed the boundary from one end into the slab on its side `direction`, until it came to another end.

    The arc is `length_mm` long. Its point farthest from the first slice is (`x_mm`, `y_mm`): where the arc returns, that is the
    critical point. The robot touched the `wrecks` on the way.
    """

    start: End
    direction: int
    stop: End
    length_mm: int
    x_mm: int
    y_mm: int
    wrecks: tuple[Wreck, ...] = ()

    @property
    def kind(self) -> int:
        """PASSES to the next slice; or around an obstacle (CONVEX), or around free space (CONCAVE), back to its own."""
        if self.stop.slice != self.start.slice:
            return PASSES
        return CONVEX if (self.stop.y_mm - self.start.y_mm) * self.start.side > 0 else CONCAVE

    @property
    def ports(self) -> tuple[tuple[End, int], tuple[End, int]]:
        """The two ports that the arc joins: an end, and the side on which the arc leaves it."""
        back = self.direction if self.stop.slice == self.start.slice else -self.direction
        return (self.start, self.direction), (self.stop, back)


class Void(NamedTuple):
    """A wreck at `x_mm` hides the ends of slice `slice` between two heights: no robot can reach them any more."""

    slice: int
    x_mm: int
    low_mm: int
    high_mm: int
    wreck: Wreck

    @property
    def wrecks(self) -> tuple[Wreck, ...]:
        """The wreck, as a tuple, as in the other kinds of facts."""
        return (self.wreck,)


class FrontierCut(NamedTuple):
    """A virtual frontier at height `y_mm` cuts slice `slice`: the free space goes on above and below."""

    slice: int
    y_mm: int

    @property
    def ends(self) -> tuple[End, End]:
        """The end of the lower part, and that of the upper part."""
        return End(self.slice, TOP, self.y_mm), End(self.slice, BOTTOM, self.y_mm)


class Return(NamedTuple):
    """Robot `node` was alive at `tick`, so it was no wreck before."""

    node: int
    tick: int


Fact = SweptSegment | TracedArc | Void | FrontierCut | Return


class FactSet:
    """A grow-only set of facts. `digest` is equal for equal sets, and with certainty 1 - 2**-32 only for those.

    The facts of each kind are kept sorted, so that the order of arrival has no influence.
    """

    def __init__(self) -> None:
        self._facts: dict[Fact, None] = {}
        self.digest = 0
        self.alive_ticks: dict[int, int] = {}  # the newest proof of life of each robot that was wrongly taken for dead
        self._segments: list[SweptSegment] = []
        self._arcs: list[TracedArc] = []
        self._voids: list[Void] = []
        self._cuts: list[FrontierCut] = []

    def __len__(self) -> int:
        return len(self._facts)

    def __contains__(self, fact: Fact) -> bool:
        return fact in self._facts

    def add(self, fact: Fact) -> bool:
        """Add one fact; return whether it is new."""
        if fact in self._facts:
            return False
        self._facts[fact] = None
        self.digest ^= crc32(repr(tuple(fact)).encode())
        if isinstance(fact, TracedArc):
            insort(self._arcs, fact)
        elif isinstance(fact, SweptSegment):
            insort(self._segments, fact)
        elif isinstance(fact, Void):
            insort(self._voids, fact)
        elif isinstance(fact, FrontierCut):
            insort(self._cuts, fact)
        else:
            self.alive_ticks[fact.node] = max(fact.tick, self.alive_ticks.get(fact.node, fact.tick))
        return True

    def since(self, count: int) -> list[Fact]:
        """Return the facts in the order in which they were added, without the first `count`."""
        return list(islice(self._facts, count, None))

    @property
    def segments(self) -> list[SweptSegment]:
        """The swept segments that hold, sorted."""
        return (
            [fact for fact in self._segments if self._holds(fact.wrecks)] if self.alive_ticks else self._segments.copy()
        )

    @property
    def voids(self) -> list[Void]:
        """The facts about ends that wrecks hide, sorted."""
        return [fact for fact in self._voids if self._holds(fact.wrecks)] if self.alive_ticks else self._voids.copy()

    @property
    def cuts(self) -> list[FrontierCut]:
        """The cuts of slices by virtual frontiers, sorted."""
        return self._cuts.copy()

    @property
    def arcs(self) -> list[TracedArc]:
        """The traced arcs that hold, sorted."""
        return [fact for fact in self._arcs if self._holds(fact.wrecks)] if self.alive_ticks else self._arcs.copy()

    def _holds(self, wrecks: tuple[Wreck, ...]) -> bool:
        """Return whether no robot that is named in `wrecks` was alive later."""
        alive = self.alive_ticks
        return all(wreck.tick >= alive.get(wreck.node, wreck.tick) for wreck in wrecks)
