"""The sheet that a run is drawn on, for pictures and animations.

A sheet is laid out in inches, so that parts never overlap for any shape of arena. It has the title, metrics, the arena
in metres with walls and a scale bar, curves below, and the legend at the foot. Colours are those of Okabe and Ito
(2008), which readers with red-green colour blindness can tell apart. Matplotlib's global state is neither used nor
touched.
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
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.text import Text
from numpy.typing import NDArray

from zwerm.world.arena.arena import Arena

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
# The greatest length of the scale bar as a fraction of the arena's width, and its distance below the arena [inches].
SCALE_FRACTION: Final = 0.2
SCALE_DROP: Final = 0.3
LEGEND_ROW: Final = 0.23
LEGEND_COLUMN: Final = 2.5
CHARACTER: Final = 0.078
TITLE_CHARACTER: Final = 0.115

FINE_WALLS: Final = 500
NOTHING: Final = Outline(np.zeros((0, 2)))


def outline(area: shapely.Geometry) -> Outline:
    """Return the path around the polygons of `area`, holes included; lines and points in it are left out."""
    rings: list[Outline] = []
    # Normalised, exteriors and holes run opposite ways, which is how a fill distinguishes them.
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
        # A margin around the arena, so that its walls are drawn in full.
        air = 0.015 * max(xmax - xmin, ymax - ymin)
        extent = (xmax - xmin + 2 * air, ymax - ymin + 2 * air)
        scale = min(arena_inches[0] / extent[0], arena_inches[1] / extent[1])
        width, height = extent[0] * scale, extent[1] * scale
        inner = max(width, WIDTH_MIN) if title else width
        heading = textwrap.wrap(title, max(1, int(inner / TITLE_CHARACTER)))
        lines = textwrap.wrap(text, max(1, int(inner / CHARACTER))) or [""]
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
        """Draw all artists once, for `frame`, except `moving`, and the walls and the note above them."""
        self._moving = [*sorted(moving, key=Artist.get_zorder), self.walls, self.note]
        for artist in self._moving:
            artist.set_animated(True)
        self.canvas.draw()
        self._still = self.canvas.copy_from_bbox(self.figure.bbox)

    def frame(self) -> NDArray[np.uint8]:
        """Return the current sheet as (height, width, 4) RGBA; frozen artists are not drawn again."""
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
