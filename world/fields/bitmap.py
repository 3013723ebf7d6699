"""A field from a picture: each shade is a value."""

from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from PIL import Image, UnidentifiedImageError
from pydantic import ValidationInfo, field_validator

from zwerm.scenario.types import Finite, Point, Size, Table
from zwerm.world.fields import Box, Field, FieldPlace
from zwerm.world.scene import Floats


class BitmapTable(Table):
    """The picture, its position, and the values of black and white. `file` is relative to the scenario."""

    file: str
    low: Finite = 0.0
    high: Finite = 1.0
    size_m: Size | None = None
    origin_m: Point | None = None

    @field_validator("origin_m")
    @classmethod
    def _with_size(cls, origin_m: Point | None, table: ValidationInfo) -> Point | None:
        if origin_m is not None and table.data.get("size_m", origin_m) is None:
            raise ValueError("expected size_m beside it")
        return origin_m


class Bitmap(Field):
    """A picture: black is `low`, white `high`, bilinear between centres of pixels, constant beyond the outer ones.

    It covers the arena's bounds, or `size_m` from its lower left corner `origin_m`. The first row of pixels is the top.
    The gradient jumps at a point where four pixels meet; there it is that of the upper right patch.
    """

    Parameters: ClassVar[type[Table]] = BitmapTable

    @classmethod
    def make(cls, parameters: Any, place: FieldPlace) -> Self:
        """Read the picture. Raises ValueError where it cannot be read."""
        try:
            shades = _shades(place.folder / parameters.file)
        except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
            reason = getattr(error, "strerror", None) or error
            rule = "not a picture" if isinstance(error, UnidentifiedImageError) else f"cannot be read: {reason}"
            raise ValueError(f"file: {rule}, got {parameters.file!r}") from None
        box_m = place.bounds_m
        if parameters.size_m is not None:
            (x, y), (width, height) = parameters.origin_m or place.bounds_m[:2], parameters.size_m
            box_m = (x, y, x + width, y + height)
        return cls(shades, box_m, parameters.low, parameters.high)

    def __init__(self, shades: Floats, box_m: Box, low: float = 0.0, high: float = 1.0) -> None:
        """Take (rows, columns) shades in [0, 1], the top row first, over the box xmin, ymin, xmax, ymax [m]."""
        self._values = low + (high - low) * shades[::-1]
        self._corner = np.array(box_m[:2])
        self._pixel_m = (np.array(box_m[2:]) - self._corner) / shades.T.shape

    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""
        (u, v), _, (lower_left, lower_right, upper_left, upper_right) = self._patch(points)
        lower, upper = lower_left + u * (lower_right - lower_left), upper_left + u * (upper_right - upper_left)
        value: Floats = lower + v * (upper - lower)
        return value

    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m] at points (k, 2) [m]."""
        (u, v), inside, (lower_left, lower_right, upper_left, upper_right) = self._patch(points)
        along_x = (1.0 - v) * (lower_right - lower_left) + v * (upper_right - upper_left)
        along_y = (1.0 - u) * (upper_left - lower_left) + u * (upper_right - lower_right)
        gradient: Floats = np.column_stack([along_x, along_y]) * inside / self._pixel_m
        return gradient

    def _patch(self, points: Floats) -> tuple[Floats, Floats, tuple[Floats, Floats, Floats, Floats]]:
        """Return each point's place in its patch (2, k), whether within the outer centres (k, 2), the corners."""
        rows, columns = self._values.shape
        last = np.array([columns - 1, rows - 1])
        at = (points - self._corner) / self._pixel_m - 0.5
        held = np.clip(at, 0, last)
        low = np.minimum(np.floor(held).astype(np.int64), np.maximum(last - 1, 0))
        (x, y), (right, upper) = low.T, np.minimum(low + 1, last).T
        values = self._values
        corners = (values[y, x], values[y, right], values[upper, x], values[upper, right])
        return (held - low).T, (at == held).astype(np.float64), corners


def _shades(file: Path) -> Floats:
    """Return (rows, columns) in [0, 1], from black to white."""
    with Image.open(file) as image:
        if image.mode.startswith("I;16"):
            return np.asarray(image, dtype=np.float64) / 65_535.0
        return np.asarray(image.convert("L"), dtype=np.float64) / 255.0
