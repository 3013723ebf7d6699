"""A swarm's simplicial complex on a sheet: triangles, frontier, obstacle edges, and the paths that robots push along.

Frontier is cyan and obstacle brown, as in Ramaithitima et al. 2015. Robots that move do so over the complex, which stays
as it was when it was last told of. Importing this module needs matplotlib, which comes with the `study` extra.
"""

from itertools import pairwise
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from zwerm.view.canvas import QUIET, Sheet
from zwerm.view.snapshots import Snapshot
from zwerm.world.scene import Floats

FRONTIER: Final = "#00B2C6"
OBSTACLE: Final = "#8C5A2B"
PUSH: Final = "#A3195B"
TRIANGLE: Final[dict[str, Any]] = {"facecolor": "#B3D8CC", "edgecolor": "none"}  # opaque: triangles overlap
EDGE: Final = "#7C8A84"
ARROW_POINTS: Final = 7.0
NO_LINES: Final = np.zeros((0, 2, 2))


class ComplexLayer:
    """The complex on a sheet; `names` writes the robots' ids beside them, off bodies of `radius_m`."""

    def __init__(self, sheet: Sheet, names: bool = False, radius_m: float = 0.0) -> None:
        self._axes = sheet.axes
        self._names = names
        self._beside = 0.7 * radius_m * sheet.inches_per_m * 72.0 + 1.0
        self._arrow_m = ARROW_POINTS / 72.0 / sheet.inches_per_m
        self._triangles = PolyCollection([], **TRIANGLE, linewidths=0, zorder=1.2)
        self._heads = PolyCollection([], facecolors=PUSH, edgecolors="none", zorder=3.7)
        lines = ((EDGE, 0.6, 1.4), (OBSTACLE, 2.4, 2.5), (FRONTIER, 2.8, 2.6), (PUSH, 1.8, 3.6))
        self._edges, self._obstacle, self._frontier, self._pushes = (
            LineCollection([], colors=colour, linewidths=width, capstyle="round", zorder=zorder)
            for colour, width, zorder in lines
        )
        for each in self.artists:
            self._axes.add_collection(each, autolim=False)

    @property
    def artists(self) -> list[Any]:
        """What `show` changes."""
        return [self._triangles, self._edges, self._obstacle, self._frontier, self._pushes, self._heads]

    def show(self, stage: Snapshot | None) -> list[Artist]:
        """Show the complex at a stage, or nothing before the first."""
        if stage is None:
            for each in self.artists:
                each.set_verts([])
            return []
        position = stage.position
        self._triangles.set_verts(list(position[stage.triangles]))
        self._edges.set_segments(list(position[stage.edges]))
        self._obstacle.set_segments(list(position[stage.obstacle]))
        self._frontier.set_segments(list(position[stage.frontier]))
        hops = np.array([hop for path in stage.paths for hop in pairwise(path)], dtype=np.int64).reshape(-1, 2)
        lines = position[hops] if len(hops) else NO_LINES
        self._pushes.set_segments(list(lines))
        self._heads.set_verts(list(_heads(lines, self._arrow_m)))
        return (
            [self._write(robot, position[robot]) for robot in np.flatnonzero(stage.present).tolist()]
            if self._names
            else []
        )

    def legend(self, told: bool = True) -> list[Line2D | Patch]:
        """Return the legend's entries for all that may be shown: of what was `told`, or of the truth."""
        entries: list[Line2D | Patch] = [
            Patch(**TRIANGLE, label="three robots that see each other"),
            Line2D([], [], color=EDGE, linewidth=0.8, label="two that see each other"),
        ]
        if not told:
            return entries
        return [
            *entries,
            Line2D([], [], color=FRONTIER, linewidth=2.8, label="frontier: there is a way on"),
            Line2D([], [], color=OBSTACLE, linewidth=2.4, label="obstacle: a wall is beyond"),
            Line2D(
                [], [], color=PUSH, linewidth=1.8, marker=">", markersize=5, label="push: each takes the next place"
            ),
        ]

    def _write(self, robot: int, place: Floats) -> Artist:
        return self._axes.annotate(
            str(robot),
            (place[0], place[1]),
            textcoords="offset points",
            xytext=(self._beside, self._beside),
            fontsize=6.5,
            color=QUIET,
            zorder=6,
        )


def _heads(lines: Floats, length_m: float) -> Floats:
    """Return (k, 3, 2) arrow heads in the middle of lines (k, 2, 2), each `length_m` long [m]."""
    along = lines[:, 1] - lines[:, 0]
    along = along / np.maximum(np.hypot(*along.T), 1e-9)[:, None] * length_m
    aside = 0.45 * np.stack([-along[:, 1], along[:, 0]], axis=1)
    middle = lines.mean(axis=1)
    return np.stack([middle + 0.5 * along, middle - 0.5 * along + aside, middle - 0.5 * along - aside], axis=1)
