"""Scalar fields over the arena: the quantity that robots sense, and its exact gradient. One file a kind.

A scenario's `[field]` table names one by `kind`, or as `module:Class`. A field is defined everywhere, also outside the arena,
and is constant.
"""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

from zwerm.scenario.types import Table
from zwerm.world.scene import Floats

Box = tuple[float, float, float, float]


class FieldPlace(NamedTuple):
    """The place of a field: the arena's bounds xmin, ymin, xmax, ymax [m], and the folder that file names start from."""

    bounds_m: Box
    folder: Path


class Field(ABC):
    """A scalar field, in a unit of its own: the base class of the plug-in kind `field`.

    `Parameters` types the keys of the scenario's table, which the constructor takes by name.
    """

    Parameters: ClassVar[type[Table]] = Table

    @classmethod
    def make(cls, parameters: Any, place: FieldPlace) -> Self:
        """Return the field of an instance of `Parameters`.

        Raises ValueError, one line that starts with the key, where it cannot be made.
        """
        return cls(**dict(parameters))

    @abstractmethod
    def value(self, points: Floats) -> Floats:
        """Return (k,) the value at points (k, 2) [m]."""

    @abstractmethod
    def gradient(self, points: Floats) -> Floats:
        """Return (k, 2) the gradient [1/m] at points (k, 2) [m], in the frame of the arena."""

    def sample(self, points: Floats) -> tuple[Floats, Floats]:
        """Return value and gradient; a subclass overrides this where both share work."""
        return self.value(points), self.gradient(points)
