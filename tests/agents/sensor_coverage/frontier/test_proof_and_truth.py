"""The proof of coverage against the truth, in drawn pairs of rooms, before and after robots have died."""

import math
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon, box

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.wall_proof import Walk, WalkPoint
from zwerm.maths.simplicial import FlagComplex

SIGHT_M: Final = 1.0
# Distance [m] of a walking robot from the wall, and its step.
WALK_M: Final = 0.075
STEP_M: Final = 0.05
ENOUGH: Final = 0.98
DRAWN: Final = 25

Place: TypeAlias = tuple[float, float]


def two_rooms(random: np.random.Generator) -> Polygon:
    """Return the free space of two rooms and a door."""
    (w, h), (v, g), door_m = random.uniform(0.5, 1.2, 2), random.uniform(0.5, 1.4, 2), random.uniform(0.25, 0.5)
    low = random.uniform(0.0, min(h, g) - door_m)
    rooms = [box(0.0, 0.0, w, h), box(w + 0.1, 0.0, w + 0.1 + v, g), box(w - 0.01, low, w + 0.11, low + door_m)]
    return Polygon(shapely.union_all(rooms).exterior)


def visible(free: Polygon, robot: Place, places: Sequence[Place]) -> np.ndarray:
    """Return whether a robot sees each place."""
    at = np.asarray(places)
    near = np.hypot(*(at - robot).T) <= SIGHT_M
    lines = shapely.linestrings(np.stack([np.broadcast_to(robot, at.shape), at], axis=1))
    return near & shapely.covers(free.buffer(1e-6), lines)


def bearing(start: Place, end: Place) -> float:
    return math.atan2(end[1] - start[1], end[0] - start[0])


class Arena:
    """Two rooms, robots in them, and a walk along all walls. Where no robot sees it, another robot stands from then on."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.free = two_rooms(random)
        way = self.free.buffer(-WALK_M, join_style="mitre").exterior
        places = [way.interpolate(each).coords[0] for each in np.arange(0.0, way.length, STEP_M)]
        inside = [each for each in random.uniform((0.0, 0.0), self.free.bounds[2:], (30, 2)) if self._has_room(each)]
        self.robots: list[Place] = [tuple(each) for each in inside[: random.integers(1, 4)]]
        seen = [visible(self.free, each, places) for each in self.robots]
        first = int(np.argmax(seen[0]))
        order = [(first + each) % len(places) for each in range(len(places) + 1)]
        legs: list[list[int]] = [[]]
        for before, number in zip(order[-2:] + order, order, strict=False):
            if not any(each[number] for each in seen):
                self.robots.append(places[before])
                seen.append(visible(self.free, places[before], places))
                legs.append([])
            legs[-1].append(number)
        self.walks = [
            Walk(0, 1, tuple(self._point(places[each], [s[each] for s in seen]) for each in leg)) for leg in legs
        ]
        self.proof = SwarmProof()
        grid = np.stack(np.meshgrid(*(np.arange(0.02, each, 0.04) for each in self.free.bounds[2:])), axis=-1)
        self.space = [tuple(each) for each in grid.reshape(-1, 2) if self.free.contains(Point(each))]
        self.seen = [visible(self.free, each, self.space) for each in self.robots]

    def _has_room(self, place: np.ndarray) -> bool:
        return bool(self.free.buffer(-WALK_M).contains(Point(place)))

    def _point(self, at: Place, seen: Sequence[bool]) -> WalkPoint:
        ring = list(self.free.exterior.coords)
        nearest = [side.interpolate(side.project(Point(at))).coords[0] for side in map(LineString, pairwise(ring))]
        walls = tuple(bearing(at, each) for each in nearest if math.dist(at, each) < WALK_M + 0.005)
        return WalkPoint({n: bearing(self.robots[n], at) for n, each in enumerate(seen) if each}, walls, ())

    def is_closed(self, keep: Collection[int]) -> bool:
        """Return whether these robots see each other, and none of them has an open arc."""
        at = {each: self.robots[each] for each in sorted(keep)}
        views = {
            n: {
                m: bearing(here, at[m])
                for m, seen in zip(at, visible(self.free, here, list(at.values())), strict=True)
                if seen and m != n
            }
            for n, here in at.items()
        }
        scan = ScanResult(views, FlagComplex(views), ())
        self.proof.update(scan, self.walks, {}, {}, {})
        return len(scan.complex_.components()) == 1 and not self.proof.open_arcs()

    def coverage(self, keep: Collection[int]) -> float:
        """Return the fraction of the space that these robots see."""
        return float(np.mean(np.any([self.seen[each] for each in keep], axis=0)))


def test_all_is_seen_where_the_proof_is_closed_although_robots_have_died() -> None:
    """Robots die one after the other, in a drawn order, each only if the proof stays closed without it."""
    closed, least = 0, 1.0
    for seed in range(DRAWN):
        arena = Arena(seed)
        keep = list(range(len(arena.robots)))
        if not arena.is_closed(keep):
            continue
        closed += 1
        least = min(least, arena.coverage(keep))
        for each in np.random.default_rng(seed).permutation(len(keep)).tolist():
            rest = [other for other in keep if other != each]
            if rest and arena.is_closed(rest):
                keep = rest
                least = min(least, arena.coverage(keep))
    assert closed > DRAWN // 4
    assert least >= ENOUGH
