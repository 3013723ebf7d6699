"""Scalar fields over the arena: what there is to be sensed at a place, and how it changes from there.

A scenario's `[field]` table names one by `kind`: `constant`, `linear`, `gaussians`, `lamp` or `bitmap`. A field is known
everywhere, also outside the arena, and never changes. Gradients are exact, not differences.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final, Protocol

import numpy as np
from PIL import Image, UnidentifiedImageError
from pydantic import Field as Key
from pydantic import ValidationError, ValidationInfo, field_validator

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import Finite, OpenTable, Point, Positive, Size, Table, mistakes
from zwerm.world.scene import Floats

Box = tuple[float, float, float, float]


class Field(Protocol):
    """A scalar field, in whatever unit it has."""

    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""

    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m] at points (k, 2) [m], in the frame of the arena."""

    def sample(self, points: Floats) -> tuple[Floats, Floats]:
        """Return value and gradient; quicker than one after the other where they share work."""
        return self.value(points), self.gradient(points)


class Linear(Field):
    """A plane: `offset` at the origin, rising by `gradient_per_m`."""

    class Parameters(Table):
        """The plane."""

        offset: Finite = 0.0
        gradient_per_m: Point

    def __init__(self, offset: float, gradient_per_m: Point) -> None:
        self._offset, self._gradient = offset, np.array(gradient_per_m)

    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""
        value: Floats = self._offset + points[:, 0] * self._gradient[0] + points[:, 1] * self._gradient[1]
        return value

    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m], the same everywhere."""
        return np.broadcast_to(self._gradient, points.shape)


class Constant(Linear):
    """The same `value` everywhere."""

    class Parameters(Table):
        """The value."""

        value: Finite

    def __init__(self, value: float) -> None:
        super().__init__(value, (0.0, 0.0))


class Gaussians(Field):
    """`offset` plus a bump for each of `amplitudes`, at `centers_m`, `sd_m` wide; it has that height at its centre."""

    class Parameters(Table):
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
        """Return (g, k) each bump's height at each point, and how far right of its centre and above it that is."""
        x, y = points.T[:, None, :] - self._centers.T[:, :, None]
        return self._amplitudes * np.exp(-0.5 * (x * x + y * y) * self._precision), x, y


class Lamp(Field):
    """A lamp `height_m` above `center_m`, as a sensor that faces it from the floor sees it.

    `peak` right below, and from there as one over the square of the distance.
    """

    class Parameters(Table):
        """The lamp."""

        peak: Finite
        center_m: Point
        height_m: Positive

    def __init__(self, peak: float, center_m: Point, height_m: float) -> None:
        self._peak, self._center, self._height2 = peak, np.array(center_m), height_m**2

    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""
        apart = points - self._center
        value: Floats = self._peak * self._height2 / (self._height2 + np.square(apart).sum(axis=1))
        return value

    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m] at points (k, 2) [m]."""
        apart = points - self._center
        distance2 = self._height2 + np.square(apart).sum(axis=1)
        gradient: Floats = (-2.0 * self._peak * self._height2 / distance2**2)[:, None] * apart
        return gradient


class Bitmap(Field):
    """A picture: black is `low`, white `high`, bilinear between centres of pixels, constant beyond the outer ones.

    It covers the arena's bounds, or `size_m` from its lower left corner `origin_m`. The first row of pixels is the top.
    Where four pixels meet the gradient jumps; there it is that of the upper right patch.
    """

    class Parameters(Table):
        """The picture, where it lies and what its shades mean. `file` is relative to the scenario."""

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


KINDS: Final[dict[str, type[Linear | Gaussians | Lamp | Bitmap]]] = {
    "bitmap": Bitmap,
    "constant": Constant,
    "gaussians": Gaussians,
    "lamp": Lamp,
    "linear": Linear,
}


def make_field(table: OpenTable, bounds_m: Box, folder: Path, place: str, path: str = "field") -> Field:
    """Return the field that `table` describes, in an arena with `bounds_m`; file names are relative to `folder`.

    Raises ScenarioError with every mistake, each `place: path.key: rule, got value`.
    """
    kind = KINDS.get(table.kind)
    if kind is None:
        raise ScenarioError([f"{place}: {path}.kind: expected {', '.join(KINDS)}, got {table.kind!r}"])
    try:
        parameters = kind.Parameters.model_validate(table.parameters)
    except ValidationError as error:
        raise ScenarioError(mistakes(error, place, f"{path}.")) from None
    if isinstance(parameters, Bitmap.Parameters):
        try:
            shades = _shades(folder / parameters.file)
        except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
            reason = getattr(error, "strerror", None) or error
            rule = "not a picture" if isinstance(error, UnidentifiedImageError) else f"cannot be read: {reason}"
            raise ScenarioError([f"{place}: {path}.file: {rule}, got {parameters.file!r}"]) from None
        box_m = bounds_m
        if parameters.size_m is not None:
            (x, y), (width, height) = parameters.origin_m or bounds_m[:2], parameters.size_m
            box_m = (x, y, x + width, y + height)
        return Bitmap(shades, box_m, parameters.low, parameters.high)
    field: Field = kind(**dict(parameters))
    return field


def _shades(file: Path) -> Floats:
    """Return (rows, columns) in [0, 1], from black to white."""
    with Image.open(file) as image:
        if image.mode.startswith("I;16"):
            return np.asarray(image, dtype=np.float64) / 65_535.0
        return np.asarray(image.convert("L"), dtype=np.float64) / 255.0
