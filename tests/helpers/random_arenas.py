"""Random polygonal arenas, keyed by a seed: bent halls, and walls almost parallel to slices; places for a team to start."""

import math
from typing import Any

import numpy as np
import shapely
import shapely.affinity
from shapely.geometry import MultiPolygon, Point, Polygon

# The free space is opened by a disc a little larger than the body: no gap through which it fits by a hair only.
OPENING_M = 0.3
SPACING_M = 0.95
ORIGIN_M = 0.37
# The radius of the robots.
BODY_M = 0.25
# The distance of the rows in which robots start where there is no room for one row.
ROW_M = 0.8


def random_arena(seed: int, robots: int) -> tuple[dict[str, Any], list[list[float]]]:
    """Return the `[arena]` table of seed `seed`, and the poses of `robots` robots that start in line, one slice apart."""
    random = np.random.default_rng(10_000 + seed)
    while True:
        width, height = random.uniform(10.0, 18.0), random.uniform(8.0, 14.0)
        hall = _hall(random, width, height)
        blocks = [_block(random, width, height) for _ in range(int(random.integers(0, 5)))]
        free = hall.difference(shapely.union_all(blocks)) if blocks else hall
        opened = free.buffer(-OPENING_M, join_style="mitre").buffer(OPENING_M, join_style="mitre").intersection(free)
        part = max(shapely.get_parts(opened), key=lambda each: each.area)
        part = shapely.remove_repeated_points(part.simplify(0.02), 0.05)
        if not isinstance(part, Polygon) or not part.is_valid or part.area < 40.0:
            continue
        poses = start_line(random, part, robots)
        if poses is not None:
            rings = [np.round(np.asarray(ring.coords)[:-1], 3).tolist() for ring in (part.exterior, *part.interiors)]
            return {"polygon": rings[0], "obstacles": rings[1:]}, poses


def leaning_arena(seed: int) -> dict[str, Any]:
    """Return the `[arena]` table of a hall with an obstacle whose walls are almost parallel to the slices.

    A body of `BODY_M` at such a wall is on a slice half-way up, and leaves it at an angle of 0.1 to 5 degrees.
    """
    random = np.random.default_rng([99, seed])
    width, height = random.uniform(8.0, 12.0), random.uniform(5.0, 8.0)

    def wall(k: int, side: int) -> tuple[float, float]:
        """Return x at the foot and at the top of a wall with free space on its `side`, beside slice k."""
        slope = random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-2.7, -1.1)
        x, y = ORIGIN_M + SPACING_M * k - side * BODY_M, height * random.uniform(0.3, 0.7)
        return float(x - slope * y), float(x + slope * (height - y))

    last = int((width - ORIGIN_M) / SPACING_M)
    left, right = wall(1, 1), wall(last, -1)
    inner, outer = wall(last // 2, -1), wall(last // 2 + 2, 1)
    hall = [[left[0], 0.0], [right[0], 0.0], [right[1], height], [left[1], height]]
    low, high = 0.3, 0.7
    block = [
        [foot + (top - foot) * part, height * part]
        for (foot, top), part in ((inner, low), (outer, low), (outer, high), (inner, high))
    ]
    return {"polygon": np.round(hall, 4).tolist(), "obstacles": [np.round(block, 4).tolist()]}


def _hall(random: np.random.Generator, width: float, height: float) -> Polygon:
    """Return a star-shaped polygon of random corners about the middle of a box."""
    count = int(random.integers(5, 12))
    angles = np.sort(random.uniform(0.0, 2.0 * math.pi, count))
    radius = random.uniform(0.55, 1.0, count)
    x = width / 2.0 * (1.0 + radius * np.cos(angles))
    y = height / 2.0 * (1.0 + radius * np.sin(angles))
    shape = Polygon(np.column_stack([x, y])).buffer(0)
    if isinstance(shape, MultiPolygon) or shape.is_empty or shape.area < 0.4 * width * height:
        return Polygon([(0, 0), (width, 0), (width, height), (0, height)])
    return shape


def _block(random: np.random.Generator, width: float, height: float) -> Polygon:
    """Return a random polygon with 3 to 7 corners."""
    count = int(random.integers(3, 8))
    angles = np.sort(random.uniform(0.0, 2.0 * math.pi, count))
    radius = random.uniform(0.5, 2.2) * random.uniform(0.5, 1.0, count)
    x = random.uniform(0.1, 0.9) * width + radius * np.cos(angles)
    y = random.uniform(0.1, 0.9) * height + radius * np.sin(angles)
    return Polygon(np.column_stack([x, y])).buffer(0)


def start_line(
    random: np.random.Generator, free: Polygon, robots: int, origin_m: float = ORIGIN_M
) -> list[list[float]] | None:
    """Return poses in a row, each near a slice of its own, or None where there is no room for such a row."""
    inner = free.buffer(-0.3)
    if inner.is_empty:
        return None
    xmin, ymin, xmax, ymax = inner.bounds
    for _ in range(200):
        first = math.ceil((random.uniform(xmin, xmax) - origin_m) / SPACING_M)
        y = random.uniform(ymin, ymax)
        places = [(origin_m + (first + i) * SPACING_M + 0.02, y) for i in range(robots)]
        if all(inner.contains(Point(place)) for place in places):
            return [[round(x, 3), round(y, 3), 0.0] for x, y in places]
    return None


def start_group(random: np.random.Generator, free: Polygon, robots: int, origin_m: float) -> list[list[float]]:
    """Return poses with random headings: in one row if there is room for it, else in as few rows as possible."""
    for rows in range(1, robots + 1):
        columns = math.ceil(robots / rows)
        line = start_line(random, free.intersection(_moved_down(free, rows)), columns, origin_m)
        if line is not None:
            places = [(x, y + ROW_M * row) for row in range(rows) for x, y, _ in line][:robots]
            return [[x, round(y, 3), round(float(random.uniform(-math.pi, math.pi)), 3)] for x, y in places]
    raise ValueError(f"no room for {robots} robots")


def _moved_down(free: Polygon, rows: int) -> Polygon:
    """Return the places above which there is room for so many rows."""
    return shapely.intersection_all([shapely.affinity.translate(free, 0.0, -ROW_M * row) for row in range(rows)])
