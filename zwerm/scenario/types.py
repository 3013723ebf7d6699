"""Types of the values in a scenario's tables: numbers with bounds, points, names, and the two kinds of table."""

import re
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

# The largest coordinate of an arena. Beyond it distances lose the precision that robots need.
COORDINATE_MAX_M: Final = 1e6

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]

# TOML has arrays only. A tuple type that accepts an array is marked with this; its items stay strict.
ARRAY = Field(strict=False)
Point = Annotated[tuple[Finite, Finite], ARRAY]
Size = Annotated[tuple[Positive, Positive], ARRAY]
Pose = Annotated[tuple[Finite, Finite, Finite], ARRAY]
# A place, with a heading or without one.
Place = Annotated[tuple[Finite, ...], ARRAY, Field(min_length=2, max_length=3)]
Grid = Annotated[tuple[Count, Count], ARRAY]


def _rectangle(corners: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    xmin, ymin, xmax, ymax = corners
    if not (xmin < xmax and ymin < ymax):
        raise ValueError("expected [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax")
    return corners


def scenario_name(text: str) -> str:
    """Return the text. Raises ValueError where it is no name of a scenario."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", text):
        raise ValueError("expected letters, digits, '.', '_' and '-', and no sign first")
    return text


Rectangle = Annotated[tuple[Finite, Finite, Finite, Finite], ARRAY, AfterValidator(_rectangle)]


class Table(BaseModel):
    """A TOML table with a fixed set of keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class OpenTable(BaseModel):
    """A TOML table that names a plug-in by `kind` and carries the plug-in's own parameters beside it."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    kind: str

    @property
    def parameters(self) -> dict[str, Any]:
        """The keys besides `kind`, for the plug-in to type."""
        return dict(self.__pydantic_extra__ or {})


def is_file(path: Path) -> bool:
    """Return whether `path` is a file. A name that the system does not allow, such as one of 300 characters, is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
