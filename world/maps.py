"""Reading an arena from a scenario's table: rectangles, polygons, WKT, GeoJSON and maps."""

from pathlib import Path

from shapely.geometry import LineString, MultiPolygon, Polygon, box

from zwerm.errors import ScenarioError
from zwerm.scenario import ArenaTable


def read_arena(table: ArenaTable, folder: Path) -> tuple[Polygon | MultiPolygon, list[LineString]]:
    """Return free space and walls without thickness [m]."""
    if table.size_m is not None:
        free = box(0.0, 0.0, *table.size_m)
    elif table.polygon is not None:
        free = Polygon(table.polygon)
    else:
        raise ScenarioError(["arena: not read yet"])
    for obstacle in table.obstacles:
        free = free.difference(Polygon(obstacle))
    return free, [LineString(wall) for wall in table.walls]
