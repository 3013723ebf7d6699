"""Coverage by a team of robots, by exact polygons: the fraction of the area that footprints can sweep and have swept.

The centre of a robot can be where its body fits: in the free space eroded by the body's radius. Only the part of that
space in which it started counts. Their footprints can sweep the free space within the footprint's radius of it. A
circle is a polygon of 4 * 32 sides inside it; the same in both areas.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, MultiPolygon, Point, Polygon
from shapely.ops import unary_union

from zwerm.maths.sums import added
from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.tick.telemetry import TelemetryRecord

Floats = NDArray[np.float64]

QUARTER_SEGMENTS: Final = 32
# The path is simplified by at most this much before it is widened [m].
SIMPLIFY_M: Final = 1e-3
# The body presses against walls: how much nearer than its radius its centre may come [m].
PRESSED_M: Final = 1e-3


def reachable(free: Polygon | MultiPolygon, starts: Floats, radius_m: float) -> Polygon | MultiPolygon:
    """Return the places [m] of the centre of a body of `radius_m` that can be reached from `starts` (n, 2)."""
    inner = free.buffer(-(radius_m - PRESSED_M), quad_segs=QUARTER_SEGMENTS)
    parts = [
        part
        for part in shapely.get_parts(inner)
        if any(part.distance(Point(start)) < 2.0 * PRESSED_M for start in starts)
    ]
    return unary_union(parts)


def sweepable(
    free: Polygon | MultiPolygon, starts: Floats, radius_m: float, footprint_m: float
) -> Polygon | MultiPolygon:
    """Return the part of the free space that footprints of `footprint_m` can sweep [m]."""
    return reachable(free, starts, radius_m).buffer(footprint_m, quad_segs=QUARTER_SEGMENTS).intersection(free)


def swept(paths: Sequence[Floats], footprint_m: float, free: Polygon | MultiPolygon) -> Polygon | MultiPolygon:
    """Return the part of the free space that footprints swept along `paths`, each (t, 2) [m]."""
    strips = []
    for path in paths:
        line = LineString(path).simplify(SIMPLIFY_M) if len(path) > 1 else Point(path[0])
        coords = shapely.get_coordinates(line)
        for first in range(0, max(1, len(coords) - 1), 50):
            part = coords[first : first + 51]
            piece = LineString(part) if len(part) > 1 else Point(part[0])
            strips.append(piece.buffer(footprint_m, quad_segs=QUARTER_SEGMENTS))
    return unary_union(strips).intersection(free)


def coverage(
    free: Polygon | MultiPolygon, paths: Sequence[Floats], radius_m: float, footprint_m: float
) -> dict[str, float]:
    """Return `coverage_fraction` and `repeat_coverage_fraction` of `paths`, one (t, 2) array [m] for each robot.

    Repeat coverage is the area that footprints pass over on all paths, over the area that can be swept, less one.
    """
    starts = np.array([path[0] for path in paths])
    area = sweepable(free, starts, radius_m, footprint_m)
    done = swept(paths, footprint_m, free)
    length_m = added(float(np.hypot(*np.diff(path, axis=0).T).sum()) for path in paths)
    return {
        "coverage_fraction": done.intersection(area).area / area.area,
        "repeat_coverage_fraction": length_m * 2.0 * footprint_m / area.area - 1.0,
        "path_length_m": length_m,
        "sweepable_area_m2": area.area,
    }


class TeamCoverage(Metric):
    """Coverage by the footprints of all robots, from their paths, and what the robots report of their map."""

    names: ClassVar[Mapping[str, str]] = {
        "coverage_fraction": "the swept part of the area that footprints can sweep",
        "repeat_coverage_fraction": (
            "length of all paths times the diameter of the footprint, over the area that footprints can sweep, less one"
        ),
        "path_length_m": "length of the paths of all robots",
        "sweepable_area_m2": "area that the footprints of the robots can sweep",
        "completion_time_s": (
            "time at which the certificate of the last living robot was satisfied; null if it never was"
        ),
        "lower_bound_s": (
            "area that footprints can sweep, over robots times speed times the footprint's diameter: a bound on "
            "the time of any planner"
        ),
        "time_over_lower_bound": "`completion_time_s` over `lower_bound_s`",
        "certificate_satisfied": "1 if the certificates of all living robots are satisfied, else 0",
        "critical_points": "critical points that the robots report",
        "divisions": "divisions of teams that the robots report",
        "merges": "merges of teams that the robots report",
    }
    every_s: ClassVar[float | None] = 0.05

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        robots = context.scenario.robots
        self._free = context.arena.free
        self._radius_m = robots.body.radius_m
        footprint_m = robots.parameters.get("footprint_m")
        # Another type is a mistake that the check of the controller reports.
        self._footprint_m = float(footprint_m) if isinstance(footprint_m, int | float) else 0.5
        self._coordinator = context.coordinator
        self._width_m_s = 2.0 * self._footprint_m * robots.body.max_speed_m_s
        self._paths: list[Floats] = []
        self._numbers: dict[int, dict[str, float]] = {}
        self._truth: Truth | None = None

    def report(self, record: TelemetryRecord) -> None:
        """Keep the newest numbers of every robot."""
        self._numbers.setdefault(record.node, {}).update(record.numbers)

    def sample(self, truth: Truth) -> None:
        """Note where the robots are."""
        self._paths.append(truth.scene.position.copy())
        self._truth = truth

    def metrics(self) -> dict[str, float]:
        """Return the coverage by exact polygons, and the reports of the robots that live, or of the coordinator."""
        if self._truth is None:
            return {}
        paths = np.array(self._paths)
        tracks = [paths[:, robot] for robot in range(paths.shape[1])]
        living = [numbers for node, numbers in self._numbers.items() if node not in self._truth.dead]
        if self._coordinator in self._numbers:
            living = [self._numbers[self._coordinator]]
        covered = coverage(self._free, tracks, self._radius_m, self._footprint_m)
        time_s = self._truth.time_s if self._truth.completed else math.nan
        bound_s = covered["sweepable_area_m2"] / (len(tracks) * self._width_m_s)
        return {
            **covered,
            "completion_time_s": time_s,
            "lower_bound_s": bound_s,
            "time_over_lower_bound": time_s / bound_s,
            "certificate_satisfied": float(bool(living) and all(n.get("certificate_satisfied") for n in living)),
            "critical_points": max([numbers.get("critical_points", 0.0) for numbers in living], default=0.0),
            "divisions": added([numbers.get("divisions", 0.0) for numbers in self._numbers.values()]),
            "merges": added([numbers.get("merges", 0.0) for numbers in self._numbers.values()]),
        }
