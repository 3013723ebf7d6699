"""The robots on a sheet: bodies, paths, the area they cover, and the cells they occupy."""

import math
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch

from zwerm.record.history import Tracks
from zwerm.view.canvas import BLUE, NOTHING, ORANGE, OUTSIDE, SKY, VERMILLION, WALL, YELLOW, Sheet, outline
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.position_coverage import cell_counts
from zwerm.world.metrics.sight import SeenArea
from zwerm.world.scene import Floats, Ints

# A robot's radius is drawn at least this large, as a fraction of the arena's longer side.
RADIUS_MIN_FRACTION: Final = 0.0045
# Number of steps in which paths fade, and the part of the arena that all paths together may blacken.
FADES: Final = 24
INK_FRACTION: Final = 0.25
PATH_POINTS: Final = 0.8
PATH_SAMPLES_MAX: Final = 300_000
# The covered area is a tint, and a cell with a robot is a frame inside its edges: two tints would make a third colour.
COVERED: Final[dict[str, Any]] = {"facecolor": SKY, "edgecolor": "none", "alpha": 0.25}
FRAME: Final[dict[str, Any]] = {"facecolor": "none", "edgecolor": ORANGE, "alpha": 0.7}
TINT: Final[dict[str, Any]] = {"facecolor": YELLOW, "edgecolor": "none", "alpha": 0.35}
FRAME_INSET: Final = 0.035
FRAME_POINTS: Final = (0.4, 1.5)  # least and greatest line width


def gone_at_the_end(tracks: Tracks) -> Ints:
    """Return the ids of the robots that are absent from the last sample and present in an earlier one."""
    return np.flatnonzero(tracks.present.any(axis=0) & ~tracks.present[-1])


class Swarm:
    """Artists for the robots of one run.

    The covered area is the area in sight where `sight` is given, else the discs of `coverage_radius_m`. The first `bases`
    robots are marked as base stations. A `plain` swarm has neither paths nor noses, so that a layer below stays visible.
    """

    def __init__(
        self,
        sheet: Sheet,
        arena: Arena,
        tracks: Tracks,
        radius_m: float,
        coverage_radius_m: float | None = None,
        cells: tuple[int, int] | None = None,
        sight: SeenArea | None = None,
        bases: int = 0,
        plain: bool = False,
    ) -> None:
        self._axes, self._arena, self._tracks = sheet.axes, arena, tracks
        self._coverage_radius_m, self._cells, self._sight = coverage_radius_m, cells, sight
        self._bases, self._plain = bases, plain
        self._way = np.where(tracks.present[:, :, None], tracks.position, np.nan)
        xmin, ymin, xmax, ymax = arena.bounds
        least = RADIUS_MIN_FRACTION * max(xmax - xmin, ymax - ymin)
        self._radius, self._enlarged = max(radius_m, least), radius_m < least
        self._framed = coverage_radius_m is not None or sight is not None
        self._cell_style = FRAME | {"linewidth": self._frame_width(sheet)} if self._framed else TINT
        path_width_m = PATH_POINTS / 72.0 / sheet.inches_per_m
        self._ink_per_m = path_width_m / arena.area_m2
        self._paths = [LineCollection([], colors=WALL, linewidths=PATH_POINTS, zorder=2) for _ in range(FADES)]
        self._bodies = self._discs(np.zeros((0, 2)), self._radius, facecolors=BLUE, edgecolors="white", zorder=4)
        nose_width = min(1.2, 0.35 * 72.0 * sheet.inches_per_m * self._radius)
        self._noses = LineCollection([], colors=WALL, linewidths=nose_width, capstyle="round", zorder=4.5)
        self._dead = LineCollection([], colors=WALL, linewidths=1.4, zorder=4.6)
        self._base = self._discs(np.zeros((0, 2)), 2.0 * self._radius, facecolors=YELLOW, edgecolors=WALL, zorder=3.9)
        for collection in (*self._paths, self._noses, self._dead):
            self._axes.add_collection(collection, autolim=False)
        self._covered = PathPatch(NOTHING, **COVERED, zorder=1)
        self._occupied = PathPatch(NOTHING, **self._cell_style, zorder=1.6)
        for patch in (self._covered, self._occupied):
            self._axes.add_patch(patch)
        self._occupied.set_clip_path(sheet.free)
        if cells is not None:
            self._draw_grid(sheet, cells)

    @property
    def artists(self) -> list[Artist]:
        """The artists that `show` changes."""
        drawn = [*self._paths, self._bodies, self._noses, self._dead, self._base, self._covered, self._occupied]
        return list[Artist](drawn)

    def show(self, index: int, since: int) -> None:
        """Show the robots at sample `index`, and their paths from sample `since` to there."""
        present = self._tracks.present[index]
        position, heading = self._tracks.position[index][present], self._tracks.heading[index][present]
        dead = self._tracks.dead[index][present]
        self._bodies.set_offsets(position[~dead])
        if not self._plain:
            nose = 1.7 * self._radius * np.stack([np.cos(heading), np.sin(heading)], axis=1)
            self._noses.set_segments(list(np.stack([position, position + nose], axis=1)))
            self._show_paths(index, since)
        cross = 1.6 * self._radius * np.array([[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]])
        self._dead.set_segments(list((position[dead][:, None, None, :] + cross).reshape(-1, 2, 2)))
        self._base.set_offsets(self._tracks.position[index][: self._bases])
        if self._sight is not None:
            self._covered.set_path(outline(self._sight.area(position[~dead])))
        elif self._coverage_radius_m is not None:
            discs = shapely.buffer(shapely.points(position), self._coverage_radius_m, quad_segs=16)
            self._covered.set_path(outline(shapely.intersection(shapely.union_all(discs), self._arena.free)))
        if self._cells is not None:
            row, column = np.nonzero(cell_counts(position, self._arena.bounds, self._cells))
            x, y = self._grid_lines(self._cells)
            inset = FRAME_INSET * min(x[1] - x[0], y[1] - y[0]) if self._framed else 0.0
            boxes = shapely.box(x[column] + inset, y[row] + inset, x[column + 1] - inset, y[row + 1] - inset)
            self._occupied.set_path(outline(shapely.union_all(boxes)))

    def show_ends(self) -> None:
        """Mark the start of every robot, and the last place of each robot that has left."""
        position, present = self._tracks.position, self._tracks.present
        robots = np.flatnonzero(present.any(axis=0)) if not self._plain else np.zeros(0, dtype=np.int64)
        first = present.argmax(axis=0)
        self._discs(
            position[first[robots], robots], 0.7 * self._radius, facecolors="none", edgecolors=VERMILLION, zorder=3
        )
        gone = gone_at_the_end(self._tracks)
        last = len(present) - 1 - present[::-1].argmax(axis=0)
        x, y = position[last[gone], gone].T
        self._axes.plot(x, y, linestyle="none", marker="x", color=VERMILLION, markersize=5, zorder=3.5)

    def legend(self, moving: bool = False) -> list[Line2D | Patch]:
        """Return the entries of the legend: for the last sample, or for an animation (`moving`)."""
        count, time_s = int((self._tracks.present & ~self._tracks.dead)[-1].sum()), self._tracks.time_s[-1]
        robots = "robots" if moving else f"{count} {'robot' if count == 1 else 'robots'} at {time_s:g} s"
        larger = ", drawn larger" if self._enlarged else ""
        entries: list[Line2D | Patch] = [
            Line2D([], [], linestyle="none", marker="o", color=BLUE, label=f"{robots}{larger}")
        ]
        if self._bases:
            label = "base station, at the entrance" if self._bases == 1 else "base stations, at the entrances"
            style: dict[str, Any] = {"mfc": YELLOW, "mec": WALL, "markersize": 9}
            entries.append(Line2D([], [], linestyle="none", marker="o", label=label, **style))
        if not self._plain:
            entries += [
                Line2D([], [], linestyle="none", marker="o", mec=VERMILLION, mfc="none", markersize=5, label="starts"),
                Line2D([], [], color=WALL, alpha=0.5, linewidth=1.2, label="paths, fading with age"),
            ][moving:]
        if self._tracks.dead.any():
            entries.append(Line2D([], [], linestyle="none", marker="x", color=WALL, label="dead robots"))
        if (gone := len(gone_at_the_end(self._tracks))) and not moving:
            label = f"{gone} {'robot has' if gone == 1 else 'robots have'} left"
            entries.append(Line2D([], [], linestyle="none", marker="x", color=VERMILLION, label=label))
        if self._sight is not None:
            label = f"in sight of a robot, {self._sight.range_m:.3g} m at most"
            entries.append(Patch(**COVERED, label=label))
        elif self._coverage_radius_m is not None:
            label = f"within {self._coverage_radius_m:.3g} m of a robot"
            entries.append(Patch(**COVERED, label=label))
        if self._cells is not None:
            columns, rows = self._cells
            entries.append(Patch(**self._cell_style, label=f"cells with a robot ({columns} x {rows})"))
        return entries

    def _show_paths(self, index: int, since: int) -> None:
        stride = max(1, math.ceil((index - since) * self._way.shape[1] / PATH_SAMPLES_MAX))
        way = self._way[np.append(np.arange(since, index, stride), index)]
        length_m = float(np.nansum(np.hypot(*np.diff(way, axis=0).transpose(2, 0, 1))))
        ink = min(1.0, INK_FRACTION / max(length_m * self._ink_per_m, 1e-9))
        edges = np.linspace(0, len(way) - 1, FADES + 1).astype(np.int64)
        for age, (path, start, end) in enumerate(zip(self._paths, edges[:-1], edges[1:], strict=True), start=1):
            path.set_segments(list(way[start : end + 1].transpose(1, 0, 2)) if end > start else [])
            path.set_alpha(ink * (0.04 + 0.6 * (age / FADES) ** 4))

    def _discs(self, position: Floats, radius_m: float, **style: Any) -> EllipseCollection:
        size = [2.0 * radius_m]
        to_data = self._axes.transData
        discs = EllipseCollection(size, size, [0.0], units="xy", offsets=position, offset_transform=to_data, **style)
        self._axes.add_collection(discs, autolim=False)
        return discs

    def _grid_lines(self, grid: tuple[int, int]) -> tuple[Floats, Floats]:
        xmin, ymin, xmax, ymax = self._arena.bounds
        return np.linspace(xmin, xmax, grid[0] + 1), np.linspace(ymin, ymax, grid[1] + 1)

    def _frame_width(self, sheet: Sheet) -> float:
        if self._cells is None:
            return 0.0
        x, y = self._grid_lines(self._cells)
        points = 1.7 * sheet.inches_per_m * min(x[1] - x[0], y[1] - y[0])
        return float(np.clip(points, *FRAME_POINTS))

    def _draw_grid(self, sheet: Sheet, grid: tuple[int, int]) -> None:
        xmin, ymin, xmax, ymax = self._arena.bounds
        x, y = self._grid_lines(grid)
        lines = [[(each, ymin), (each, ymax)] for each in x[1:-1]] + [[(xmin, each), (xmax, each)] for each in y[1:-1]]
        drawn = LineCollection(lines, colors=OUTSIDE, linewidths=0.8, zorder=1.5)
        self._axes.add_collection(drawn, autolim=False)
        drawn.set_clip_path(sheet.free)
