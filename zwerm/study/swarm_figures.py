"""Figures of a study that show robots: their paths, and their density at the end of a run.

The rows of a study hold no positions, so the first trial of a point is run again for its figure. The same seed gives the same
run.
"""

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely

from zwerm.record.history import Tracks
from zwerm.run.runner import run
from zwerm.study.summary import Results
from zwerm.study.trial_plan import Point
from zwerm.world.arena.arena import Arena
from zwerm.world.fields.registry import make_field
from zwerm.world.geometry.voronoi_cells import Rings, VoronoiCells
from zwerm.world.scene import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANEL_IN: Final = 3.6
_TITLE_IN: Final = 0.8

# The robot whose coordinates are drawn over time.
_FOLLOWED: Final = 0


def draw_tracks(figure: "Figure", results: Results) -> None:
    """Draw a row of panels for each point: start, paths, the end with its Voronoi cells, and one robot's coordinates."""
    points = results.points
    figure.set_size_inches(4 * _PANEL_IN, _PANEL_IN * len(points) + _TITLE_IN)
    for row, point in zip(figure.subplots(len(points), 4, squeeze=False), points, strict=True):
        tracks, arena = _first_trial(results, point), _arena(point)
        start, paths, end, followed = row
        for panel in (start, paths, end):
            _draw_arena(panel, point, arena)
        start.plot(*tracks.position[0].T, "o", color="C0", markersize=3)
        paths.plot(*np.moveaxis(tracks.position, 2, 0), "--", color="C0", linewidth=0.6)
        paths.plot(*tracks.position[-1].T, "o", color="C0", markersize=3)
        _draw_cells(end, point, arena, tracks.position[-1])
        for axis, name in enumerate("xy"):
            followed.plot(tracks.time_s, tracks.position[:, _FOLLOWED, axis], label=f"{name} of robot {_FOLLOWED}")
        followed.set(xlabel="time_s", ylabel="m", title="one robot")
        followed.legend()
        followed.grid(alpha=0.3)
        for panel, title in zip((start, paths, end), ("start", "paths", f"end, {tracks.time_s[-1]:g} s"), strict=True):
            panel.set_title(f"{point.label}: {title}" if point.label else title)


def draw_density(figure: "Figure", results: Results) -> None:
    """Draw a column for each point: final positions, and density over the distance from the field's peak."""
    points = [point for point in results.points if _rings(point) is not None]
    figure.set_size_inches(_PANEL_IN * max(1, len(points)), 2 * _PANEL_IN + _TITLE_IN)
    if not points:
        return
    panels = figure.subplots(2, len(points), squeeze=False, sharey="row")
    for above, below, point in zip(*panels, points, strict=True):
        _draw_arena(above, point, _arena(point))
        position = _first_trial(results, point).position[-1]
        above.plot(*position.T, "o", color="C0", markersize=max(1.0, 30.0 / len(position) ** 0.5))
        above.set_title(point.label or point.scenario.name, fontsize="small")
        rings = _rings(point)
        assert rings is not None
        edges = rings.edges_m
        samples = [results.sample(point, f"density_ring_{ring:02d}") for ring in range(1, len(edges))]
        mean, half = np.array([(sample.mean, sample.half_width) for sample in samples]).T
        below.stairs(mean, edges, color="C0", fill=True, alpha=0.4)
        below.errorbar(0.5 * (edges[1:] + edges[:-1]), mean, np.nan_to_num(half), fmt=".", color="C0", capsize=2)
        below.axhline(1.0, color="black", linewidth=0.8, linestyle=":")
        below.set(xlabel="distance from the peak, m", title=f"trials: {max(sample.n for sample in samples)}")
        below.grid(alpha=0.3)
    panels[1, 0].set(ylabel="density, 1 is uniform", ylim=(0.0, None))


def _first_trial(results: Results, point: Point) -> Tracks:
    rows = results.rows(point)
    return run(point.scenario, int(rows[0]["seed"]) if rows else 1, "inline").history.arrays()


def _arena(point: Point) -> Arena:
    return Arena.from_table(point.scenario.arena, point.scenario.folder)


def _rings(point: Point) -> Rings | None:
    table = point.scenario.metrics.voronoi
    return None if table is None or table.peak_m is None else Rings(_arena(point), table.peak_m, table.rings)


def _draw_arena(panel: "Axes", point: Point, arena: Arena) -> None:
    """Draw the arena's outline and a cross at each peak of its field."""
    for part in shapely.get_parts(arena.free):
        panel.plot(*np.array(part.exterior.coords).T, color="black", linewidth=0.8)
    parameters: dict[str, Any] = point.scenario.field.parameters if point.scenario.field is not None else {}
    for x, y in parameters.get("centers_m", [parameters["center_m"]] if "center_m" in parameters else []):
        panel.plot(x, y, "x", color="C3", markersize=8, zorder=4)
    panel.set(aspect="equal")
    panel.set_axis_off()


def _draw_cells(panel: "Axes", point: Point, arena: Arena, position: Floats) -> None:
    """Draw the robots, and their Voronoi cells if the arena is convex and has a field."""
    scenario = point.scenario
    if arena.is_convex and scenario.field is not None:
        field = make_field(scenario.field, arena.bounds, scenario.folder, scenario.place)
        for here, cell in zip(position, VoronoiCells(arena, field).cells(position), strict=True):
            if cell:
                panel.fill(*(np.array(cell) + here).T, facecolor="none", edgecolor="0.6", linewidth=0.5)
    panel.plot(*position.T, "o", color="C0", markersize=3)
