"""Facts about the free space that a robot observed: swept segments and traced arcs. A set of facts only grows.

Slice `k` is the line x = origin + k * spacing. The configuration space of the body's centre meets it in segments. The upper end
of a segment is a TOP end, the lower one a BOTTOM end. An arc is the part of the boundary between two consecutive crossings of
slices. Two sets of facts merge by union, which is commutative, associative and idempotent, so that lost, late and copied
messages can do no harm. Lengths are whole millimetres: equal facts are equal bytes on every robot.
"""

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


class End(NamedTuple):
    """The end of a segment of slice `slice`: on its side TOP or BOTTOM, at height `y_mm`."""

    slice: int
    side: int
    y_mm: int


class Segment(NamedTuple):
    """A robot swept slice `slice` from `bottom_mm` to `top_mm`, wall to wall."""

    slice: int
    bottom_mm: int
    top_mm: int

    @property
    def ends(self) -> tuple[End, End]:
        """The upper and the lower end."""
        return End(self.slice, TOP, self.top_mm), End(self.slice, BOTTOM, self.bottom_mm)


class Arc(NamedTuple):
    """A robot followed the boundary from one end into the slab on its side `direction`, until it came to another end.

    The arc is `length_mm` long. Its point farthest from the first slice is (`x_mm`, `y_mm`): where the arc returns, that is the
    critical point.
    """

    start: End
    direction: int
    stop: End
    length_mm: int
    x_mm: int
    y_mm: int

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
    """A dead robot at `x_mm` hides the ends of slice `slice` between two heights: nobody can reach them any more."""

    slice: int
    x_mm: int
    low_mm: int
    high_mm: int


Fact = Segment | Arc | Void


class FactSet:
    """A grow-only set of facts. `digest` is equal for equal sets, and with certainty 1 - 2**-32 only for those."""

    def __init__(self) -> None:
        self._facts: dict[Fact, None] = {}
        self.digest = 0

    def __len__(self) -> int:
        return len(self._facts)

    def __contains__(self, fact: Fact) -> bool:
        return fact in self._facts

    def add(self, fact: Fact) -> bool:
        """Add one fact; tell whether it is new."""
        if fact in self._facts:
            return False
        self._facts[fact] = None
        self.digest ^= crc32(repr(tuple(fact)).encode())
        return True

    def since(self, count: int) -> list[Fact]:
        """Return the facts in the order in which they were added, without the first `count`."""
        return list(self._facts)[count:]

    @property
    def segments(self) -> list[Segment]:
        """The swept segments, sorted: the order of arrival has no influence."""
        return sorted(fact for fact in self._facts if isinstance(fact, Segment))

    @property
    def voids(self) -> list[Void]:
        """What dead robots hide, sorted."""
        return sorted(fact for fact in self._facts if isinstance(fact, Void))

    @property
    def arcs(self) -> list[Arc]:
        """The traced arcs, sorted."""
        return sorted(fact for fact in self._facts if isinstance(fact, Arc))
