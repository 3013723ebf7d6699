"""What is measured of a run, by name; units are last in the names."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from zwerm.catalogue import BASE
from zwerm.scenario.tables import MetricsTable, Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.metrics.removals import removals
from zwerm.world.metrics.sight import SeenArea, hexagonal_packing_robots, holes, living, obstacles, reachable
from zwerm.world.scene import Floats, Ints
from zwerm.world.tick.telemetry import TelemetryRecord

if TYPE_CHECKING:  # the world's faults wait for metrics
    from zwerm.world.world import World

# Sides of the polygon that stands for a disc, a quarter: the area is off by 2e-5 of the disc's.
_QUARTER_SIDES = 64


def cell_counts(position: Floats, bounds: tuple[float, float, float, float], grid: tuple[int, int]) -> Ints:
    """Return (rows, columns) numbers of robots in the cells of `grid` = (columns, rows) over `bounds` [m]."""
    x0, y0, x1, y1 = bounds
    columns, rows = grid
    column = np.clip(((position[:, 0] - x0) / (x1 - x0) * columns).astype(np.int64), 0, columns - 1)
    row = np.clip(((position[:, 1] - y0) / (y1 - y0) * rows).astype(np.int64), 0, rows - 1)
    return np.bincount(row * columns + column, minlength=rows * columns).reshape(rows, columns)


def cell_coverage_fraction(counts: Ints) -> float:
    """Return the fraction of cells that hold a robot. Ozdemir 2019, eq. 2."""
    return float(np.count_nonzero(counts) / counts.size)


def area_coverage_fraction(position: Floats, radius_m: float, arena: Arena) -> float:
    """Return the fraction of the arena within `radius_m` of a robot. Ozdemir 2019, eq. 3."""
    if not len(position):
        return 0.0
    discs = shapely.buffer(shapely.points(position), radius_m, quad_segs=_QUARTER_SIDES)
    covered = shapely.intersection(shapely.union_all(discs), arena.free)
    return float(covered.area / arena.area_m2)


def measure(world: "World", table: MetricsTable) -> dict[str, float]:
    """Return the metrics of the world as it is now."""
    position = world.scene.position[world.scene.present]
    found = {"robots_in_arena": float(len(position))}
    if world.scenario.robots.inflow is not None:
        found["robots_exited"] = float(len(world.exited))
    if table.cells is not None:
        counts = cell_counts(position, world.arena.bounds, table.cells)
        found["cell_coverage_fraction"] = cell_coverage_fraction(counts)
    if table.coverage_radius_m is not None:
        found["area_coverage_fraction"] = area_coverage_fraction(position, table.coverage_radius_m, world.arena)
    if table.sight_range_m is not None:
        found |= _sight(world, table.sight_range_m)
        if _robots_leave(world.scenario):
            found |= removals(world, table.sight_range_m)
    variant = world.scenario.variant
    if variant is not None and variant.decides == BASE:
        found["concluded_early"] = concluded_early(world)
    if world.schedule.faults:
        found["faults_missed"] = float(len(world.schedule.missed))
    return found | _told(world)


def _robots_leave(scenario: Scenario) -> bool:
    services = {} if scenario.variant is None else scenario.variant.services
    return services.get("redundancy") == "link" or dict(services) == {"path": "gradient", "redundancy": "coordinator"}


def concluded_early(world: "World") -> float:
    """Return 1 where the base station has concluded while a living robot knew where to expand, else 0."""
    claimed: dict[int, bool] = {}
    for each in world.audience.told:
        if "frontier" in each.told:
            claimed[each.node] = each.told["frontier"]["claimed"]
    return float(world.completed and any(there and node not in world.dead for node, there in claimed.items()))


def _told(world: "World") -> dict[str, float]:
    """Return the numbers that nodes told, the newest of each; but cycles over all lives."""
    found: dict[str, float] = {}
    for each in world.audience.told:
        found |= {name: float(value) for name, value in each.told.items() if isinstance(value, int | float)}
    return found | deployment_cycles(world.audience.told)


def deployment_cycles(told: Sequence[TelemetryRecord]) -> dict[str, float]:
    """Return the `deployment_cycles` of the node that told of them last: of all its lives, also those that died on the way.

    Who begins anew counts anew: a complex whose cycle is not a later one, or fewer cycles than before, are another life's.
    """
    before: dict[int, float] = {}
    newest: dict[int, float] = {}
    found: dict[str, float] = {}
    for each in told:
        known = newest.get(each.node, 0.0)
        if "complex" in each.told:
            cycle = float(each.told["complex"]["cycle"])
            anew = cycle <= known
        elif "deployment_cycles" in each.told:
            cycle = float(each.told["deployment_cycles"])
            anew = cycle < known
        else:
            continue
        if anew:
            before[each.node] = before.get(each.node, 0.0) + known
        newest[each.node] = cycle
        found["deployment_cycles"] = before.get(each.node, 0.0) + cycle
    return found


def _covered(world: "World", position: Floats, range_m: float) -> dict[str, float]:
    """Return the fractions in sight of the free space, and of what of it robots can get into."""
    if not len(position):
        return {"coverage_fraction": 0.0, "reachable_coverage_fraction": 0.0}
    seen = SeenArea(world.arena, range_m).area(position)
    inside = reachable(world.arena, world.scene.radius_m, position)
    return {
        "coverage_fraction": min(1.0, float(seen.area / world.arena.area_m2)),
        "reachable_coverage_fraction": min(1.0, float(shapely.intersection(seen, inside).area / inside.area)),
    }


def _sight(world: "World", range_m: float) -> dict[str, float]:
    """Return how well the living robots cover the arena by sight, and how that compares with the ideal packing."""
    scene = world.scene
    robots = living(scene.present_ids(), world.dead)
    ideal = hexagonal_packing_robots(world.arena, range_m)
    return {
        **_covered(world, scene.position[robots], range_m),
        "robots_deployed": float(len(robots)),
        "hexagonal_packing_robots": ideal,
        "robots_over_hexagonal": len(robots) / ideal,
        "holes": float(holes(Visibility().pairs(scene, range_m), robots)),
        "obstacles": float(obstacles(world.arena)),
    }
