"""The picture layer of sensor coverage: the simplicial complex, its frontier and obstacle edges, and the push paths.

Frontier is cyan and obstacle brown, as in Ramaithitima et al. 2015. Between two reports of the coordinator the robots
move over the complex, which stays as last reported. Importing this module needs matplotlib.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from zwerm.agents.sensor_coverage.messages.snapshots import ComplexSnapshot, decode_snapshot
from zwerm.maths.keyed_random import Draws
from zwerm.maths.simplicial import FlagComplex
from zwerm.record.history import Tracks
from zwerm.view.canvas import QUIET, Sheet
from zwerm.view.layer import Layer
from zwerm.view.run_view import RunView
from zwerm.world.arena.arena import Arena
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.scene import Bools, Floats, Ints, Scene
from zwerm.world.tick.telemetry import TelemetryRecord

FRONTIER: Final = "#00B2C6"
OBSTACLE: Final = "#8C5A2B"
PUSH: Final = "#A3195B"
TRIANGLE: Final[dict[str, Any]] = {"facecolor": "#B3D8CC", "edgecolor": "none"}  # opaque: triangles overlap
EDGE: Final = "#7C8A84"
ARROW_POINTS: Final = 7.0
NO_LINES: Final = np.zeros((0, 2, 2))


class Snapshot(NamedTuple):
    """The complex at one cycle, with the positions of the robots. The true complex has no cycle number."""

    cycle: int | None
    time_s: float
    position: Floats  # (n, 2) [m]
    present: Bools  # (n,)
    edges: Ints  # (k, 2) robots; likewise the next two
    frontier: Ints
    obstacle: Ints
    paths: tuple[tuple[int, ...], ...]  # each from its source to the robot that goes ahead

    @property
    def number(self) -> int | None:
        """The deployment cycle."""
        return self.cycle

    @property
    def triangles(self) -> Ints:
        """(k, 3) robots of the 2-simplices."""
        lists: dict[int, list[int]] = {robot: [] for robot in np.unique(self.edges).tolist()}
        for i, j in self.edges.tolist():
            lists[i].append(j)
            lists[j].append(i)
        return np.array(FlagComplex(lists).triangles, dtype=np.int64).reshape(-1, 3)


def snapshots(records: Sequence[TelemetryRecord], coordinator: int | None = None) -> list[Snapshot]:
    """Return the complexes that the node `coordinator` reported, in order; where that is None, those of any node."""
    decoded = ((each, decode_snapshot(each.snapshot)) for each in records if coordinator in (None, each.node))
    return [_snapshot(each, found) for each, found in decoded if isinstance(found, ComplexSnapshot)]


def true_snapshot(time_s: float, position: Floats, standing: Bools, arena: Arena, range_m: float) -> Snapshot:
    """Return the complex of the robots `standing` (n,) at position (n, 2) that see each other within a range [m].

    It has no frontier and no push paths: both are decisions of the algorithm, not facts.
    """
    still = np.zeros(len(standing), dtype=np.bool_)
    scene = Scene(0, time_s, position, still.astype(np.float64), standing, still, 0.0, arena, Draws(0))
    none = np.zeros((0, 2), dtype=np.int64)
    return Snapshot(None, time_s, position, standing, Visibility().pairs(scene, range_m), none, none, ())


def _snapshot(moment: TelemetryRecord, reported: ComplexSnapshot) -> Snapshot:
    edges, frontier, obstacle = (
        np.array(pairs, dtype=np.int64).reshape(-1, 2)
        for pairs in (reported.edges, reported.frontier, reported.obstacle)
    )
    paths = tuple(path for path in reported.paths if path)
    return Snapshot(reported.cycle, moment.time_s, moment.position, moment.present, edges, frontier, obstacle, paths)


class ComplexLayer(Layer):
    """The complex on a sheet: as last reported, or the true complex if none was reported."""

    colours: ClassVar[Sequence[str]] = (EDGE, FRONTIER, OBSTACLE, PUSH, TRIANGLE["facecolor"])
    legend_entries: ClassVar[int] = 9
    animation_s: ClassVar[float | None] = 20.0
    headline: ClassVar[Sequence[str]] = (
        *("coverage_fraction", "robots_deployed", "hexagonal_packing_robots", "robots_over_hexagonal"),
        *("holes", "obstacles", "deployment_cycles", "redundant_robots"),
    )
    stage_name: ClassVar[str] = "deployment cycle"
    plain_swarm: ClassVar[bool] = True

    def __init__(self, sheet: Sheet, view: RunView, names: bool = False) -> None:
        self._axes = sheet.axes
        self._names = names
        self._view = view
        self._snapshots = snapshots(view.snapshots, view.coordinator)
        self._beside = 0.7 * view.radius_m * sheet.inches_per_m * 72.0 + 1.0
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

    @classmethod
    def applies(cls, view: RunView) -> bool:
        """Return whether there is a complex: a reported one, or the true one of a swarm from base stations."""
        return bool(cls.stages(view)) or (view.bases > 0 and view.sight_range_m is not None)

    @classmethod
    def stages(cls, view: RunView) -> Sequence[Snapshot]:
        """Return the reported snapshots."""
        return snapshots(view.snapshots, view.coordinator)

    @property
    def artists(self) -> list[Any]:
        """The collections that `show` changes."""
        return [self._triangles, self._edges, self._obstacle, self._frontier, self._pushes, self._heads]

    def show(self, tracks: Tracks, index: int, at_s: float | None) -> None:
        """Show the last snapshot reported by `at_s`, or the true complex at the sample if no node ever reported one."""
        if self._snapshots:
            until = [each for each in self._snapshots if at_s is None or each.time_s <= at_s + 1e-9]
            self.show_snapshot(until[-1] if until else None)
        elif self._view.sight_range_m is not None:
            standing = tracks.present[index] & ~tracks.dead[index]
            time_s = float(tracks.time_s[index])
            where, arena = tracks.position[index], self._view.arena
            self.show_snapshot(true_snapshot(time_s, where, standing, arena, self._view.sight_range_m))

    def show_snapshot(self, snapshot: Snapshot | None) -> list[Artist]:
        """Show one complex, or nothing before the first."""
        if snapshot is None:
            for each in self.artists:
                each.set_verts([])
            return []
        position = snapshot.position
        self._triangles.set_verts(list(position[snapshot.triangles]))
        self._edges.set_segments(list(position[snapshot.edges]))
        self._obstacle.set_segments(list(position[snapshot.obstacle]))
        self._frontier.set_segments(list(position[snapshot.frontier]))
        hops = np.array([hop for path in snapshot.paths for hop in pairwise(path)], dtype=np.int64).reshape(-1, 2)
        lines = position[hops] if len(hops) else NO_LINES
        self._pushes.set_segments(list(lines))
        self._heads.set_verts(list(_heads(lines, self._arrow_m)))
        if not self._names:
            return []
        return [self._write(robot, position[robot]) for robot in np.flatnonzero(snapshot.present).tolist()]

    def legend(self) -> list[Line2D | Patch]:
        """Return the entries of the legend: frontier and pushes only where a complex was reported."""
        entries: list[Line2D | Patch] = [
            Patch(**TRIANGLE, label="three robots that see each other"),
            Line2D([], [], color=EDGE, linewidth=0.8, label="two that see each other"),
        ]
        if not self._snapshots:
            return entries
        arrow: dict[str, Any] = {"marker": ">", "markersize": 5}
        return [
            *entries,
            Line2D([], [], color=FRONTIER, linewidth=2.8, label="frontier: there is a way on"),
            Line2D([], [], color=OBSTACLE, linewidth=2.4, label="obstacle: a wall is beyond"),
            Line2D([], [], color=PUSH, linewidth=1.8, **arrow, label="push: each takes the next slot"),
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
