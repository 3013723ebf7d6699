"""The arcs of slots that other standing robots close: triangles of three robots, and robots in touch."""

import math
from collections.abc import Collection, Iterator, Mapping
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.fans import is_between
from zwerm.agents.sensor_coverage.frontier.proofs.wall_arcs import ArcBasis, WallArcs
from zwerm.agents.sensor_coverage.frontier.strips.robots_in_touch import arcs_of_robot
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, arc_between

# A robot is behind the edge of a triangle only if it is seen this far [rad] from both robots there: bearings have noise.
BEHIND_RAD: Final = math.radians(2.0)


class RobotArcs(NamedTuple):
    """What robots close around slots that share edges with `neighbours`, in the directions `views` [rad].

    `around` and `walls` have the contacts of each slot, and its arcs at walls.
    """

    neighbours: Mapping[int, frozenset[int]]
    views: Mapping[int, Mapping[int, float]]
    around: Mapping[int, ArcBasis]
    walls: Mapping[int, WallArcs]

    def all(self, slot: int) -> list[Arc]:
        """Return the arcs of a slot that triangles of robots and robots in touch close."""
        return [*self._of_bodies(slot), *self.between(slot)]

    def of_body(self, slot: int, other: int) -> Iterator[Arc]:
        """Yield the arcs in which a slot relies on another one whose robot is in touch with its own."""
        touched = self.around[slot].touched
        followed = self.walls[other].edged if other in self.walls else ()
        return arcs_of_robot(self.views[slot][other], touched, self.views[other][slot], followed)

    def _of_bodies(self, slot: int) -> Iterator[Arc]:
        for each in self.around[slot].in_touch:
            yield from self.of_body(slot, each)

    def between(self, slot: int, without: Collection[int] = (), before: Collection[int] = ()) -> Iterator[Arc]:
        """Yield the arcs of a slot in its triangles of robots, but those with other slots, and those `before` other slots.

        A triangle is before a slot that shares edges with the two others.
        """
        around, view = self.neighbours, self.views[slot]
        for a, b in self._triangles(slot, without):
            if not any(a in around[each] and b in around[each] for each in before if each in around):
                yield arc_between(view[a], view[b])

    def not_before(self, slot: int, other: int) -> list[Arc] | None:
        """Return the arcs of the other slot without triangles of robots before this slot; None if there are no such triangles.

        The other slot sees this one between two robots, of which this one does not see both. What is behind these is theirs.
        """
        around, view = self.neighbours[slot], self.views[other]
        kept, found = list(self._of_bodies(other)), False
        for a, b in self._triangles(other, ()):
            is_other = slot not in (a, b) and not around.issuperset((a, b))
            if is_other and is_between(view[slot], view[a], view[b], BEHIND_RAD):
                found = True
            else:
                kept.append(arc_between(view[a], view[b]))
        return kept if found else None

    def _triangles(self, slot: int, without: Collection[int]) -> Iterator[tuple[int, int]]:
        """Yield the two other slots of each triangle of robots."""
        beside = self.neighbours[slot].difference(without)
        yield from ((a, b) for a in beside for b in beside & self.neighbours[a] if a < b)
