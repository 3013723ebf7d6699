"""The picture layer of robot teams: swept slices and traced arcs, coloured by team, and the critical points.

Robots report every fact as telemetry when they find it. The cells of the decomposition lie between the slices; their
adjacency shows where arcs end at critical points. Importing this module needs matplotlib.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from zwerm.agents.robot_teams.protocols.team_messages import decode_snapshot
from zwerm.record.history import Tracks
from zwerm.view.canvas import Sheet
from zwerm.view.layer import Layer
from zwerm.view.run_view import RunView

TEAMS: Final = ("#1B7F5C", "#A3195B", "#2B6CB0", "#B7791F", "#6B46C1", "#C05621", "#2C7A7B", "#702459")
CRITICAL: Final = "#111111"
NOWHERE: Final = np.zeros((0, 2))


class CellsLayer(Layer):
    """The slices that were swept until a time, by the team that swept them, and the critical points."""

    colours: ClassVar[Sequence[str]] = (*TEAMS, CRITICAL)
    legend_entries: ClassVar[int] = 9
    animation_s: ClassVar[float | None] = 20.0

    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        found = [(each.time_s, decode_snapshot(each.snapshot)) for each in view.snapshots]
        known = [(time_s, snapshot) for time_s, snapshot in found if snapshot is not None]
        self._slices = [(time_s, line, each.team) for time_s, each in known for line in each.slices]
        self._points = [(time_s, point) for time_s, each in known for point in each.critical_points]
        self._lines = LineCollection([], linewidths=2.2, capstyle="round", alpha=0.75, zorder=1.4)
        sheet.axes.add_collection(self._lines, autolim=False)
        self._dots: Any = sheet.axes.scatter([], [], s=28.0, marker="D", color=CRITICAL, zorder=3.4)

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Tell whether any robot reported a slice."""
        return any(decode_snapshot(each.snapshot) is not None for each in view.snapshots)

    @property
    def artists(self) -> Sequence[Artist]:
        """The collections that `show` changes."""
        return [self._lines, self._dots]

    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show what was reported by `at_s`."""
        shown = [(line, team) for time_s, line, team in self._slices if at_s is None or time_s <= at_s + 1e-9]
        self._lines.set_segments([np.array([[x, low], [x, high]]) for (x, low, high), _ in shown])
        self._lines.set_color([TEAMS[team % len(TEAMS)] for _, team in shown])
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
        return [*lines, dot]
