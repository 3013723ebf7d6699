"""The one-bit sensor of Ozdemir et al. 2019: is there a robot straight ahead?

A ray of no width leaves the robot's centre along its heading. The reading is True iff the ray meets the disc of another
robot before it meets a wall. Without a range the distance does not matter. The noise is that of their section IV-B:
with some probability the reading is replaced by a random bit. The reading contains no distance and no id.
"""

import math
from typing import Any, ClassVar

import numpy as np
from pydantic import ValidationInfo, field_validator

from zwerm.scenario.types import Fraction, Positive, Table
from zwerm.world.scene import Bools, Ints, Scene
from zwerm.world.sensors import Sensor, Surroundings

# Number of (observer, other) pairs that are computed at a time: they fit into a core's cache (measured).
_PAIRS_AT_ONCE = 1 << 15


class LineOfSightTable(Table):
    """With these probabilities a reading becomes a random bit: one that is True, one that is False, or any."""

    range_m: Positive | None = None
    false_negative: Fraction = 0.0
    false_positive: Fraction = 0.0
    combined: Fraction = 0.0

    @field_validator("combined")
    @classmethod
    def _alone(cls, combined: float, table: ValidationInfo) -> float:
        if combined > 0.0 and (table.data.get("false_negative") or table.data.get("false_positive")):
            raise ValueError("expected it alone, or false_negative and false_positive without it")
        return combined


class LineOfSightSensor(Sensor):
    """One bit for each robot."""

    field: ClassVar[str] = "line_of_sight"
    Parameters: ClassVar[type[Table]] = LineOfSightTable
    dark: ClassVar[Any] = False
    sees_beacons: ClassVar[bool] = True
    has_floats: ClassVar[bool] = False

    def __init__(self, parameters: LineOfSightTable, surroundings: Surroundings) -> None:
        self._range_m = np.inf if parameters.range_m is None else parameters.range_m
        # A bit that is replaced by a random one changes half of the time.
        self._missed = max(parameters.false_negative, parameters.combined) / 2.0
        self._imagined = max(parameters.false_positive, parameters.combined) / 2.0
        # No wall comes between bodies that are inside a convex arena, so it does not matter where the ray enters one.
        self._any_entry_will_do = surroundings.arena.is_convex and parameters.range_m is None
        self._memory, self._marks = np.empty((2, 0)), np.empty(0, dtype=np.bool_)
        self._shape(0, 0)

    def read(self, scene: Scene, robots: Ints) -> list[bool]:
        """Return whether each of `robots` has a robot straight ahead."""
        if len(robots) == 0:
            return []
        sees = self._truth(scene, robots)
        if self._missed > 0.0 or self._imagined > 0.0:
            draw = scene.draws.uniform("sensor.line_of_sight", scene.tick, robots)
            sees ^= draw < np.where(sees, self._missed, self._imagined)
        answer: list[bool] = sees.tolist()
        return answer

    def _truth(self, scene: Scene, robots: Ints) -> Bools:
        x, y = scene.position.T.copy()
        ox, oy, heading, others = x, y, scene.heading, robots
        if len(robots) < len(scene.present):
            others = scene.present_ids()
            x, y, ox, oy, heading = x[others], y[others], x[robots], y[robots], heading[robots]
        cos, sin = np.cos(heading), np.sin(heading)
        offset = oy * cos - ox * sin
        own = None if others is robots else np.searchsorted(others, robots)
        radius2 = scene.radius_m**2
        sees = np.zeros(len(robots), dtype=np.bool_)
        entry_m = None if self._any_entry_will_do else np.full(len(robots), np.inf)
        total, first = len(others), 0
        rays: Ints | None = None  # those that are still to be followed; None for all
        c, s, o = cos, sin, offset
        while first < total and len(c):
            last = min(first + max(1, _PAIRS_AT_ONCE // len(c)), total)
            if self._grids[0].shape != (last - first, len(c)):
                self._shape(last - first, len(c))
            grid, product, on_line = self._grids
            # Squared distance of each centre from each ray: elementwise, so that every machine rounds in the same way.
            np.multiply(y[first:last, None], c, out=grid)
            np.multiply(x[first:last, None], s, out=product)
            np.subtract(grid, product, out=grid)
            np.subtract(grid, o, out=grid)
            np.multiply(grid, grid, out=grid)
            np.less_equal(grid, radius2, out=on_line)
            near = on_line.reshape(-1).nonzero()[0]
            seen = near // len(c)
            row = near - seen * len(c)
            if rays is not None:
                row = rays[row]
            if first:
                seen += first
            ahead = (x[seen] - ox[row]) * cos[row] + (y[seen] - oy[row]) * sin[row]
            half_chord2 = radius2 - grid.reshape(-1)[near]
            # The disc's far side is ahead: in front, or about the ray's own start (where bodies may overlap).
            met = ahead * np.abs(ahead) >= -half_chord2
            met &= seen != (row if own is None else own[row])  # no robot sees itself
            if entry_m is not None:
                np.minimum.at(entry_m, row[met], np.maximum(ahead[met] - np.sqrt(half_chord2[met]), 0.0))
            else:
                sees[row[met]] = True
                if last < total:  # one robot ahead is enough
                    rays = np.flatnonzero(~sees)
                    c, s, o = cos[rays], sin[rays], offset[rays]
            first = last
        if entry_m is not None:
            hit = np.flatnonzero((entry_m <= self._range_m) & (entry_m < np.inf))
            start = np.column_stack([ox[hit], oy[hit]])
            ray = np.column_stack([cos[hit], sin[hit]]) * entry_m[hit, None]
            sees[hit[~scene.arena.blocked(start, start + ray)]] = True
        return sees

    def _shape(self, *shape: int) -> None:
        """Give the grids of all pairs this shape. New memory for each would cost more than what is computed in it."""
        size = math.prod(shape)
        if size > len(self._marks):
            self._memory, self._marks = np.empty((2, size)), np.empty(size, dtype=np.bool_)
        one, other = self._memory[:, :size]
        self._grids = one.reshape(shape), other.reshape(shape), self._marks[:size].reshape(shape)

    @classmethod
    def rest(cls) -> bool:
        """Return False: no robot ahead."""
        return False

    @classmethod
    def stimulus(cls, random: np.random.Generator, count: int) -> bool:
        """Return a random bit."""
        return bool(random.integers(0, 2))

    @classmethod
    def extremes(cls) -> bool:
        """Return True."""
        return True
