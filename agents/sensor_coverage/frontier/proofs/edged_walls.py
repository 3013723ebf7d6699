"""What followed walls close at each slot beside edges of sight (`zwerm.agents.sensor_coverage.frontier.strips.sight_ends`)."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import SeenEnd, edged_arcs
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc

# The edges of sight of each stretch of wall.
EdgesByStretch = dict[int, list[SeenEnd]]


class SlotWalls(NamedTuple):
    """The arcs of a slot that stretches of wall, contacts, and walls close to it close, and its edges of sight by stretch."""

    by_stretch: Mapping[int, Sequence[Arc]]
    contacts: Sequence[Arc]
    near: Sequence[Arc]
    edges: EdgesByStretch


class EdgedWalls:
    """The arcs of walls of all slots without the directions beside loose edges of sight.

    `relies` returns whether a slot may rely on another one in a direction [rad], and None if it does not stand.
    """

    def __init__(self, relies: Callable[[int, float, int], bool | None]) -> None:
        self._relies = relies
        self._walls: dict[int, SlotWalls] = {}
        self._loose: dict[int, EdgesByStretch] = {}
        self._arcs: dict[int, list[Arc]] = {}

    def take(self, slot: int, walls: SlotWalls) -> None:
        """Take in the walls of a slot; its arcs are those of before until they are found again."""
        self._walls[slot] = walls
        self._loose.pop(slot, None)

    def drop(self, slot: int) -> None:
        """Forget a slot."""
        for known in (self._walls, self._loose, self._arcs):
            known.pop(slot, None)

    def at(self, slot: int) -> list[Arc]:
        """Return the arcs of a slot. They are disjoint."""
        return self._arcs.get(slot, [])

    def find_again(self, slots: Iterable[int]) -> Iterator[int]:
        """Find the arcs of slots whose walls, or whose loose edges, are others than before; yield these slots."""
        for slot in slots:
            walls = self._walls.get(slot)
            if walls is None:
                continue
            loose: EdgesByStretch = {}
            for stretch, ends in walls.edges.items():
                if found := [each for each in ends if self._is_loose(slot, each)]:
                    loose[stretch] = found
            if self._loose.get(slot) != loose:
                self._loose[slot] = loose
                self._arcs[slot] = edged_arcs(walls.by_stretch, loose, walls.contacts, walls.near)
                yield slot

    def _is_loose(self, slot: int, end: SeenEnd) -> bool:
        """Return whether no standing robot is responsible for the space behind an edge of sight of a slot.

        One that saw the next point is, if it does not rely on the slot in that direction.
        """
        for each in end.edge.witnesses:
            relies = self._relies(each, end.beyond.get(each, 0.0), slot)
            stands_there = relies is not None and each not in end.beyond
            if stands_there or relies is False:
                return False
        return True
