"""An index of walls: each cell of a square grid lists its walls, and a line queries the cells it crosses.

Results are candidates for an exact test: they contain every wall that a line meets, and may contain others and repetitions.
Unlike a tree of bounding boxes it stays fast for long diagonal lines, and it answers for all lines at once.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SLACK = 1e-6  # [cells]: rounding cannot put a line into a cell whose walls it then misses


class WallIndex:
    """Walls as segments (m, 4), x0, y0, x1, y1 [m], filed in about two cells a wall."""

    def __init__(self, segments: Floats) -> None:
        low = np.minimum(segments[:, :2], segments[:, 2:]).min(axis=0)
        high = np.maximum(segments[:, :2], segments[:, 2:]).max(axis=0)
        extent = np.maximum(high - low, 1e-3 * (high - low).max())
        self._low = low
        self._cell_m = float(np.sqrt(extent[0] * extent[1] / (2.0 * len(segments))))
        self._shape = np.floor(extent / self._cell_m).astype(np.int64) + 1
        wall, cell = self._file((segments.reshape(-1, 2, 2) - low) / self._cell_m)
        order = np.lexsort((wall, cell))
        self._walls = wall[order]
        counts = np.bincount(cell, minlength=int(self._shape.prod()))
        self._first = np.concatenate([[0], np.cumsum(counts)])

    def candidates(self, start: Floats, end: Floats) -> tuple[Ints, Ints]:
        """Return pairs (line, wall), by line, of walls that the lines from start (k, 2) to end (k, 2) [m] may meet."""
        a, b = (start - self._low) / self._cell_m, (end - self._low) / self._cell_m
        lines, xs, ys = [np.arange(len(a))], [np.floor(a[:, 0])], [np.floor(a[:, 1])]
        for axis in (0, 1):  # the cells entered through a side across this axis
            line, entered, t = _crossings(a[:, axis], b[:, axis])
            beside = a[line, 1 - axis] + t * (b[line, 1 - axis] - a[line, 1 - axis])
            # At a corner of the grid a line may enter either of two cells.
            corner = np.flatnonzero(np.abs(beside - np.round(beside)) <= _SLACK)
            line = np.concatenate([line, line[corner], line[corner]])
            entered = np.concatenate([entered, entered[corner], entered[corner]])
            other = np.concatenate([np.floor(beside), np.round(beside[corner]), np.round(beside[corner]) - 1.0])
            lines.append(line)
            xs.append(entered if axis == 0 else other)
            ys.append(other if axis == 0 else entered)
        line, x, y = np.concatenate(lines), np.concatenate(xs), np.concatenate(ys)
        inside = (x >= 0) & (x < self._shape[0]) & (y >= 0) & (y < self._shape[1])
        cell = (y[inside] * self._shape[0] + x[inside]).astype(np.int64)
        first, count = self._first[cell], self._first[cell + 1] - self._first[cell]
        return np.repeat(line[inside], count), self._walls[_ranges(first, count)]

    def _file(self, walls: Floats) -> tuple[Ints, Ints]:
        """Return pairs (wall, cell) for walls (m, 2, 2) in cells: the cells whose square, with slack, a wall meets."""
        low = np.maximum(np.floor(walls.min(axis=1) - _SLACK), 0).astype(np.int64)
        high = np.minimum(np.floor(walls.max(axis=1) + _SLACK).astype(np.int64), self._shape - 1)
        columns, rows = (high - low + 1).T
        wall = np.repeat(np.arange(len(walls)), columns * rows)
        row, column = np.divmod(_ranges(np.zeros(len(walls), np.int64), columns * rows), columns[wall])
        x, y = low[wall, 0] + column, low[wall, 1] + row
        along = walls[wall, 1] - walls[wall, 0]
        offset = along[:, 0] * (y + 0.5 - walls[wall, 0, 1]) - along[:, 1] * (x + 0.5 - walls[wall, 0, 0])
        met = np.abs(offset) <= (0.5 + _SLACK) * np.abs(along).sum(axis=1)  # the wall's line meets the square
        return wall[met], (y * self._shape[0] + x)[met]


def _crossings(a: Floats, b: Floats) -> tuple[Ints, Floats, Floats]:
    """Return every cell boundary that lines from a to b (k,), in cells, cross: line, cell entered, part of the way."""
    first, last = np.floor(a), np.floor(b)
    count = np.abs(last - first).astype(np.int64)
    line = np.repeat(np.arange(len(a)), count)
    sign = np.sign(last - first)[line]
    step = _ranges(np.zeros(len(a), np.int64), count)
    entered = first[line] + sign * (step + 1)
    boundary = np.where(sign > 0.0, entered, entered + 1.0)
    return line, entered, (boundary - a[line]) / (b[line] - a[line])


def _ranges(first: Ints, count: Ints) -> Ints:
    """Return first[0], first[0] + 1, ... (count[0] of them), first[1], ..., in one array."""
    ends = np.cumsum(count)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total) + np.repeat(first - ends + count, count)
