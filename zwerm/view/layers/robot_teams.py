"""The picture layer of robot teams: swept slices, coloured by team, critical points, and the adjacency graph of cells.

Robots report every fact in a snapshot when they find it. Cells follow from the slices that were swept. If each of two
segments on neighbouring slices overlaps only the other one, both are in one cell. Otherwise an edge joins their cells.
Importing this module needs matplotlib.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from zwerm.agents.robot_teams.protocols.team_messages import decode_snapshot
from zwerm.record.history import Tracks
from zwerm.view.canvas import Sheet
from zwerm.view.layer import Layer
from zwerm.view.run_view import RunView

Floats = NDArray[np.float64]

TEAMS: Final = ("#1B7F5C", "#A3195B", "#2B6CB0", "#B7791F", "#6B46C1", "#C05621", "#2C7A7B", "#702459")
CRITICAL: Final = "#111111"
GRAPH: Final = "#4A5568"
SLICE_OPACITY: Final = 0.75
# Segments that are nearer to each other than this in x lie on one slice [m].
SAME_M: Final = 0.05
NOWHERE: Final = np.zeros((0, 2))


# A swept segment: x, bottom and top [m].
Slice = tuple[float, float, float]


class Cells(NamedTuple):
    """The cells of a decomposition: the middle (n, 2) [m] of each, and pairs of adjacent ones, ascending.

    `gates` (m, 2) [m] are places, one for each pair, at which the free space of the one cell goes on into the other.
    """

    middles: Floats
    edges: list[tuple[int, int]]
    gates: Floats


def cells_of(slices: Sequence[Slice]) -> Cells:
    """Return the cells that swept segments belong to. Segments that overlap on one slice are one segment."""
    columns: list[list[Slice]] = []
    for x, low, high in sorted(slices):
        if not columns or x - columns[-1][0][0] > SAME_M:
            columns.append([])
        column = columns[-1]
        if column and low < column[-1][2]:
            column[-1] = column[-1][0], column[-1][1], max(high, column[-1][2])
        else:
            column.append((x, low, high))
    spacing_m = min([b[0][0] - a[0][0] for a, b in pairwise(columns)], default=0.0)
    cell = {segment: index for index, segment in enumerate(segment for column in columns for segment in column)}
    joined: list[tuple[Slice, Slice]] = []
    for left, right in pairwise(columns):
        if right[0][0] - left[0][0] > 1.5 * spacing_m:
            continue
        pairs = [(a, b) for a in left for b in right if min(a[2], b[2]) > max(a[1], b[1])]
        for a, b in pairs:
            if sum(a == each for each, _ in pairs) == sum(b == each for _, each in pairs) == 1:
                cell[b] = cell[a]
            else:
                joined.append((a, b))
    names = {name: index for index, name in enumerate(dict.fromkeys(cell.values()))}
    members: list[list[Slice]] = [[] for _ in names]
    for segment, name in cell.items():
        members[names[name]].append(segment)
    middles = [_middle(each) for each in members]
    gates = {(names[cell[a]], names[cell[b]]): _gate(a, b) for a, b in joined}
    edges = sorted(gates)
    return Cells(
        np.array(middles) if middles else NOWHERE,
        edges,
        np.array([gates[edge] for edge in edges]) if edges else NOWHERE,
    )


def _middle(segments: Sequence[Slice]) -> tuple[float, float]:
    """Return the middle of a cell's middle segment, which lies in the cell."""
    x, low, high = sorted(segments)[len(segments) // 2]
    return x, (low + high) / 2.0


def _gate(one: Slice, other: Slice) -> tuple[float, float]:
    """Return the middle of the passage between two segments on neighbouring slices."""
    low, high = max(one[1], other[1]), min(one[2], other[2])
    return (one[0] + other[0]) / 2.0, (low + high) / 2.0


def _on_white(colour: str) -> str:
    """Return the colour of a slice on the white floor, which the palette of an animation needs too."""
    red, green, blue = (1.0 - SLICE_OPACITY * (1.0 - each) for each in to_rgb(colour))
    return to_hex((red, green, blue))


class CellsLayer(Layer):
    """The slices that were swept until a time, by the team that swept them, critical points, and adjacent cells."""

    colours: ClassVar[Sequence[str]] = (*TEAMS, *map(_on_white, TEAMS), CRITICAL, GRAPH)
    legend_entries: ClassVar[int] = 10
    animation_s: ClassVar[float | None] = 20.0

    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        found = [(each.time_s, decode_snapshot(each.snapshot)) for each in view.snapshots]
        known = [(time_s, snapshot) for time_s, snapshot in found if snapshot is not None]
        self._slices = [(time_s, line, each.team) for time_s, each in known for line in each.slices]
        self._points = [(time_s, point) for time_s, each in known for point in each.critical_points]
        self._lines = LineCollection([], linewidths=2.2, capstyle="round", alpha=SLICE_OPACITY, zorder=1.4)
        sheet.axes.add_collection(self._lines, autolim=False)
        self._edges = LineCollection([], linewidths=1.4, linestyles="dashed", color=GRAPH, zorder=3.2)
        sheet.axes.add_collection(self._edges, autolim=False)
        self._nodes: Any = sheet.axes.scatter(
            [], [], s=70.0, color="white", edgecolors=GRAPH, linewidths=1.6, zorder=3.3
        )
        self._dots: Any = sheet.axes.scatter([], [], s=28.0, marker="D", color=CRITICAL, zorder=3.4)

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Return whether any robot reported a slice."""
        return any(decode_snapshot(each.snapshot) is not None for each in view.snapshots)

    @property
    def artists(self) -> Sequence[Artist]:
        """The collections that `show` changes."""
        return [self._lines, self._edges, self._nodes, self._dots]

    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show the reports up to `at_s`."""
        shown = [(line, team) for time_s, line, team in self._slices if at_s is None or time_s <= at_s + 1e-9]
        self._lines.set_segments([np.array([[x, low], [x, high]]) for (x, low, high), _ in shown])
        self._lines.set_color([TEAMS[team % len(TEAMS)] for _, team in shown])
        cells = cells_of([line for line, _ in shown])
        # An edge leads through the passage between its cells, so that it does not cross the obstacle beside it.
        self._edges.set_segments(
            [
                np.array([cells.middles[one], gate, cells.middles[other]])
                for (one, other), gate in zip(cells.edges, cells.gates, strict=True)
            ]
        )
        self._nodes.set_offsets(cells.middles)
        points = [point for time_s, point in self._points if at_s is None or time_s <= at_s + 1e-9]
        self._dots.set_offsets(np.array(points) if points else NOWHERE)

    def legend(self) -> Sequence[Line2D | Patch]:
        """Return one entry for each team that swept a slice, and one for critical points."""
        teams = sorted({team for _, _, team in self._slices})
        lines = [
            Line2D(
                [], [], color=TEAMS[team % len(TEAMS)], linewidth=2.2, label=f"slice swept by the team of robot {team}"
            )
            for team in teams
        ]
        dot = Line2D([], [], color=CRITICAL, marker="D", markersize=5, linestyle="none", label="critical point")
        cell = Line2D(
            *([], []),
            color=GRAPH,
            marker="o",
            markerfacecolor="white",
            markersize=7,
            linestyle="dashed",
            label="cell, and adjacent cells",
        )
        return [*lines, dot, cell]
