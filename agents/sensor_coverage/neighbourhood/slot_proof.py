"""The proof of coverage at one robot's slot: which arcs are closed by neighbours, by touched walls, and by walks that passed.

`zwerm.agents.sensor_coverage.frontier.wall_proof` has the rules. A robot keeps the arcs that walks closed at its slot, and
not the walks. An arc that another standing robot closed together with a walk counts while that robot is a neighbour.
"""

from collections.abc import Iterable, Mapping
from typing import Final

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.walks import Arc, WalkPoint
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    arc_between,
    arcs_of_step,
    arcs_of_walls,
    complement,
    united,
)
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE

# A point of a walk is news for the walking robot if the open arcs become smaller by this [rad].
NEWS_RAD: Final = 0.02


class SlotProof:
    """The closed arcs of one slot. `around` are the slots that share an edge with it, and their directions [rad]."""

    def __init__(self) -> None:
        self.around: Mapping[int, float] = {}
        self._by_view: list[Arc] = []
        self._by_walks: dict[int, list[Arc]] = {}  # by the slot at the third corner, or NOWHERE for a wall

    def update(self, slot: int, scan: ScanResult, touched: Iterable[float]) -> None:
        """Take in the triangles of a scan, and the directions [rad] of walls in touch."""
        views, complex_ = scan.views[slot], scan.complex_
        self.around = {each: views[each] for each in complex_.neighbours[slot]}
        self._by_view = arcs_of_walls(touched)
        for triangle in complex_.triangles:
            if slot in triangle:
                a, b = (each for each in triangle if each != slot)
                self._by_view.append(arc_between(views[a], views[b]))

    def open_arcs(self) -> list[Arc]:
        """Return the arcs that nothing closes."""
        walks = [arc for slot, arcs in self._by_walks.items() if slot == NOWHERE or slot in self.around for arc in arcs]
        return complement([*self._by_view, *walks])

    def pass_point(self, slot: int, before: WalkPoint | None, point: WalkPoint, hand: int) -> bool:
        """Take in a point of a walk that this slot sees, and the point before it; return whether the open arcs are smaller."""
        old = sum(each.width_rad for each in self.open_arcs())
        for other, arc in arcs_of_step(slot, before, point, hand, self.around):
            key = NOWHERE if other is None else other
            self._by_walks[key] = united([*self._by_walks.get(key, ()), arc])
        return sum(each.width_rad for each in self.open_arcs()) < old - NEWS_RAD

    def add_near(self, arcs: Iterable[tuple[float, float]]) -> None:
        """Add arcs (start, width) [rad] in which a wall close to the slot was followed."""
        self._by_walks[NOWHERE] = united([*self._by_walks.get(NOWHERE, ()), *(Arc(*each) for each in arcs)])

    def memory(self) -> tuple[tuple[int, float, float], ...]:
        """Return the arcs that walks closed, for the slot's next occupant."""
        return tuple((slot, *arc) for slot, arcs in self._by_walks.items() for arc in arcs)

    def inherit(self, memory: Iterable[tuple[int, float, float]]) -> None:
        """Take over the arcs that walks closed from the slot's former occupant."""
        self._by_walks = {}
        for slot, start, width in memory:
            self._by_walks.setdefault(slot, []).append(Arc(start, width))
