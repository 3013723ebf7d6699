"""Maps drawn as images: ROS map_server maps (YAML with a PGM or PNG, ROS 1 and 2) and plain bitmaps, read as free cells.

A cell of a ROS map is free where its occupancy is below `free_thresh`; unknown cells are not free. A pixel of a bitmap is
free where it is brighter than mid-grey on a white ground; the lower left corner is the origin. `raster` turns cells into a
polygon. Every mistake is one line that names the file.
"""

import math
import warnings
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image
from pydantic import BaseModel, Field, ValidationError
from scipy import ndimage
from shapely.affinity import affine_transform
from shapely.geometry import Polygon

from zwerm.errors import ScenarioError
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.tables import ArenaTable
from zwerm.scenario.types import COORDINATE_MAX_M, Finite, Fraction, Point, Positive, is_file
from zwerm.world.arena.raster import component, outline
from zwerm.world.arena.yaml_text import parse_yaml

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_ROS_SUFFIXES = (".yaml", ".yml")
_SIXTEEN_BIT = ("I", "I;16", "I;16B", "I;16L", "I;16N")


Coordinate = Annotated[float, Field(ge=-COORDINATE_MAX_M, le=COORDINATE_MAX_M)]

# The largest image that is decoded, and the most separate obstacles: more take minutes and gigabytes.
PIXELS_MAX: Final = 16_000_000
HOLES_MAX: Final = 20_000


class RosMap(BaseModel):
    """A map_server YAML. Other keys are ignored, as in map_server."""

    image: str
    resolution: Positive
    origin: tuple[Coordinate, Coordinate, Finite]
    negate: Annotated[int, Field(ge=0, le=1)]
    occupied_thresh: Fraction
    free_thresh: Fraction
    mode: Literal["trinary", "scale", "raw"] = "trinary"


class Grid(NamedTuple):
    """Free cells and their position: cell [0, 0] has its lower left corner at `origin_m`, and rows run upward."""

    free: Bools  # (h, w)
    cell_m: tuple[float, float]  # width and height of a cell
    origin_m: Point
    yaw_rad: float  # by which the grid is turned about its origin, counter-clockwise

    def cell_at(self, point: Point) -> tuple[int, int]:
        """Return row and column of the cell at point [m], which may lie outside."""
        x, y = point[0] - self.origin_m[0], point[1] - self.origin_m[1]
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return math.floor((cos * y - sin * x) / self.cell_m[1]), math.floor((cos * x + sin * y) / self.cell_m[0])

    def place(self, polygon: Polygon) -> Polygon:
        """Return a polygon in cells as one in metres."""
        cos, sin, (width, height) = math.cos(self.yaw_rad), math.sin(self.yaw_rad), self.cell_m
        return affine_transform(polygon, [cos * width, -sin * height, sin * width, cos * height, *self.origin_m])


def read_map(path: Path, table: ArenaTable) -> Polygon:
    """Return the free space [m] of the map at `path`: the component with `table.start` in it, or else the largest.

    Raises ScenarioError.
    """
    grid = _ros_map(path, table) if path.suffix.lower() in _ROS_SUFFIXES else _bitmap(path, table)
    if not grid.free.any():
        raise ScenarioError([f"arena.map: {path}: expected at least one free cell, got none"])
    try:
        kept = component(grid.free, None if table.start is None else grid.cell_at(table.start))
    except ValueError:
        raise ScenarioError([f"arena.start: expected a place in the map's free space, got {table.start}"]) from None
    holes = ndimage.label(~kept)[1]
    if holes > HOLES_MAX:
        raise ScenarioError([f"arena.map: {path}: expected at most {HOLES_MAX} separate obstacles, got {holes}"])
    return grid.place(outline(kept))


def _ros_map(path: Path, table: ArenaTable) -> Grid:
    wrong = [
        f"arena.{key}: a ROS map has its own resolution, got {value}"
        for key, value in (("resolution_m", table.resolution_m), ("size_m", table.size_m))
        if value is not None
    ]
    try:
        described = RosMap.model_validate(_yaml(path))
    except ValidationError as error:
        raise ScenarioError(wrong + mistakes(error, f"arena.map: {path}")) from None
    if described.free_thresh > described.occupied_thresh:
        got = f"{described.free_thresh:g} > {described.occupied_thresh:g}"
        wrong.append(f"arena.map: {path}: free_thresh: expected at most occupied_thresh, got {got}")
    image = path.parent / described.image
    if not is_file(image):
        wrong.append(f"arena.map: {path}: image: no such file, got {described.image}")
    if wrong:
        raise ScenarioError(wrong)
    x, y, yaw = described.origin
    return Grid(_ros_free(image, described)[::-1], (described.resolution, described.resolution), (x, y), yaw)


def _yaml(path: Path) -> object:
    try:
        tables = parse_yaml(path.read_text(encoding="utf-8"))
    except yaml.MarkedYAMLError as error:
        where = "" if error.problem_mark is None else f" in line {error.problem_mark.line + 1}"
        raise ScenarioError([f"arena.map: {path}: not YAML: {error.problem}{where}"]) from None
    except (yaml.YAMLError, UnicodeDecodeError):
        raise ScenarioError([f"arena.map: {path}: not YAML: expected text"]) from None
    except OSError as error:
        raise ScenarioError([f"arena.map: {path}: cannot be read: {error.strerror}"]) from None
    if not isinstance(tables, dict):
        raise ScenarioError([f"arena.map: {path}: expected keys and values, got {type(tables).__name__}"])
    return tables


def _ros_free(image: Path, described: RosMap) -> Bools:
    """Return which pixels (h, w), top row first, are free by the rules of nav2_map_server (map_io.cpp)."""
    shade, opacity = _shades(image)
    if described.mode == "raw":  # the pixel is the occupancy in percent, above 100 unknown
        percent = np.round(255.0 * shade)
        return (percent <= 100.0) & (percent < 100.0 * described.free_thresh)
    if described.mode == "trinary" and opacity is not None:
        shade = (3.0 * shade + opacity) / 4.0  # map_server counts opacity as one more channel of brightness
    occupancy = shade if described.negate else 1.0 - shade
    free: Bools = occupancy < described.free_thresh
    return free & (opacity == 1.0) if described.mode == "scale" and opacity is not None else free


def _bitmap(path: Path, table: ArenaTable) -> Grid:
    sizes = [key for key in ("resolution_m", "size_m") if getattr(table, key) is not None]
    if len(sizes) != 1:
        got = " and ".join(sizes) or "neither"
        raise ScenarioError([f"arena.map: {path}: a bitmap needs exactly one of resolution_m and size_m, got {got}"])
    shade, opacity = _shades(path)
    on_white = shade if opacity is None else shade * opacity + (1.0 - opacity)
    height, width = shade.shape
    if table.size_m is None:
        assert table.resolution_m is not None
        cell = (table.resolution_m, table.resolution_m)
    else:
        cell = (table.size_m[0] / width, table.size_m[1] / height)
    return Grid((on_white > 0.5)[::-1], cell, (0.0, 0.0), 0.0)


def _shades(path: Path) -> tuple[Floats, Floats | None]:
    """Return the mean of the colour channels in [0, 1] (h, w), and the opacity (h, w) or None."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                if image.width * image.height > PIXELS_MAX:
                    size = f"{image.width} x {image.height}"
                    raise ScenarioError([f"arena.map: {path}: expected at most {PIXELS_MAX} pixels, got {size}"])
                if image.mode in _SIXTEEN_BIT:
                    return np.asarray(image, dtype=np.float64) / 65535.0, None
                pixels = np.asarray(image.convert("RGBA"), dtype=np.float64) / 255.0
                transparent = image.has_transparency_data
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise ScenarioError([f"arena.map: {path}: expected fewer than {Image.MAX_IMAGE_PIXELS} pixels"]) from None
    except (OSError, SyntaxError, ValueError, EOFError):
        raise ScenarioError([f"arena.map: {path}: expected a whole image (PGM, PNG, BMP, ...)"]) from None
    return pixels[..., :3].mean(axis=-1), pixels[..., 3] if transparent else None
