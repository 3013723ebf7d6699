"""The arcs of a slot that walks closed, with the slots on which they rely."""

from collections.abc import Collection, Iterator

from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, contains, united

# The slots that must stand, and those that saw the walk.
Witnesses = tuple[tuple[int, ...], tuple[int, ...]]


def relies_on_less(a: Witnesses, b: Witnesses) -> bool:
    """Return whether what relies on the witnesses `a` counts at least as long as what relies on `b`."""
    return set(a[0]) <= set(b[0]) and set(a[1]) <= set(b[1])


class WalkArcs:
    """Arcs that count while some slots stand, until a slot that saw the walk is lost. Those that add nothing are dropped."""

    def __init__(self) -> None:
        self._arcs: dict[Witnesses, list[Arc]] = {}

    def add(self, witnesses: Witnesses, arc: Arc) -> None:
        """Take in an arc."""
        if any(relies_on_less(key, witnesses) and contains(arcs, arc) for key, arcs in self._arcs.items()):
            return
        joined = self._arcs[witnesses] = united([*self._arcs.get(witnesses, ()), arc])
        for key in [key for key in self._arcs if key != witnesses and relies_on_less(witnesses, key)]:
            left = [each for each in self._arcs[key] if not contains(joined, each)]
            if left:
                self._arcs[key] = left
            else:
                del self._arcs[key]

    def counting(self, standing: Collection[int]) -> Iterator[Arc]:
        """Yield the arcs that count while these slots stand."""
        stand = frozenset(standing)
        for (needed, _), arcs in self._arcs.items():
            if stand.issuperset(needed):
                yield from arcs

    def unconditional(self) -> list[Arc]:
        """Return the arcs that rely on no other slot."""
        return self._arcs.get(((), ()), [])

    def lose(self, slots: Collection[int]) -> None:
        """Forget the arcs of walks that one of these slots saw."""
        self._arcs = {key: arcs for key, arcs in self._arcs.items() if not any(each in key[1] for each in slots)}

    def all(self) -> Iterator[tuple[Witnesses, Arc]]:
        """Yield all arcs, also those that do not count."""
        for key, arcs in self._arcs.items():
            for arc in arcs:
                yield key, arc
