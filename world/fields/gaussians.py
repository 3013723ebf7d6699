"""A sum of Gaussian bumps."""

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field as Key
from pydantic import ValidationInfo, field_validator

from zwerm.scenario.types import Finite, Point, Positive, Table
from zwerm.world.fields import Field
from zwerm.world.scene import Floats


class GaussiansTable(Table):
    """The bumps: lists of equal length, or one sd for all."""

    amplitudes: Annotated[list[Finite], Key(min_length=1)]
    centers_m: list[Point]
    sd_m: list[Positive]
    offset: Finite = 0.0

    @field_validator("sd_m", mode="before")
    @classmethod
    def _one_for_all(cls, sd_m: object, table: ValidationInfo) -> object:
        return sd_m if isinstance(sd_m, list) else [sd_m] * len(table.data.get("amplitudes", [0]))

    @field_validator("centers_m", "sd_m")
    @classmethod
    def _as_many(cls, each: list[object], table: ValidationInfo) -> list[object]:
        amplitudes = table.data.get("amplitudes", each)
        if len(each) != len(amplitudes):
            raise ValueError(f"expected {len(amplitudes)} items, one for each of amplitudes")
        return each


class Gaussians(Field):
    """`offset` plus a bump for each of `amplitudes`, with its centre in `centers_m` and the standard deviation `sd_m`;
    the amplitude is its height at the centre."""

    Parameters: ClassVar[type[Table]] = GaussiansTable

    def __init__(
        self, amplitudes: Sequence[float], centers_m: Sequence[Point], sd_m: Sequence[float], offset: float = 0.0
    ) -> None:
        self._offset, self._amplitudes = offset, np.reshape(amplitudes, (-1, 1))
        self._centers = np.array(centers_m)
        self._precision = np.reshape(sd_m, (-1, 1)) ** -2.0

    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""
        value: Floats = self._offset + self._bumps(points)[0].sum(axis=0)
        return value

    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m] at points (k, 2) [m]."""
        return self.sample(points)[1]

    def sample(self, points: Floats) -> tuple[Floats, Floats]:
        """Return value and gradient, which share the bumps."""
        height, *apart = self._bumps(points)
        steepness = height * self._precision
        gradient = np.empty(points.shape)
        for axis, away in enumerate(apart):
            np.negative((steepness * away).sum(axis=0), out=gradient[:, axis])
        return self._offset + height.sum(axis=0), gradient

    def _bumps(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Return (g, k) the height of each bump at each point, and the point's x and y relative to the bump's centre."""
        x, y = points.T[:, None, :] - self._centers.T[:, :, None]
        return self._amplitudes * np.exp(-0.5 * (x * x + y * y) * self._precision), x, y
