"""The sheet a run is drawn on, and the swarm drawn on it: layout and artists, for pictures and animations alike.

A sheet is laid out in inches, so that nothing overlaps at any shape of arena: title, metrics, the arena in metres with
its walls and a scale bar, room for curves below, the legend at the foot. Colours are Okabe and Ito's (2008), which do
not depend on seeing red and green apart. Matplotlib's global state is neither used nor touched.
"""

import math
import textwrap
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.text import Text
from numpy.typing import NDArray

from zwerm.record.history import Tracks
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.measures import cell_counts
from zwerm.world.metrics.sight import SeenArea
from zwerm.world.scene import Floats, Ints

BLUE: Final = "#0072B2"
SKY: Final = "#56B4E9"
ORANGE: Final = "#E69F00"
VERMILLION: Final = "#D55E00"
YELLOW: Final = "#F0E442"
WALL: Final = "#222222"
OUTSIDE: Final = "#E4E4E4"
QUIET: Final = "#555555"

# Inches.
MARGIN: Final = 0.25
LEFT: Final = 0.7
WIDTH_MIN: Final = 5.0
TITLE_HEIGHT: Final = 0.26
LINE_HEIGHT: Final = 0.2
HEAD_GAP: Final = 0.06
AXIS_HEIGHT: Final = 0.52
PLOT_HEIGHT: Final = 1.4
# The scale bar is at most that much of the arena's width, and that far below the arena [inches].
SCALE_FRACTION: Final = 0.2
SCALE_DROP: Final = 0.3
LEGEND_ROW: Final = 0.23
LEGEND_COLUMN: Final = 2.5
CHARACTER: Final = 0.078
TITLE_CHARACTER: Final = 0.115

# A robot's radius is drawn at least this large, as a fraction of the arena's longer side.
RADIUS_MIN_FRACTION: Final = 0.0045
FINE_WALLS: Final = 500
# Paths fade in this many steps, and are drawn lighter where together they would blacken more of the arena than this.
FADES: Final = 24
INK_FRACTION: Final = 0.25
PATH_POINTS: Final = 0.8
PATH_SAMPLES_MAX: Final = 300_000
# What is covered is a tint, a cell with a robot a frame just inside its edges: two tints would make a third colour.
COVERED: Final[dict[str, Any]] = {"facecolor": SKY, "edgecolor": "none", "alpha": 0.25}
FRAME: Final[dict[str, Any]] = {"facecolor": "none", "edgecolor": ORANGE, "alpha": 0.7}
TINT: Final[dict[str, Any]] = {"facecolor": YELLOW, "edgecolor": "none", "alpha": 0.35}
FRAME_INSET: Final = 0.035
FRAME_POINTS: Final = (0.4, 1.5)  # as thin as cells are small
NOTHING: Final = Outline(np.zeros((0, 2)))


def outline(area: shapely.Geometry) -> Outline:
    """Return the path around the polygons of `area`, holes included; lines and points in it are left out."""
    rings: list[Outline] = []
    # Normalised, exteriors and holes run opposite ways, which is how a fill tells them apart.
    for part in shapely.get_parts(shapely.normalize(area)):
        if part.geom_type == "Polygon":
            rings += [Outline(np.asarray(ring.coords)[:, :2], closed=True) for ring in (part.exterior, *part.interiors)]
    return Outline.make_compound_path(*rings) if rings else NOTHING


class Sheet:
    """A figure with the arena on it, at most `arena_inches` (width, height) large; `note` is the last line of `text`.

    `plot` are axes for curves, where there is `with_plot`.
    """

    def __init__(
        self,
        arena: Arena,
        title: str,
        text: str = "",
        legend_entries: int = 0,
        with_plot: bool = False,
        arena_inches: tuple[float, float] = (8.0, 7.0),
        dpi: int = 150,
    ) -> None:
        xmin, ymin, xmax, ymax = arena.bounds
        # A little air around the arena, so that its walls are seen whole.
        air = 0.015 * max(xmax - xmin, ymax - ymin)
        extent = (xmax - xmin + 2 * air, ymax - ymin + 2 * air)
        scale = min(arena_inches[0] / extent[0], arena_inches[1] / extent[1])
        width, height = extent[0] * scale, extent[1] * scale
        inner = max(width, WIDTH_MIN)
        heading = textwrap.wrap(title, int(inner / TITLE_CHARACTER))
        lines = textwrap.wrap(text, int(inner / CHARACTER)) or [""]
        columns = min(max(1, int(inner / LEGEND_COLUMN)), max(1, legend_entries))
        foot = MARGIN + LEGEND_ROW * math.ceil(legend_entries / columns)
        below = foot + AXIS_HEIGHT + (PLOT_HEIGHT + AXIS_HEIGHT if with_plot else 0.0)
        head = TITLE_HEIGHT * len(heading) + LINE_HEIGHT * len(lines) + HEAD_GAP
        right = LEFT if with_plot else MARGIN
        total = (LEFT + inner + right, below + height + head + MARGIN)

        self.figure = Figure(figsize=total, dpi=dpi, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        self.inches_per_m = scale
        self._total, self._columns = total, columns
        self.axes = self._place(LEFT + (inner - width) / 2, below, width, height)
        self.axes.set_xlim(xmin - air, xmax + air)
        self.axes.set_ylim(ymin - air, ymax + air)
        self.axes.set_xlabel("x [m]", color=QUIET)
        self.axes.set_ylabel("y [m]", color=QUIET)
        self._draw_arena(arena)
        top = total[1] - MARGIN
        for line in heading:
            self._write(top, line, fontsize=12, fontweight="bold", color=WALL)
            top -= TITLE_HEIGHT
        for line in lines:
            self.note = self._write(top, line, fontsize=9.5, color=QUIET)
            top -= LINE_HEIGHT
        self._draw_scale(LEFT + (inner + width) / 2, below - SCALE_DROP, extent[0])
        self.plot = self._place(LEFT, foot + AXIS_HEIGHT, inner, PLOT_HEIGHT) if with_plot else None

    def freeze(self, moving: Sequence[Artist]) -> None:
        """Draw everything but `moving` (and walls and note, which lie above it) once, for `frame`."""
        self._moving = [*sorted(moving, key=Artist.get_zorder), self.walls, self.note]
        for artist in self._moving:
            artist.set_animated(True)
        self.canvas.draw()
        self._still = self.canvas.copy_from_bbox(self.figure.bbox)

    def frame(self) -> NDArray[np.uint8]:
        """Return the sheet as it is now as (height, width, 4) RGBA; what was frozen is not drawn again."""
        self.canvas.restore_region(self._still)
        for artist in self._moving:
            self.figure.draw_artist(artist)
        return np.asarray(self.canvas.buffer_rgba())

    def draw_legend(self, handles: Sequence[Line2D | Patch]) -> None:
        """Put the legend at the foot of the sheet."""
        self.figure.legend(
            handles=list(handles),
            loc="lower left",
            bbox_to_anchor=((LEFT - 0.1) / self._total[0], 0.6 * MARGIN / self._total[1]),
            ncols=self._columns,
            frameon=False,
            fontsize=9.5,
            borderpad=0.0,
            borderaxespad=0.0,
            labelspacing=0.5,
            columnspacing=2.0,
            handlelength=1.8,
            labelcolor=WALL,
        )

    def _place(self, left: float, bottom: float, width: float, height: float) -> Axes:
        across, up = self._total
        axes = self.figure.add_axes((left / across, bottom / up, width / across, height / up))
        axes.tick_params(colors=QUIET, labelsize=8.5, length=3)
        for spine in axes.spines.values():
            spine.set_visible(False)
        return axes

    def _write(self, top: float, text: str, **style: Any) -> Text:
        across, up = self._total
        return self.figure.text(LEFT / across, top / up, text, va="top", **style)

    def _draw_arena(self, arena: Arena) -> None:
        self.axes.set_facecolor(OUTSIDE)
        self.free = PathPatch(outline(arena.free), facecolor="white", edgecolor="none", zorder=0)
        self.axes.add_patch(self.free)
        self.walls = LineCollection(
            list(arena.segments.reshape(-1, 2, 2)),
            colors=WALL,
            linewidths=1.0 if len(arena.segments) > FINE_WALLS else 1.8,
            capstyle="round",
            zorder=5,
        )
        self.axes.add_collection(self.walls, autolim=False)

    def _draw_scale(self, right: float, up: float, width_m: float) -> None:
        """Draw a bar that is a round number of metres long, its right end there [inches]."""
        length_m = round_down(SCALE_FRACTION * width_m)
        left = right - length_m * self.inches_per_m
        x = [each / self._total[0] for each in (left, left, left, right, right, right)]
        y = [(up + each) / self._total[1] for each in (-0.03, 0.03, 0.0, 0.0, 0.03, -0.03)]
        self.figure.add_artist(Line2D(x, y, color=WALL, linewidth=1.2, transform=self.figure.transFigure))
        beside = (left - 0.06) / self._total[0]
        self.figure.text(beside, up / self._total[1], f"{length_m:g} m", va="center", ha="right", fontsize=8.5)


def round_down(length_m: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(length_m) + 1e-9)
    return float(power * max(each for each in (1, 2, 5) if each * power <= length_m * (1 + 1e-9)))


def readable(name: str) -> str:
    """Return a metric's name as words, without its unit: `cell_coverage_fraction` is `cell coverage`."""
    for unit in ("_fraction", "_m_s", "_m2", "_m", "_s"):
        if name.endswith(unit):
            return name.removesuffix(unit).replace("_", " ")
    return name.replace("_", " ")


def gone_at_the_end(tracks: Tracks) -> Ints:
    """Return the ids of the robots that were there once and are not in the last sample."""
    return np.flatnonzero(tracks.present.any(axis=0) & ~tracks.present[-1])


class Swarm:
    """The robots on a sheet: bodies, the paths they took, what they cover and the cells they occupy.

    What they cover is what they have in sight where `sight` is given, else what is near. The first `bases` robots are
    marked as base stations. A `plain` swarm has neither paths nor noses, for something else to be drawn below.
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
        """What `show` changes."""
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
        """Mark where robots started, and where those that have left were seen last."""
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
        """Return the legend's entries for all that is shown: at the last sample, or in an animation (`moving`)."""
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
