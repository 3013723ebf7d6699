"""Free cells of an image as one exact polygon: it follows the cracks between free cells and all others.

Free cells are connected by sides, walls by sides and corners: a diagonal wall one pixel thin has no gap. Staircases become
straight lines. The outline moves by less than one pixel, and this neither opens a wall nor closes a passage. One component of
free cells is kept: the one with a given cell, or else the largest. The others (specks in walls, closed rooms) become wall.
The edge of the image is a wall. This module has no files and no units.
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from shapely.geometry import Polygon

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Cutting corners moves the outline by at most sqrt(1/8) px, straightening by at most this: together less than 1 px.
_STRAIGHTEN_PX = 0.6
_STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])  # the four directions of a crack; adding one turns left


def component(free: Bools, cell: tuple[int, int] | None = None) -> Bools:
    """Return the component of `free` (h, w) that contains `cell` (row, column), or else the largest.

    Raises ValueError where no cell is free, or `cell` is not.
    """
    label, count = ndimage.label(free)
    if count == 0:
        raise ValueError("no free cell")
    if cell is None:
        sizes = np.bincount(label.ravel())[1:]
        return np.asarray(label == 1 + int(np.argmax(sizes)))
    row, column = cell
    if not (0 <= row < free.shape[0] and 0 <= column < free.shape[1] and free[row, column]):
        raise ValueError("not a free cell")
    return np.asarray(label == label[row, column])


def outline(free: Bools) -> Polygon:
    """Return the polygon of one component of free cells (h, w); cell [y, x] is the unit square up from (x, y)."""
    rings = [_cut_corners(*ring) for ring in _trace(free)]
    tolerance = np.where([len(ring) > 4 for ring in rings], _STRAIGHTEN_PX, 0.0)
    while True:
        straight = _straighten(rings, tolerance)
        wrong = _entangled(straight) & (tolerance > 0.0)
        if not wrong.any():
            break
        tolerance[wrong] = 0.0  # outlines that are not straightened never cross, so this ends
    areas = [_signed_area(ring) for ring in straight]
    shell = int(np.argmax(areas))  # free space is on the left, so only the shell runs counter-clockwise
    return Polygon(straight[shell], [ring for index, ring in enumerate(straight) if index != shell])


def _trace(free: Bools) -> list[tuple[Ints, Bools]]:
    """Return every ring of cracks with free space on its left: corners (n, 2), and whether two rings meet there (n,)."""
    padded = np.pad(free, 1)
    height, width = free.shape[0] + 1, free.shape[1] + 1
    below, above = padded[:-1, 1:], padded[1:, 1:]  # of the crack that leaves each grid point eastward
    left, right = padded[1:, :-1], padded[1:, 1:]  # of the crack that leaves it northward
    east, west, north, south = above & ~below, below & ~above, left & ~right, right & ~left
    leaving = np.zeros((4, height, width), dtype=np.bool_)
    leaving[0], leaving[1] = east, north
    leaving[2, :, 1:], leaving[3, 1:, :] = west[:, :-1], south[:-1, :]

    crack = np.flatnonzero(leaving)
    direction, point = np.divmod(crack, height * width)
    y, x = np.divmod(point, width)
    x_end, y_end = x + _STEPS[direction, 0], y + _STEPS[direction, 1]
    turn_left, turn_right = (direction + 1) % 4, (direction + 3) % 4
    # Where two rings meet in a point, a left turn stays at the same free cell, and keeps the walls connected.
    onward = np.where(leaving[direction, y_end, x_end], direction, turn_right)
    onward = np.where(leaving[turn_left, y_end, x_end], turn_left, onward)
    following = np.searchsorted(crack, (onward * height + y_end) * width + x_end).tolist()
    shared = leaving.sum(axis=0) == 2

    rings = []
    seen = bytearray(len(crack))
    for first in range(len(crack)):
        if seen[first]:
            continue
        walk, at = [], first
        while not seen[at]:
            seen[at] = 1
            walk.append(at)
            at = following[at]
        ring = np.array(walk)
        turns = direction[ring] != np.roll(direction[ring], 1)
        corner = ring[turns]
        rings.append((np.column_stack([x[corner], y[corner]]), shared[y[corner], x[corner]]))
    return rings


def _cut_corners(corners: Ints, shared: Bools) -> Floats:
    """Return the points (n, 2) of a ring without the corners of staircases and those where two rings meet.

    A cut begins half a pixel before the corner. Corners between runs of two or more pixels stay, and all of a rectangle.
    """
    run_before = corners - np.roll(corners, 1, axis=0)
    run_after = np.roll(run_before, -1, axis=0)
    length_before, length_after = np.abs(run_before).sum(axis=1), np.abs(run_after).sum(axis=1)
    rectangle = len(corners) == 4
    cut = shared | ((length_before == 1) | (length_after == 1)) & (not rectangle)
    offset = 0.5 * cut[:, None]
    entry = corners - offset * run_before / length_before[:, None]
    leave = corners + offset * run_after / length_after[:, None]
    points = np.stack([entry, leave], axis=1).reshape(-1, 2)
    kept: Floats = points[(points != np.roll(points, 1, axis=0)).any(axis=1)]
    return kept


def _straighten(rings: list[Floats], tolerance_px: Floats) -> list[Floats]:
    """Return the rings without points closer than their tolerance to the line without them (Douglas, Peucker 1973).

    A ring is split at two distant points, which stay; a ring that would collapse into a line is not changed.
    """
    halves = []
    for ring in rings:
        first = int(np.lexsort((ring[:, 1], ring[:, 0]))[0])
        from_first = np.roll(ring, -first, axis=0)
        far = int(np.argmax(((from_first - from_first[0]) ** 2).sum(axis=1)))
        halves += [from_first[: far + 1], np.vstack([from_first[far:], from_first[:1]])]
    owner = np.repeat(np.arange(len(halves)), [len(half) for half in halves])
    lines = shapely.linestrings(np.vstack(halves), indices=owner)
    lines = shapely.simplify(lines, np.repeat(tolerance_px, 2), preserve_topology=False)
    points, owner = shapely.get_coordinates(lines, return_index=True)
    inner = np.diff(owner, append=-1) == 0  # each half ends where the next begins
    points, owner = points[inner], owner[inner] // 2
    straight = np.split(points, np.searchsorted(owner, np.arange(1, len(rings))))
    return [new if len(new) > 3 else old for new, old in zip(straight, rings, strict=True)]


def _entangled(rings: list[Floats]) -> Bools:
    """Return (n,) whether each ring meets itself or another."""
    owner = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
    lines = shapely.linearrings(np.vstack(rings), indices=owner)
    wrong: Bools = ~shapely.is_simple(lines)
    one, other = shapely.STRtree(lines).query(lines, predicate="intersects")
    wrong[one[one != other]] = True
    return wrong


def _signed_area(ring: Floats) -> float:
    x, y = ring.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
