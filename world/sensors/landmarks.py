"""Bearings to landmarks: points with an id. Every robot can distinguish them, and no robot knows their places.

As in Ramaithitima and Bhattacharya 2018, a robot sees every landmark within `range_m` if no wall blocks the line. A
landmark on a wall is seen from the side it faces. The noise is Gaussian and independent for each tick, robot and
landmark. Robots do not hide landmarks. A line of sight is tested again only after its robot has moved.
"""

import math
from collections.abc import Callable, Collection
from typing import Any, ClassVar

import numpy as np

from zwerm.maths.angles import wrap
from zwerm.scenario.types import NonNegative, Positive, Table
from zwerm.wire.messages import LandmarkBearing
from zwerm.world.geometry.search_tree import tree_of
from zwerm.world.geometry.visibility import WallVerdicts
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings, chosen, portions, random_angle

# A line of sight ends this fraction of its length short, so that a wall does not hide a landmark on its surface.
_SHORT = 1e-9

# Up to this many pairs of a robot and a landmark all distances are computed: a search tree costs more.
_FEW_PAIRS = 50_000


class LandmarksTable(Table):
    """The landmarks that are seen, and the quality of the bearings. With `presence_only` every bearing reads 0: only
    ids are sensed."""

    range_m: Positive | None = None
    through_walls: bool = False
    sd_rad: NonNegative = 0.0
    presence_only: bool = False


class Landmarks(Sensor):
    """Bearings to landmarks, ascending by id."""

    field: ClassVar[str] = "landmarks"
    Parameters: ClassVar[type[Table]] = LandmarksTable
    dark: ClassVar[Any] = ()
    has_items: ClassVar[bool] = True

    def __init__(self, parameters: LandmarksTable, surroundings: Surroundings) -> None:
        if len(surroundings.landmarks) == 0:
            raise ValueError("the landmark sensor needs landmarks, and the scenario has none")
        self._range_m, self._sd_rad = parameters.range_m, parameters.sd_rad
        self._presence_only = parameters.presence_only
        self._through_walls = parameters.through_walls or surroundings.arena.is_convex
        self._landmarks = surroundings.landmarks
        self._tree = tree_of(surroundings.landmarks)
        self._verdicts = WallVerdicts()
        self._read_at = np.full((surroundings.count, 2), np.nan)

    def read(self, scene: Scene, robots: Ints) -> list[tuple[LandmarkBearing, ...]]:
        """Return the bearings that each of `robots` has to the landmarks it sees."""
        row, landmark = self._within_range(scene, robots)
        if not self._through_walls:
            clear = self._clear(scene, robots, robots[row], landmark)
            row, landmark = row[clear], landmark[clear]
        ends = np.searchsorted(row, np.arange(len(robots)), side="right")
        if self._presence_only:
            return portions([LandmarkBearing(each, 0.0) for each in landmark.tolist()], ends)
        robot = robots[row]
        dx, dy = (self._landmarks[landmark] - scene.position[robot]).T
        bearing = np.arctan2(dy, dx) - scene.heading[robot]
        if self._sd_rad > 0.0:
            bearing += self._sd_rad * scene.draws.normal("sensor.landmarks", scene.tick, robot, landmark)
        return portions(list(map(LandmarkBearing, landmark.tolist(), wrap(bearing).tolist())), ends)

    def _within_range(self, scene: Scene, robots: Ints) -> tuple[Ints, Ints]:
        """Return (k,) rows of `robots` and (k,) landmarks that are within range of each other, ascending."""
        position, landmarks = scene.position[robots], self._landmarks
        if self._range_m is None:
            row, landmark = np.divmod(np.arange(len(robots) * len(landmarks)), len(landmarks))
            return row, landmark
        if len(robots) * len(landmarks) <= _FEW_PAIRS:
            dx, dy = landmarks[:, 0] - position[:, :1], landmarks[:, 1] - position[:, 1:]
            row, landmark = (dx**2 + dy**2 <= self._range_m**2).nonzero()
            return row, landmark
        # Slightly too far, so that only the exact comparison below decides at the edge of the range.
        reach_m = self._range_m * (1.0 + 1e-9)
        found = tree_of(position).sparse_distance_matrix(self._tree, reach_m, output_type="ndarray")
        order = np.argsort(found["i"] * len(landmarks) + found["j"])
        row, landmark = found["i"][order], found["j"][order]
        apart = landmarks[landmark] - position[row]
        near = apart[:, 0] ** 2 + apart[:, 1] ** 2 <= self._range_m**2
        return row[near], landmark[near]

    def _clear(self, scene: Scene, robots: Ints, robot: Ints, landmark: Ints) -> Bools:
        """Return (k,) whether no wall blocks the line from each of `robot` to its `landmark`."""
        moved = np.zeros(len(self._read_at), dtype=np.bool_)
        moved[robots] = (scene.position[robots] != self._read_at[robots]).any(axis=1)
        if moved.any():
            self._verdicts.keep(~moved[self._verdicts.keys // len(self._landmarks)])
            self._read_at[robots] = scene.position[robots]
        start = scene.position[robot]
        end = start + (self._landmarks[landmark] - start) * (1.0 - _SHORT)
        return ~self._verdicts.blocked(scene.arena, robot * len(self._landmarks) + landmark, start, end)

    def phantom(self, robot: int, known: Collection[int], uniform: Callable[[str], float]) -> LandmarkBearing | None:
        """Return the bearing of another landmark in a random direction."""
        number = chosen(range(len(self._landmarks)), known, uniform)
        return None if number is None else LandmarkBearing(number, random_angle(uniform))

    @classmethod
    def rest(cls) -> tuple[LandmarkBearing, ...]:
        """Return no bearing."""
        return ()

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> tuple[LandmarkBearing, ...]:
        """Return `count` bearings in random directions."""
        bearings = random.uniform(-math.pi, math.pi, count).tolist()
        return tuple(LandmarkBearing(number, bearing) for number, bearing in enumerate(bearings))

    @classmethod
    def extremes(cls) -> tuple[LandmarkBearing, ...]:
        """Return a landmark behind, and one with a large id."""
        return (LandmarkBearing(0, math.pi), LandmarkBearing(99_999, 0.0))
