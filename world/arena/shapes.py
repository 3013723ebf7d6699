"""The shape of an arena from a scenario's table: a rectangle, polygon, WKT, GeoJSON or map, less obstacles and walls.

A rectangle has its lower left corner at the origin. All other shapes keep their coordinates, in metres (GeoJSON's too, not
degrees). `scale` multiplies all coordinates. Every mistake of the table is one line.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import shapely
from shapely.affinity import scale
from shapely.geometry import LineString, MultiPolygon, Polygon, box

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import ArenaTable
from zwerm.scenario.types import Point, is_file

Space: TypeAlias = Polygon | MultiPolygon
T = TypeVar("T")

# Keeps a gap open that is exactly as wide as required.
_NARROWER = 1.0 - 1e-6
# The mitre limit: right-angled corners stay, sharper ones lose their tips.
_CORNER = 1.5

_SOURCES = ("size_m", "polygon", "wkt", "geojson", "map")


def read_shape(table: ArenaTable, folder: Path) -> tuple[Space, list[LineString]]:
    """Return free space and the walls without thickness [m].

    Relative paths start at `folder`, or else where the process runs. Raises ScenarioError with every mistake, each
    `arena.key: rule, got value`.
    """
    mistakes: list[str] = []

    def attempt(read: Callable[..., T], *arguments: Any) -> T | None:
        try:
            return read(*arguments)
        except ScenarioError as error:
            mistakes.extend(error.mistakes)
            return None

    space = attempt(_space, table, folder)
    obstacles = [attempt(_polygon, each, f"arena.obstacles.{i}") for i, each in enumerate(table.obstacles)]
    walls = [attempt(_wall, each, f"arena.walls.{i}") for i, each in enumerate(table.walls)]
    if mistakes:
        raise ScenarioError(mistakes)
    free = shapely.difference(space, shapely.union_all(obstacles))
    if free.is_empty:
        raise ScenarioError(["arena.obstacles: expected some free space beside them, got none"])
    factor = table.scale
    if table.free_area_m2 is not None:
        if factor != 1.0:
            raise ScenarioError([f"arena.scale: expected none beside free_area_m2, got {factor:g}"])
        factor = math.sqrt(table.free_area_m2 / free.area)
    if factor != 1.0:
        by = {"xfact": factor, "yfact": factor, "origin": (0.0, 0.0)}
        free, walls = scale(free, **by), [scale(wall, **by) for wall in walls]
    if table.passage_m is not None:
        start = None if table.start is None else shapely.Point(factor * table.start[0], factor * table.start[1])
        free = _passable(free, table.passage_m, start)
    return free, walls


def _passable(free: Space, passage_m: float, start: shapely.Point | None) -> Polygon:
    """Return the part of free space that a disc of diameter `passage_m` reaches, with the corners that it does not fill."""
    inner = shapely.buffer(free, -_NARROWER * passage_m / 2.0)
    if inner.is_empty:
        raise ScenarioError([f"arena.passage_m: expected some place that is wider, got {passage_m:g}"])
    parts = shapely.get_parts(inner)
    kept = max(parts, key=lambda each: each.area) if start is None else min(parts, key=start.distance)
    grown = shapely.buffer(kept, passage_m / 2.0, join_style="mitre", mitre_limit=_CORNER)
    return max(shapely.get_parts(shapely.intersection(grown, free)), key=lambda each: each.area)


def _space(table: ArenaTable, folder: Path) -> Space:
    given = [key for key in _SOURCES if getattr(table, key) is not None]
    if len(given) != 1 and given != ["size_m", "map"]:
        got = " and ".join(given) or "none"
        raise ScenarioError([f"arena: expected exactly one of {', '.join(_SOURCES)}, got {got}"])
    if table.map is not None:
        path = _find(table.map, folder, "arena.map")
        # Not above: what reads maps is slow to import, and few arenas are maps.
        from zwerm.world.arena.grid_maps import SUFFIXES, grid_space
        from zwerm.world.arena.maps import read_map

        return grid_space(path, table) if path.suffix.lower() in SUFFIXES else read_map(path, table)
    stray = [key for key in ("resolution_m", "start") if getattr(table, key) is not None]
    if stray:
        raise ScenarioError([f"arena.{key}: goes with a map only, got {getattr(table, key)}" for key in stray])
    if table.size_m is not None:
        return box(0.0, 0.0, *table.size_m)
    if table.polygon is not None:
        return _polygon(table.polygon, "arena.polygon")
    if table.wkt is not None:
        return _wkt(table.wkt)
    assert table.geojson is not None
    return _geojson(table.geojson, folder)


def _find(name: str, folder: Path, place: str) -> Path:
    for path in (folder / name, Path(name)):
        if is_file(path):
            return path
    raise ScenarioError([f"{place}: no such file, got {name}"])


def _polygon(points: list[Point], place: str) -> Polygon:
    return _checked(Polygon(points), place)


def _wall(points: list[Point], place: str) -> LineString:
    line = LineString(points)
    if line.length == 0.0:
        raise ScenarioError([f"{place}: expected a length > 0, got {points}"])
    return line


def _wkt(text: str) -> Space:
    try:
        shape = shapely.from_wkt(text)
    except shapely.errors.ShapelyError:
        raise ScenarioError([f"arena.wkt: expected well-known text, got {_short(text)}"]) from None
    if not isinstance(shape, Polygon | MultiPolygon):
        kind = shape.geom_type.upper()
        raise ScenarioError([f"arena.wkt: expected POLYGON or MULTIPOLYGON, got {kind}"])
    return _checked(shape, "arena.wkt")


def _geojson(text: str, folder: Path) -> Space:
    place = "arena.geojson"
    if not text.lstrip().startswith("{"):
        path = _find(text, folder, place)
        place = f"{place}: {path}"
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            raise ScenarioError([f"{place}: cannot be read as text"]) from None
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        raise ScenarioError([f"{place}: not JSON: {error}"]) from None
    parts = [_checked(part, place) for part in _geojson_parts(value, place)]
    return _checked(shapely.union_all(parts), place)


def _geojson_parts(value: Any, place: str) -> list[Space]:
    kind = value.get("type") if isinstance(value, dict) else None
    if kind == "FeatureCollection" and isinstance(value.get("features"), list):
        return [part for feature in value["features"] for part in _geojson_parts(feature, place)]
    if kind == "Feature":
        return _geojson_parts(value.get("geometry"), place)
    if kind not in ("Polygon", "MultiPolygon"):
        expected = "Polygon, MultiPolygon, Feature or FeatureCollection"
        raise ScenarioError([f"{place}: expected {expected}, got {_short(kind or value)}"])
    try:
        return [shapely.from_geojson(json.dumps(value))]
    except shapely.errors.ShapelyError:
        raise ScenarioError([f"{place}: expected rings of [x, y], closed, got {_short(value)}"]) from None


def _checked(shape: Space, place: str) -> Space:
    """Return the shape in 2D. Raises ScenarioError unless it has an area and does not meet itself."""
    shape = shapely.force_2d(shape)
    if not shape.is_valid:
        what, _, where = shapely.is_valid_reason(shape).rstrip("]").partition("[")
        reason = f"{what.lower()} at ({where.replace(' ', ', ')})"
        raise ScenarioError([f"{place}: expected a simple polygon, got {reason}"])
    if shape.area <= 0.0:
        raise ScenarioError([f"{place}: expected an area > 0, got {shape.area:g}"])
    return shape


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
