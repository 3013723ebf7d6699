"""The picture layers of landmark-based exploration: the landmark complex over the arena with open frontiers and
assignments, and the ways of robots that navigate.

As Figs. 10 to 13 of Ramaithitima and Bhattacharya 2018: the complex is drawn at the true places of its landmarks, to
which no robot has access. Each simplex, and each goal, is the convex hull of its landmarks. Importing this module needs
matplotlib.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
import shapely
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from zwerm.agents.landmark_exploration.mapping.map_reports import GoalReport, MapReport, read_report
from zwerm.record.history import Tracks
from zwerm.view.canvas import Sheet
from zwerm.view.layer import Layer
from zwerm.view.run_view import RunView
from zwerm.world.scene import Floats

SIMPLEX: Final = "#F2DFA7"
EDGE: Final = "#C9B271"
LANDMARK: Final = "#2E8B57"
FRONTIER: Final = "#00A35C"
ASSIGNED: Final = "#A3195B"
GOAL: Final = "#BFE3CF"
# The hull of a goal is drawn this much larger [m]: that of one or two landmarks has no area.
WIDEN_M: Final = 0.05


class LandmarkComplexLayer(Layer):
    """The reported complex: that of the coordinator, or the union of all robots' observations."""

    colours: ClassVar[Sequence[str]] = (SIMPLEX, EDGE, LANDMARK, FRONTIER, ASSIGNED)
    legend_entries: ClassVar[int] = 6
    animation_s: ClassVar[float | None] = 20.0
    headline: ClassVar[Sequence[str]] = (
        *("completion_fraction", "iterations", "open_frontiers", "landmark_complex_holes", "obstacles", "landmarks"),
    )
    plain_swarm: ClassVar[bool] = True

    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        self._axes = sheet.axes
        self._landmarks = np.array(view.landmarks, dtype=np.float64).reshape(-1, 2)
        self._view = view
        reports = [(each.time_s, each.node, read_report(each.snapshot)) for each in view.snapshots]
        self._records = [(time_s, node, each) for time_s, node, each in reports if isinstance(each, MapReport)]
        self._hulls: list[tuple[float, Floats]] = []
        self._lines: list[tuple[float, Floats]] = []
        for time_s, _, report in self._records:
            for simplex in report.simplices:
                self._note(time_s, self._landmarks[list(simplex)])
        self._simplices = PolyCollection([], facecolors=SIMPLEX, edgecolors="none", linewidths=0, zorder=1.2)
        self._edges = LineCollection([], colors=EDGE, linewidths=0.4, zorder=1.3)
        self._frontier = LineCollection([], colors=FRONTIER, linewidths=0.9, linestyles="dashed", zorder=2.4)
        self._assigned = LineCollection([], colors=ASSIGNED, linewidths=1.0, zorder=2.6)
        for each in self.artists:
            self._axes.add_collection(each, autolim=False)
        self._axes.plot(*self._landmarks.T, linestyle="none", marker="*", markersize=3.0, color=LANDMARK, zorder=2.0)

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Return whether the run has landmarks."""
        return len(view.landmarks) > 0

    @property
    def artists(self) -> list[Any]:
        """The collections that `show` changes."""
        return [self._simplices, self._edges, self._frontier, self._assigned]

    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show the state at `at_s`, or at the end."""
        until = float("inf") if at_s is None else at_s + 1e-9
        self._simplices.set_verts([hull for time_s, hull in self._hulls if time_s <= until])
        self._edges.set_segments([line for time_s, line in self._lines if time_s <= until])
        newest = {node: report for time_s, node, report in self._records if time_s <= until}
        position = tracks.position[index]
        frontiers: list[Floats] = []
        assigned: list[Floats] = []
        for _, report in sorted(newest.items()):
            frontiers += [self._landmarks[list(pair)] for pair in report.frontiers]
            assigned += [
                np.array([position[robot], self._landmarks[[a, b]].mean(axis=0)]) for robot, a, b in report.assigned
            ]
        self._frontier.set_segments(frontiers)
        self._assigned.set_segments(assigned)

    def legend(self) -> Sequence[Line2D | Patch]:
        """Return the entries of the legend: those of what the run reported."""
        star: dict[str, Any] = {"marker": "*", "markersize": 5, "linestyle": "none"}
        entries: list[Line2D | Patch] = [Line2D([], [], color=LANDMARK, **star, label="landmark")]
        reports = [report for _, _, report in self._records]
        if self._lines:
            entries.append(Patch(facecolor=SIMPLEX, edgecolor=EDGE, label="simplex: landmarks seen together"))
        if any(report.frontiers for report in reports):
            entries.append(Line2D([], [], color=FRONTIER, linestyle="dashed", linewidth=1.2, label="open frontier"))
        if any(report.assigned for report in reports):
            entries.append(Line2D([], [], color=ASSIGNED, linewidth=1.2, label="robot and its frontier"))
        return entries

    def _note(self, time_s: float, corners: Floats) -> None:
        hull = shapely.convex_hull(shapely.multipoints(corners))
        if hull.geom_type == "Polygon":
            ring = np.asarray(hull.exterior.coords)
            self._hulls.append((time_s, ring))
            self._lines.append((time_s, ring))
        elif hull.geom_type == "LineString":
            self._lines.append((time_s, np.asarray(hull.coords)))


class Leg(NamedTuple):
    """The way of a robot to one goal: begin and end [s], and (c, 2) the corners of the goal [m]."""

    begin_s: float
    end_s: float
    corners: Floats


class LandmarkNavigationLayer(Layer):
    """The goal that each robot goes to at the time, and its way since the goal before; at the end its last goal."""

    colours: ClassVar[Sequence[str]] = (GOAL, LANDMARK, ASSIGNED)
    more_entries: ClassVar[int] = 2
    headline: ClassVar[Sequence[str]] = tuple(
        f"navigation_{each}" for each in ("goals", "success_fraction", "iterations_mean")
    )

    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        places = np.array(view.landmarks, dtype=np.float64).reshape(-1, 2)
        self._legs: dict[int, list[Leg]] = {}
        for record in view.snapshots:
            report = read_report(record.snapshot)
            if isinstance(report, GoalReport):
                legs = self._legs.setdefault(record.node, [])
                # The map of another arena may have landmarks that this one does not have.
                there = [landmark for landmark in report.goal if landmark < len(places)]
                hull = shapely.convex_hull(shapely.multipoints(places[there])).buffer(WIDEN_M)
                begin_s = legs[-1].end_s if legs else 0.0
                legs.append(Leg(begin_s, record.time_s, np.asarray(hull.exterior.coords)))
        self._goals = PolyCollection([], facecolors=GOAL, edgecolors=LANDMARK, linewidths=0.8, zorder=1.6)
        self._ways = LineCollection([], colors=ASSIGNED, linewidths=1.0, zorder=2.6)
        for each in self.artists:
            sheet.axes.add_collection(each, autolim=False)

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Return whether a robot of the run reported the end of a way to a goal."""
        return any(isinstance(read_report(each.snapshot), GoalReport) for each in view.snapshots)

    @property
    def artists(self) -> list[Any]:
        """The collections that `show` changes."""
        return [self._goals, self._ways]

    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show the state at `at_s`, or at the end."""
        until_s = float("inf") if at_s is None else at_s
        goals, ways = [], []
        for node, legs in self._legs.items():
            leg = next((each for each in legs if each.end_s >= until_s), legs[-1])
            first, last = np.searchsorted(tracks.time_s, (leg.begin_s, min(leg.end_s, until_s) + 1e-9))
            goals.append(leg.corners)
            ways.append(tracks.position[first:last, node])
        self._goals.set_verts(goals)
        self._ways.set_segments(ways)

    def legend(self) -> Sequence[Line2D | Patch]:
        """Return the entries of the legend."""
        return [
            Patch(facecolor=GOAL, edgecolor=LANDMARK, label="goal: landmarks to be seen"),
            Line2D([], [], color=ASSIGNED, linewidth=1.2, label="way from the goal before"),
        ]
