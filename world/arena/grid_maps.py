"""Grid maps of the planning benchmarks, as exact arenas: MovingAI maps (`.map`) and coverage instances on them (`.mcpp`).

A `.map` file is text (Sturtevant, Benchmarks for Grid-Based Pathfinding, 2012). Four lines come first: `type octile` (or
another word), `height ROWS`, `width COLUMNS` and `map`. ROWS lines of COLUMNS characters follow, the top row first. The
characters `.`, `G` and `S` are free (ground, and shallow water); `@`, `O`, `T` and `W` are not (out of bounds, trees, water).

A `.mcpp` file is YAML (instances beside Tang and Ma, Large-Scale Multi-Robot Coverage Path Planning via Local Search, 2024).
`map` is the name of a `.map` file without its suffix. `root` has the start cell of each robot: [column, row] with row 0 at the
top, or the number column * ROWS + row. The weights of an instance are costs of edges of a graph, which an arena has not; other
keys are ignored. The `.map` file stands beside the instance, or in a folder `gridmaps` there or one above.

A cell becomes a square of `arena.resolution_m`. The outline follows the cells exactly. Cells that touch at a corner are not
connected. Every mistake is one line that names the file.
"""

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import shapely
import yaml
from numpy.typing import NDArray
from shapely.geometry import Polygon, box

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import ArenaTable, PlacementTable
from zwerm.scenario.types import is_file
from zwerm.world.arena.raster import component
from zwerm.world.arena.yaml_text import parse_yaml

Bools = NDArray[np.bool_]
Cell = tuple[int, int]

SUFFIXES: Final = (".map", ".mcpp")
FREE: Final = ".GS"
BLOCKED: Final = "@OTW"
CELLS_MAX: Final = 4_000_000


class GridMap(NamedTuple):
    """Free cells (rows, columns), the top row first, and the start cells (row, column) of robots, which a `.map` has not."""

    free: Bools
    roots: tuple[Cell, ...] = ()


def read_grid_map(path: Path) -> GridMap:
    """Return the cells of a `.map`, or of the map of a `.mcpp` with its start cells. Raises ScenarioError."""
    if path.suffix.lower() != ".mcpp":
        return GridMap(_cells(path))
    instance = _instance(path)
    map_path = _map_of(path, instance["map"])
    free = _cells(map_path)
    return GridMap(free, _roots(path, instance["root"], free))


def grid_space(path: Path, table: ArenaTable) -> Polygon:
    """Return the free space [m] of the grid map at `path`, the lower left corner of the map at the origin.

    It is the component with `table.start` in it, or with the first start cell of an instance, or else the largest. Raises
    ScenarioError.
    """
    if table.resolution_m is None or table.size_m is not None:
        raise ScenarioError([f"arena.map: {path}: a grid map needs resolution_m, and takes no size_m"])
    grid, cell_m = read_grid_map(path), table.resolution_m
    free = grid.free[::-1]
    if not free.any():
        raise ScenarioError([f"arena.map: {path}: expected at least one free cell, got none"])
    start = None
    if table.start is not None:
        start = int(table.start[1] // cell_m), int(table.start[0] // cell_m)
    elif grid.roots:
        start = len(free) - 1 - grid.roots[0][0], grid.roots[0][1]
    try:
        kept = component(free, start)
    except ValueError:
        raise ScenarioError([f"arena.start: expected a place in the map's free space, got {table.start}"]) from None
    edges = np.diff(np.pad(kept, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    runs = zip(np.argwhere(edges == 1).tolist(), np.argwhere(edges == -1)[:, 1].tolist(), strict=True)
    boxes = [box(left * cell_m, row * cell_m, right * cell_m, (row + 1) * cell_m) for (row, left), right in runs]
    merged = shapely.union_all(boxes)
    assert isinstance(merged, Polygon)
    return merged.simplify(0.0)


def root_placement(placement: PlacementTable, arena: ArenaTable, folder: Path, count: int) -> PlacementTable:
    """Return the placement `roots` as poses: robots in the middle of the first `count` start cells of a `.mcpp`.

    Raises ScenarioError where the arena is no such instance, or has fewer start cells.
    """
    place = "robots.placement.kind"
    if arena.map is None or not arena.map.lower().endswith(".mcpp") or arena.resolution_m is None:
        raise ScenarioError([f"{place}: roots needs an arena.map of the kind .mcpp, got {arena.map}"])
    if arena.free_area_m2 is not None:
        raise ScenarioError([f"{place}: roots goes with arena.scale, and not with free_area_m2"])
    path = folder / arena.map
    grid = read_grid_map(path if is_file(path) else Path(arena.map))
    if len(grid.roots) < count:
        raise ScenarioError([f"{place}: {arena.map} has {len(grid.roots)} start cells, got {count} robots"])
    cell_m, rows = arena.resolution_m * arena.scale, len(grid.free)
    poses = [((column + 0.5) * cell_m, (rows - row - 0.5) * cell_m, 0.0) for row, column in grid.roots[:count]]
    return placement.model_copy(update={"kind": "poses", "poses": poses})


def _cells(path: Path) -> Bools:
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError):
        raise ScenarioError([f"arena.map: {path}: cannot be read as ASCII text"]) from None
    if len(lines) < 4 or not lines[0].startswith("type") or lines[3].strip() != "map":
        raise ScenarioError([f"arena.map: {path}: expected the lines type, height, width and map first"])
    rows, columns = (_number(path, lines[index], index, word) for index, word in ((1, "height"), (2, "width")))
    if rows * columns > CELLS_MAX:
        raise ScenarioError([f"arena.map: {path}: expected at most {CELLS_MAX} cells, got {rows * columns}"])
    cells = lines[4 : 4 + rows]
    if len(cells) < rows:
        raise ScenarioError([f"arena.map: {path}: expected {rows} rows, got {len(cells)}"])
    for number, line in enumerate(cells, 5):
        if len(line) != columns:
            raise ScenarioError([f"arena.map: {path}: line {number}: expected {columns} cells, got {len(line)}"])
        unknown = line.translate({ord(each): None for each in FREE + BLOCKED})
        if unknown:
            rule = f"expected cells of {FREE}{BLOCKED}"
            raise ScenarioError([f"arena.map: {path}: line {number}: {rule}, got {unknown[0]!r}"])
    return np.array([[each in FREE for each in line] for line in cells], dtype=np.bool_).reshape(rows, columns)


def _number(path: Path, line: str, index: int, word: str) -> int:
    key, _, value = line.strip().partition(" ")
    if key != word or not value.strip().isdecimal() or int(value) < 1:
        raise ScenarioError([f"arena.map: {path}: line {index + 1}: expected {word} and a number > 0, got {line!r}"])
    return int(value)


def _instance(path: Path) -> dict[str, Any]:
    try:
        found = parse_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        raise ScenarioError([f"arena.map: {path}: cannot be read as YAML"]) from None
    missing = [key for key in ("map", "root") if not isinstance(found, dict) or key not in found]
    if missing:
        raise ScenarioError([f"arena.map: {path}: {key}: missing" for key in missing])
    return dict(found)


def _map_of(path: Path, name: object) -> Path:
    for folder in (path.parent, path.parent / "gridmaps", path.parent.parent / "gridmaps"):
        if is_file(folder / f"{name}.map"):
            return folder / f"{name}.map"
    raise ScenarioError([f"arena.map: {path}: map: no such file, got {name}.map"])


def _roots(path: Path, given: object, free: Bools) -> tuple[Cell, ...]:
    rows, columns = free.shape
    found: list[Cell] = []
    for each in given if isinstance(given, list) else [given]:
        if type(each) is int:
            column, row = divmod(each, rows)
        elif isinstance(each, list) and len(each) == 2 and all(type(number) is int for number in each):
            column, row = each
        else:
            raise ScenarioError([f"arena.map: {path}: root: expected [column, row] for each robot, got {each!r}"])
        if not (0 <= row < rows and 0 <= column < columns and free[row, column]):
            raise ScenarioError([f"arena.map: {path}: root: expected free cells, got {each!r}"])
        found.append((row, column))
    return tuple(found)
