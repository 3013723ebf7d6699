"""Which robots saw the points of a walk, as the walking robot keeps it."""

from typing import Final, NamedTuple

# Points for which it is remembered who saw them, and points in which it is repeated who sees the walking robot again. Who
# misses more points than the latter takes them as unseen.
REMEMBERED_POINTS: Final = 60
RESENT_POINTS: Final = 10


class _Hidden(NamedTuple):
    """A robot sees the walking robot again at the point `number`, after `last`; and the robots that saw the points between.

    The first and the last of `between` are those of the first and the last point. If the robot never saw the walking robot
    before, `last` is 0, and only the latest of these points counts.
    """

    number: int
    last: int
    between: tuple[tuple[int, ...], ...]


class Sightlines:
    """Which robots saw the points of this robot's walk, and which see it again after they had lost it."""

    def __init__(self) -> None:
        self._seen: dict[int, tuple[int, ...]] = {}  # the latest points
        self._last: dict[int, int] = {}
        self._first_hidden: dict[int, tuple[int, ...]] = {}  # by robot: who saw the point after its latest one
        self._hidden: dict[int, _Hidden] = {}

    def take(self, number: int, seen: tuple[int, ...]) -> tuple[tuple[int, int, tuple[tuple[int, ...], ...]], ...]:
        """Take in the robots that see a point, and return those that see the walking robot again; see `PassedPoint`."""
        for node in seen:
            last = self._last.get(node)
            if last is not None and last < number - 1:
                # Points that are forgotten were seen by nobody, as far as is known, but for the first one.
                between = [self._seen.get(each, ()) for each in range(last + 2, number)]
                between = list(dict.fromkeys([self._first_hidden[node], *between]))
                if between[-1] != self._seen[number - 1]:
                    between.append(self._seen[number - 1])
                self._hidden[node] = _Hidden(number, last, tuple(between))
            elif last is None and number > 1:
                self._hidden[node] = _Hidden(number, 0, (self._seen.get(number - 1, ()),))
            self._last[node] = number
        for node, last in self._last.items():
            if last == number - 1:
                self._first_hidden[node] = seen
        self._seen[number] = seen
        self._seen.pop(number - REMEMBERED_POINTS, None)
        self._hidden = {node: each for node, each in self._hidden.items() if each.number > number - RESENT_POINTS}
        return tuple((node, each.last, each.between) for node, each in self._hidden.items() if node in seen)
