"""Random buildings for sensor coverage, keyed by a kind and a seed: their openings may be a little wider than a body.

rooms      a grid of rooms behind thin walls, with doors of drawn widths; some rooms have several
corridors  a tree of straight corridors of drawn widths, with right-angled corners
caves      discs of drawn sizes along bent ways, with necks between them
pillars    a hall, not always a rectangle, with round and square pillars and thin walls
"""

import math
from typing import Final, TypeAlias

import numpy as np
import shapely
import shapely.affinity
from shapely.geometry import LineString, MultiPolygon, Point, Polygon, box

KINDS: Final = ("rooms", "corridors", "caves", "pillars")
# Least width [m] of an opening: 1.3 times the diameter of a body with a radius of 0.07 m.
OPENING_M: Final = 0.182
WALL_M: Final = 0.1
# Smaller obstacles are left out: one within a triangle of robots is nothing that they could find.
HOLE_M2: Final = 0.02

Shape: TypeAlias = Polygon | MultiPolygon


def random_building(kind: str, seed: int, area_m2: float = 12.0) -> str:
    """Return the free space of a building of about `area_m2`, as WKT."""
    random = np.random.default_rng([KINDS.index(kind), seed])
    drawn = {"rooms": _rooms, "corridors": _corridors, "caves": _caves, "pillars": _pillars}[kind](random, area_m2)
    # A gap that a body just fits through is neither open nor closed: openings are wider, and all else is shut.
    half = OPENING_M / 2.0
    part = max(shapely.get_parts(drawn.buffer(-half, join_style="mitre")), key=lambda each: each.area)
    free = part.buffer(half, join_style="mitre").intersection(drawn)
    free = free.simplify(0.005)
    free = Polygon(free.exterior, [hole for hole in free.interiors if Polygon(hole).area > HOLE_M2])
    return str(shapely.to_wkt(free, rounding_precision=3))


def _rooms(random: np.random.Generator, area_m2: float) -> Shape:
    """Return rooms in a grid. Doors make one connected building, and some more doors make loops."""
    columns = int(random.integers(2, 4))
    rows = max(2, round(area_m2 / (columns * 3.0)))
    width, height = random.uniform(1.4, 2.2, columns), random.uniform(1.3, 2.0, rows)
    x = np.concatenate([[0.0], np.cumsum(width + WALL_M)])
    y = np.concatenate([[0.0], np.cumsum(height + WALL_M)])
    cells = [(i, j) for i in range(columns) for j in range(rows)]
    free = [box(x[i], y[j], x[i] + width[i], y[j] + height[j]) for i, j in cells]
    part = {cell: number for number, cell in enumerate(cells)}
    walls = [((i, j), (i + 1, j)) for i, j in cells if i + 1 < columns]
    walls += [((i, j), (i, j + 1)) for i, j in cells if j + 1 < rows]
    for at in random.permutation(len(walls)):
        (i, j), other = walls[at]
        if part[i, j] == part[other] and random.uniform() > 0.25:
            continue
        old, new = part[other], part[i, j]
        part = {cell: new if number == old else number for cell, number in part.items()}
        door_m = random.uniform(0.2, 0.9)
        if other[0] > i:
            low = y[j] + random.uniform(0.0, height[j] - door_m)
            free.append(box(x[other[0]] - 2.0 * WALL_M, low, x[other[0]] + WALL_M, low + door_m))
        else:
            low = x[i] + random.uniform(0.0, width[i] - door_m)
            free.append(box(low, y[other[1]] - 2.0 * WALL_M, low + door_m, y[other[1]] + WALL_M))
    return shapely.union_all(free)


def _corridors(random: np.random.Generator, area_m2: float) -> Shape:
    """Return corridors that begin at random points of earlier ones, at right angles to them."""
    first = LineString([(0.0, 0.0), (random.uniform(2.0, 4.0), 0.0)])
    lines, widths = [first], [random.uniform(0.25, 0.9)]
    while True:
        free = shapely.union_all(
            [line.buffer(w / 2.0, cap_style="square") for line, w in zip(lines, widths, strict=True)]
        )
        if free.area >= area_m2 or len(lines) > 30:
            return free
        start = lines[int(random.integers(len(lines)))]
        at = start.interpolate(random.uniform(0.0, 1.0), normalized=True)
        (ax, ay), (bx, by) = start.coords
        sign = random.choice([-1.0, 1.0]) * random.uniform(1.5, 3.5) / start.length
        lines.append(LineString([at, (at.x - sign * (by - ay), at.y + sign * (bx - ax))]))
        widths.append(random.uniform(0.25, 0.9))


def _caves(random: np.random.Generator, area_m2: float) -> Shape:
    """Return discs along bent ways from random earlier discs."""
    places, radii = [np.zeros(2)], [random.uniform(0.5, 0.9)]
    links: list[Shape] = []
    while True:
        discs = [Point(*place).buffer(radius, 4) for place, radius in zip(places, radii, strict=True)]
        free = shapely.union_all([*discs, *links])
        if free.area >= area_m2:
            return free
        start = int(random.integers(len(places)))
        turn, radius = random.uniform(-math.pi, math.pi), random.uniform(0.25, 0.9)
        way = (radii[start] + radius) * random.uniform(0.8, 1.2)
        places.append(places[start] + way * np.array([math.cos(turn), math.sin(turn)]))
        radii.append(radius)
        links.append(LineString([places[start], places[-1]]).buffer(random.uniform(0.12, 0.4), 2))


def _pillars(random: np.random.Generator, area_m2: float) -> Shape:
    """Return a hall with 3 to 7 pillars or thin walls, some at its edge; a corner of it may be cut off."""
    ratio = random.uniform(0.5, 1.0)
    width = math.sqrt(1.15 * area_m2 / ratio)
    height = ratio * width
    hall: Shape = box(0.0, 0.0, width, height)
    if random.uniform() < 0.5:
        hall = hall.difference(box(0.0, 0.0, *random.uniform(0.2, 0.5, 2) * (width, height)))
    for _ in range(int(random.integers(3, 8))):
        x, y = random.uniform(0.0, width), random.uniform(0.0, height)
        size, turn = random.uniform(0.15, 0.5), random.uniform(0.0, math.pi)
        shape = random.integers(3)
        if shape == 0:
            block: Shape = Point(x, y).buffer(size, 3)
        elif shape == 1:
            block = shapely.affinity.rotate(box(x - size, y - size, x + size, y + size), turn, use_radians=True)
        else:
            end = (x + 2.5 * size * math.cos(turn), y + 2.5 * size * math.sin(turn))
            block = LineString([(x, y), end]).buffer(WALL_M / 2.0, cap_style="flat")
        hall = hall.difference(block)
    return hall
