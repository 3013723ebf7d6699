"""The positions of the robots in sight, in the body frame, as range-and-bearing hardware gives them.

Visibility is that of `bearings`. The noise is Gaussian, with the same deviation in x and y, independent for each axis,
tick, observer and robot seen. Headings of others are not sensed.

With `voronoi` only those are reported whose Voronoi cells border on the observer's in the plane. Voronoi coverage
assumes that a robot can measure these (Schwager et al. 2006). In a swarm without a range the reading is then much
shorter.
"""

import math
from collections.abc import Callable, Collection
from typing import Any, ClassVar, Final

import numpy as np

from zwerm.scenario.types import NonNegative, Positive, Table
from zwerm.wire.messages import Neighbour
from zwerm.world.geometry.tessellation import Tessellation
from zwerm.world.geometry.visibility import VisiblePairs
from zwerm.world.scene import Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings, chosen, in_body_frames, portions, random_angle

# Greatest distance of a phantom where the sensor has no range [m].
_PHANTOM_M: Final = 1.0


class NeighboursTable(Table):
    """Range and noise of positions, and which robots are visible."""

    range_m: Positive | None = None
    through_walls: bool = False
    robots_occlude: bool = False
    voronoi: bool = False
    sd_m: NonNegative = 0.0


class NeighboursSensor(Sensor):
    """Relative positions of robots, ascending by id."""

    field: ClassVar[str] = "neighbours"
    Parameters: ClassVar[type[Table]] = NeighboursTable
    dark: ClassVar[Any] = ()
    sees_beacons: ClassVar[bool] = True
    has_items: ClassVar[bool] = True

    def __init__(self, parameters: NeighboursTable, surroundings: Surroundings) -> None:
        if parameters.voronoi and parameters.robots_occlude:
            raise ValueError("expected voronoi or robots_occlude, not both")
        self._sight = (parameters.range_m, parameters.through_walls, parameters.robots_occlude)
        self._sd_m = parameters.sd_m
        self._visibility = surroundings.visibility
        self._tessellation = Tessellation() if parameters.voronoi else None
        self._count = surroundings.count
        self._last: tuple[Ints, Ints, VisiblePairs] | None = None

    def read(self, scene: Scene, robots: Ints) -> list[tuple[Neighbour, ...]]:
        """Return where each of `robots` has the robots it sees."""
        observer, seen, ends = self._sightings(scene, robots)
        here = scene.position.view(np.complex128)[:, 0]  # so that x and y are looked up at once
        apart = here.take(seen) - here.take(observer)
        x, y = in_body_frames(apart.real, apart.imag, scene.heading, observer)
        if self._sd_m > 0.0:
            x += self._sd_m * scene.draws.normal("sensor.neighbours.x", scene.tick, observer, seen)
            y += self._sd_m * scene.draws.normal("sensor.neighbours.y", scene.tick, observer, seen)
        return portions(map(Neighbour, seen.tolist(), x.tolist(), y.tolist()), ends)

    def _sightings(self, scene: Scene, robots: Ints) -> VisiblePairs:
        if self._tessellation is None:
            return self._visibility.sightings(scene, robots, *self._sight)
        ids = scene.present_ids()
        found = self._tessellation.pairs(scene.position[ids])
        range_m, through_walls, _ = self._sight
        # Without a range and walls each robot sees the same robots until the triangulation changes.
        lasting = range_m is None and (through_walls or scene.arena.is_convex) and len(robots) == len(ids)
        if lasting and self._last is not None and found is self._last[0]:
            last = self._last[1]
            if robots is last or np.array_equal(robots, last):
                return self._last[2]
        pairs = ids[found]
        if range_m is not None:
            apart = scene.position[pairs[:, 1]] - scene.position[pairs[:, 0]]
            pairs = pairs[np.hypot(*apart.T) <= range_m]
        if not (through_walls or scene.arena.is_convex):
            pairs = pairs[~scene.arena.blocked(scene.position[pairs[:, 0]], scene.position[pairs[:, 1]])]
        sightings = both_ways(pairs, robots, len(scene.present))
        self._last = (found, robots, sightings) if lasting else None
        return sightings

    def phantom(self, robot: int, known: Collection[int], uniform: Callable[[str], float]) -> Neighbour | None:
        """Return another robot at a random place within range."""
        number = chosen(range(self._count), {*known, robot}, uniform)
        if number is None:
            return None
        angle = random_angle(uniform)
        distance_m = (self._sight[0] or _PHANTOM_M) * math.sqrt(uniform("far"))
        return Neighbour(number, distance_m * math.cos(angle), distance_m * math.sin(angle))

    @classmethod
    def rest(cls) -> tuple[Neighbour, ...]:
        """Return no neighbour."""
        return ()

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> tuple[Neighbour, ...]:
        """Return `count` neighbours at random places."""
        places = random.uniform(-2.0, 2.0, (count, 2)).tolist()
        return tuple(Neighbour(node, x, y) for node, (x, y) in enumerate(places, start=1))

    @classmethod
    def extremes(cls) -> tuple[Neighbour, ...]:
        """Return two robots at the own place, and one far away with a large id."""
        return (Neighbour(1, 0.0, 0.0), Neighbour(2, 0.0, 0.0), Neighbour(99_999, 1e6, -1e6))


def both_ways(pairs: Ints, robots: Ints, count: int) -> VisiblePairs:
    """Return both directions of pairs (k, 2) of ids below count, for the observers `robots` (ascending ids)."""
    i, j = pairs.T
    keys = np.concatenate([i * count + j, j * count + i])
    keys.sort()
    observer, seen = np.divmod(keys, count)
    if len(robots) < count:
        rows = np.isin(observer, robots)
        observer, seen = observer[rows], seen[rows]
    return VisiblePairs(observer, seen, np.searchsorted(observer, robots, side="right"))
