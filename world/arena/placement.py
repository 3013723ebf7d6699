"""Start positions: robots are drawn one after the other, each until it is clear of walls and of the robots before it.

The tries of robot i are keyed by its id and the number of the try. So an additional robot moves no robot with a lower id,
and no robot whose place stays free. Robots start only where they can move, not in a pocket behind a narrow gap. This
is the largest part of each polygon of free space that a disc of their radius can reach. Given poses may be anywhere in
free space. Walls without thickness close off nothing here.
"""

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from zwerm.errors import ScenarioError
from zwerm.maths.keyed_random import Draws
from zwerm.scenario.tables import PlacementTable
from zwerm.world.arena.arena import Arena

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Rectangle = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax [m]
Spread = Callable[[Floats], Floats]  # draws (..., 2) in [0, 1) to places (..., 2) [m], uniformly

TRIES = 10_000
_FIRST_TRIES = 8  # drawn for all robots at once
_ENTRY_TRIES = 8

_KEYS = {  # by kind: the required keys, and the optional ones
    "uniform": ((), ()),
    "disc": (("radius_m",), ("center_m",)),
    "cell": (("grid", "radius_m"), ("cell",)),
    "poses": (("poses",), ()),
}


def place(
    table: PlacementTable, arena: Arena, count: int, radius_m: float, draws: Draws, entry: Rectangle | None = None
) -> tuple[Floats, Floats]:
    """Return positions (count, 2) [m] and headings (count,) [rad], in [-pi, pi) where they are drawn.

    Centres are at least radius_m from every wall and twice that from each other. The rectangle `entry` replaces the bounds
    of the arena for uniform placement, random discs and grids. Raises ScenarioError for a contradictory table, and where a
    robot finds no room in TRIES tries.
    """
    _check_keys(table)
    if table.kind == "poses":
        return _poses(table, arena, count, radius_m)
    ground = _Ground(arena, radius_m)
    spread = _spread(table, ground, entry or arena.bounds, draws)
    ids = np.arange(count)
    heading = -np.pi + 2.0 * np.pi * draws.uniform("placement-heading", ids)
    first = spread(_tries(draws, ids, 0, _FIRST_TRIES))
    admitted = ground.admits(first.reshape(-1, 2)).reshape(count, _FIRST_TRIES)
    position = np.empty((count, 2))
    for robot in range(count):
        others = position[:robot]
        spot = _first_clear(first[robot][admitted[robot]], others, radius_m)
        start = _FIRST_TRIES
        while spot is None and start < TRIES:
            end = min(8 * start, TRIES)
            more = spread(_tries(draws, robot, start, end))
            spot = _first_clear(more[ground.admits(more)], others, radius_m)
            start = end
        if spot is None:
            raise ScenarioError([f"robots.placement: no room for robot {robot} of {count} after {TRIES} tries"])
        position[robot] = spot
    return position, heading


def free_spot(
    rectangle: Rectangle,
    arena: Arena,
    occupied: Floats,
    radius_m: float,
    draws: Draws,
    purpose: str,
    *ids: int,
) -> Floats | None:
    """Return a place (2,) [m] in the rectangle, clear of walls and of robots at occupied (n, 2), or None.

    The tries are keyed by (purpose, ids, try), so that a caller can try again with another id.
    """
    draw = draws.uniform(purpose, *ids, np.arange(_ENTRY_TRIES)[:, None], np.arange(2))
    spots = _in_rectangle(rectangle)(draw)
    return _first_clear(spots[arena.contains(spots, radius_m)], occupied, radius_m)


class _Ground:
    """The places at which a body of a radius may start."""

    def __init__(self, arena: Arena, radius_m: float) -> None:
        self._arena, self._radius_m = arena, radius_m
        self._roaming = None
        if not arena.is_convex:
            parts = [shapely.get_parts(part.buffer(-radius_m)) for part in shapely.get_parts(arena.free)]
            self._roaming = shapely.MultiPolygon([max(each, key=lambda part: part.area) for each in parts if len(each)])
            shapely.prepare(self._roaming)

    def admits(self, points: Floats) -> Bools:
        """Return (k,) whether a body may start with its centre at each of points (k, 2)."""
        if self._roaming is None:
            return self._arena.contains(points, self._radius_m)
        admitted: Bools = shapely.contains_xy(self._roaming, points[:, 0], points[:, 1])
        # The eroded polygon approximates round corners by chords and ignores thin walls, so test these too.
        admitted[admitted] = self._arena.contains(points[admitted], self._radius_m)
        return admitted


def _check_keys(table: PlacementTable) -> None:
    needed, possible = _KEYS[table.kind]
    given = table.model_dump(exclude_none=True, exclude={"kind"})
    mistakes = [
        f"robots.placement.{key}: {table.kind} needs it, and it is missing" for key in needed if key not in given
    ]
    mistakes += [
        f"robots.placement.{key}: {table.kind} takes no such key, got {value}"
        for key, value in given.items()
        if key not in needed + possible
    ]
    if table.grid is not None and table.cell is not None and not mistakes:
        (columns, rows), (column, row) = table.grid, table.cell
        if column >= columns or row >= rows:
            rule = f"expected column < {columns} and row < {rows}"
            mistakes.append(f"robots.placement.cell: {rule}, got ({column}, {row})")
    if mistakes:
        raise ScenarioError(mistakes)


def _spread(table: PlacementTable, ground: _Ground, bounds: Rectangle, draws: Draws) -> Spread:
    if table.kind == "uniform":
        return _in_rectangle(bounds)
    assert table.radius_m is not None
    if table.center_m is not None:
        center = np.array(table.center_m)
    elif table.kind == "disc":
        center = _random_center(table.radius_m, ground, bounds, draws)
    else:
        assert table.grid is not None
        center = _cell_center(table.grid, table.cell, ground, bounds, draws)
    return _in_disc(center, table.radius_m)


def _in_rectangle(rectangle: Rectangle) -> Spread:
    corner = np.array(rectangle[:2])
    size = np.array(rectangle[2:]) - corner
    return lambda draw: corner + draw * size


def _in_disc(center: Floats, radius_m: float) -> Spread:
    def spread(draw: Floats) -> Floats:
        distance, angle = radius_m * np.sqrt(draw[..., 0]), 2.0 * np.pi * draw[..., 1]
        return center + np.stack([distance * np.cos(angle), distance * np.sin(angle)], axis=-1)

    return spread


def _random_center(radius_m: float, ground: _Ground, bounds: Rectangle, draws: Draws) -> Floats:
    """Return a centre (2,) that a robot may take and whose disc lies within the bounds."""
    xmin, ymin, xmax, ymax = bounds
    widest = min(xmax - xmin, ymax - ymin) / 2.0
    if radius_m > widest:
        rule = f"expected at most {widest:g}, for the disc to lie in the arena's bounds"
        raise ScenarioError([f"robots.placement.radius_m: {rule}, got {radius_m:g}"])
    inner = _in_rectangle((xmin + radius_m, ymin + radius_m, xmax - radius_m, ymax - radius_m))

    def centers(tries: Ints) -> Floats:
        return inner(draws.uniform("placement-disc", tries[:, None], np.arange(2)))

    return _first_admitted(centers, ground, "the disc's centre")


def _cell_center(
    grid: tuple[int, int], cell: tuple[int, int] | None, ground: _Ground, bounds: Rectangle, draws: Draws
) -> Floats:
    """Return the centre (2,) of the cell (column, row), or of a random cell whose centre a robot may take."""
    xmin, ymin, xmax, ymax = bounds
    size = np.array([xmax - xmin, ymax - ymin]) / grid
    if cell is not None:
        return np.array([xmin, ymin]) + (np.array(cell) + 0.5) * size

    def centers(tries: Ints) -> Floats:
        index = (draws.uniform("placement-cell", tries) * (grid[0] * grid[1])).astype(np.int64)
        row, column = np.divmod(index, grid[0])
        return np.array([xmin, ymin]) + (np.column_stack([column, row]) + 0.5) * size

    return _first_admitted(centers, ground, "a cell's centre")


def _first_admitted(points: Callable[[Ints], Floats], ground: _Ground, what: str) -> Floats:
    for start in range(0, TRIES, 100):
        some = points(np.arange(start, start + 100))
        admitted = ground.admits(some)
        if admitted.any():
            chosen: Floats = some[np.argmax(admitted)]
            return chosen
    raise ScenarioError([f"robots.placement: no free place for {what} after {TRIES} tries"])


def _tries(draws: Draws, robots: ArrayLike, start: int, end: int) -> Floats:
    """Return the draws (..., end - start, 2) of each robot for the tries from start to end."""
    robot = np.asarray(robots)[..., None, None]
    return draws.uniform("placement", robot, np.arange(start, end)[:, None], np.arange(2))


def _first_clear(spots: Floats, others: Floats, radius_m: float) -> Floats | None:
    """Return the first of spots (k, 2) at which no robot overlaps one at others (n, 2), or None."""
    if len(spots) == 0:
        return None
    if len(others) == 0:
        return np.array(spots[0])
    dx, dy = (spots[:, None, axis] - others[:, axis] for axis in (0, 1))
    clear = (dx * dx + dy * dy >= (2.0 * radius_m) ** 2).all(axis=1)
    return np.array(spots[np.argmax(clear)]) if clear.any() else None


def _poses(table: PlacementTable, arena: Arena, count: int, radius_m: float) -> tuple[Floats, Floats]:
    assert table.poses is not None
    if len(table.poses) != count:
        raise ScenarioError(
            [f"robots.placement.poses: expected one for each of {count} robots, got {len(table.poses)}"]
        )
    return placed(table.poses, [f"robots.placement.poses.{robot}" for robot in range(count)], arena, radius_m)


def placed(
    given: Sequence[tuple[float, float, float]], keys: Sequence[str], arena: Arena, radius_m: float
) -> tuple[Floats, Floats]:
    """Return positions (n, 2) [m] and headings (n,) [rad] of n given poses.

    Raises ScenarioError, with the keys of the poses, for poses in a wall or too near to each other.
    """
    poses = np.array(given)
    position = poses[:, :2]
    mistakes = []
    for robot, inside in enumerate(arena.contains(position, radius_m)):
        key, (x, y) = keys[robot], position[robot]
        if not inside:
            mistakes.append(f"{key}: expected free space {radius_m:g} m around, got ({x:g}, {y:g})")
        gap = np.hypot(*(position[:robot] - position[robot]).T)
        if robot and gap.min() < 2.0 * radius_m:
            nearest = int(np.argmin(gap))
            mistakes.append(f"{key}: expected {2 * radius_m:g} m to robot {nearest}, got {gap[nearest]:g} m")
    if mistakes:
        raise ScenarioError(mistakes)
    return position, poses[:, 2]
