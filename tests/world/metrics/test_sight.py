"""The area that a swarm sees, against areas computed by hand."""

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString

from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.tables import ArenaTable
from zwerm.view.layers.sensor_coverage import snapshots
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.sight import SeenArea, hexagonal_packing_robots, holes, obstacles, reachable, robust, seen_from


def arena(**table: object) -> Arena:
    return Arena.from_table(ArenaTable.model_validate(table), Path())


def test_a_disc_in_an_open_hall_covers_its_area() -> None:
    found = SeenArea(arena(size_m=[10.0, 10.0]), 1.0).fraction(np.array([[5.0, 5.0]]))
    assert found == pytest.approx(math.pi / 100.0, rel=1e-3)


def test_what_is_behind_a_wall_is_not_covered() -> None:
    hall = arena(size_m=[2.0, 2.0], walls=[[[1.0, 0.0], [1.0, 2.0]]])
    assert SeenArea(hall, 9.0).fraction(np.array([[0.5, 1.0]])) == pytest.approx(0.5, abs=1e-6)
    assert SeenArea(hall, 9.0).fraction(np.array([[0.5, 1.0], [1.5, 1.0]])) == pytest.approx(1.0, abs=1e-6)


def test_what_lies_behind_a_crack_that_no_body_passes_cannot_be_reached_and_corners_can() -> None:
    """A room of 2 x 2 m, and beyond a crack another of 1 x 2 m; the way there is 0.1 m wide and 0.5 m long."""
    rooms = arena(
        polygon=[
            [0, 0],
            [2, 0],
            [2, 0.95],
            [2.5, 0.95],
            [2.5, 0],
            [3.5, 0],
            [3.5, 2],
            [2.5, 2],
            [2.5, 1.05],
            [2, 1.05],
            [2, 2],
            [0, 2],
        ]
    )
    here = np.array([[1.0, 1.0]])
    assert reachable(rooms, 0.07, here).area == pytest.approx(4.0, abs=0.005)
    assert reachable(rooms, 0.04, here).area == pytest.approx(rooms.area_m2, abs=0.005)
    assert reachable(rooms, 0.07, np.array([[1.0, 1.0], [3.0, 1.0]])).area == pytest.approx(6.0, abs=0.01)
    cut = arena(size_m=[2.0, 2.0], walls=[[[1.0, 0.0], [1.0, 2.0]]])
    assert reachable(cut, 0.07, np.array([[0.5, 1.0]])).area == pytest.approx(2.0, abs=0.005)


def test_an_obstacle_hides_exactly_the_area_behind_it() -> None:
    """From (1, 2), a square that spans 1 m across at 1 m away hides a wedge: 2 at the near side, the rest by similarity."""
    hall = arena(size_m=[4.0, 4.0], obstacles=[[[2.0, 1.5], [3.0, 1.5], [3.0, 2.5], [2.0, 2.5]]])
    # The wedge between the rays through the near corners, x from 2 to 4, less the square itself.
    hidden = (1.0 + 3.0) / 2.0 * 2.0 - 1.0
    found = SeenArea(hall, 20.0).fraction(np.array([[1.0, 2.0]]))
    assert found == pytest.approx(1.0 - hidden / 15.0, abs=1e-6)


def test_a_robot_that_nearly_touches_a_wall_sees_nothing_beyond_it() -> None:
    hall = arena(size_m=[4.0, 4.0], walls=[[[0.0, 2.0], [4.0, 2.0]]])
    assert SeenArea(hall, 20.0).fraction(np.array([[2.0, 1.999]])) == pytest.approx(0.5, abs=1e-3)


def test_the_ideal_packing_is_the_mean_over_many_ways_to_lay_it() -> None:
    hall = arena(size_m=[9.0, 7.5])
    random = np.random.default_rng(3)
    rows = np.stack(np.meshgrid(np.arange(-20, 20), np.arange(-20, 20)), axis=-1).reshape(-1, 2)
    lattice = rows @ np.array([[1.0, 0.0], [0.5, math.sqrt(0.75)]])
    counts = []
    for _ in range(400):
        angle = random.uniform(0.0, math.pi)
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        points = (lattice + random.uniform(0.0, 1.0, 2)) @ turn + (4.5, 3.75)
        counts.append(hall.contains(points).sum())
    assert hexagonal_packing_robots(hall, 1.0) == pytest.approx(np.mean(counts), rel=0.01)


def test_holes_are_those_of_the_complex_and_obstacles_those_of_the_arena() -> None:
    ring = np.array([[0, 1], [1, 2], [2, 3], [0, 3]])
    assert holes(ring, np.arange(4)) == 1
    assert holes(ring, np.arange(3)) == 0
    assert obstacles(arena(size_m=[4.0, 4.0], obstacles=[[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]])) == 1


def test_the_complex_of_a_run_can_be_drawn_at_any_cycle(tmp_path: Path) -> None:
    settings = ["arena.size_m=[2.2,1.6]", "base.pose=[0.2,0.8,0.0]", "robots.count=14"]
    result = run("sensor-coverage", runner="inline", overrides=settings)
    reported = snapshots(result.snapshots)
    assert [each.cycle for each in reported] == list(range(1, int(result.metrics["deployment_cycles"]) + 1))
    assert len(reported[1].frontier)
    assert not len(reported[-1].frontier)
    assert result.picture(tmp_path / "complex.png", cycle=2).stat().st_size > 5_000


# --- the metrics of a deployment, each by another way than the one it is computed by -------------------------------


DEPLOYMENT = (
    "arena.size_m=[3.4,2.8]",
    "base.pose=[0.2,1.4,0.0]",
    "robots.count=40",
    "arena.obstacles=[[[1.5,1.0],[2.3,1.0],[2.3,1.8],[1.5,1.8]]]",
    "metrics.every_s=1.0",
    'coordinator.parameters.walls="paper"',
)


@pytest.fixture(scope="module")
def deployed() -> RunResult:
    result = run("sensor-coverage", runner="inline", overrides=DEPLOYMENT)
    assert result.outcome == "completed"
    return result


def test_robots_deployed_are_those_in_the_arena_and_the_ideal_is_area_over_hexagons(deployed: RunResult) -> None:
    found = deployed.metrics
    assert found["robots_deployed"] == deployed.history.arrays().present[-1].sum() == 1 + found["robots_released"]
    assert found["hexagonal_packing_robots"] == pytest.approx((3.4 * 2.8 - 0.8 * 0.8) * 2.0 / math.sqrt(3.0))
    assert found["robots_over_hexagonal"] == found["robots_deployed"] / found["hexagonal_packing_robots"]


def test_holes_are_what_another_library_finds_in_the_true_complex(deployed: RunResult) -> None:
    gudhi = pytest.importorskip("gudhi")
    tracks = deployed.history.arrays()
    here = tracks.position[-1][tracks.present[-1]]
    pillar = LineString([(1.5, 1.0), (2.3, 1.0), (2.3, 1.8), (1.5, 1.8), (1.5, 1.0)])
    tree = gudhi.SimplexTree()
    for i in range(len(here)):
        tree.insert([i])
        for j in range(i):
            if math.dist(here[i], here[j]) <= 1.0 and not LineString([here[i], here[j]]).crosses(pillar):
                tree.insert([i, j])
    tree.expansion(3)
    tree.compute_persistence(homology_coeff_field=2, persistence_dim_max=True)
    assert deployed.metrics["holes"] == tree.betti_numbers()[1] == deployed.metrics["obstacles"] == 1.0


def test_cycles_are_those_reported_and_ticks_and_messages_are_means_per_cycle(deployed: RunResult) -> None:
    found = deployed.metrics
    assert found["deployment_cycles"] == snapshots(deployed.snapshots)[-1].cycle
    assert found["ticks_per_cycle_mean"] == deployed.ticks / found["deployment_cycles"]
    sent = sum(sum(channel["messages"]) for channel in deployed.radio["channels"].values())
    assert found["messages_per_cycle_mean"] == sent / found["deployment_cycles"]
    assert 0.0 <= found["redundant_robots"] < found["robots_deployed"]


def test_the_time_to_a_coverage_is_the_time_at_which_it_is_in_sight(deployed: RunResult) -> None:
    found = deployed.metrics
    times = [found[f"time_to_{percent}_percent_coverage_s"] for percent in (50, 90, 99)]
    assert times == sorted(times)
    sight = SeenArea(deployed.arena, 1.0)

    def in_sight(end_s: float) -> float:
        """Return the fraction at the end of a run that is as long as this."""
        run_until = run("sensor-coverage", runner="inline", overrides=[*DEPLOYMENT, f"time.duration_s={end_s}"])
        tracks = run_until.history.arrays()
        return sight.fraction(tracks.position[-1][tracks.present[-1]])

    for percent, time_s in zip((50, 90, 99), times, strict=True):
        # It is measured once a second. Robots move on, so a place may go out of sight again soon.
        assert in_sight(float(math.floor(time_s))) < percent / 100.0 <= in_sight(float(math.ceil(time_s)))
    assert deployed.series["coverage_fraction"][-1] == found["coverage_fraction"]
    assert deployed.series["robots_deployed"][-1] == found["robots_deployed"]


def test_a_coverage_that_is_never_reached_has_no_time() -> None:
    settings = ["arena.size_m=[2.2,1.6]", "base.pose=[0.2,0.8,0.0]", "robots.count=14", "time.duration_s=20.0"]
    found = run("sensor-coverage", runner="inline", overrides=settings).metrics
    assert found["time_to_50_percent_coverage_s"] < 20.0
    assert math.isnan(found["time_to_99_percent_coverage_s"])
    # The coordinator had no time to say how many; the complex that it told of last does.
    assert found["deployment_cycles"] >= 1.0


BOW_TIE = shapely.Polygon([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])


@pytest.mark.parametrize("invalid", [False, True])
@pytest.mark.parametrize("finest_m", [1e-9, 1e-6, math.inf])
def test_an_overlay_that_fails_in_floating_point_is_computed_on_a_grid(finest_m: float, invalid: bool) -> None:
    """A union with nested shells is no valid geometry, and its area is wrong. On no grid: the inputs grow a little."""

    def fails(a: shapely.Geometry, b: shapely.Geometry, grid_size: float = 0.0) -> shapely.Geometry:
        if grid_size < finest_m and a.area < 2.00001:
            if invalid:
                return BOW_TIE
            raise shapely.errors.GEOSException("TopologyException: Ring edge missing")
        return shapely.difference(a, b, grid_size=grid_size)

    left = robust(fails, shapely.box(0.0, 0.0, 2.0, 1.0), shapely.box(1.0, 0.0, 2.0, 1.0))
    assert left.symmetric_difference(shapely.box(0.0, 0.0, 1.0, 1.0)).area < 1e-4


def test_the_seen_area_is_the_union_of_what_is_seen_from_each_place_wherever_robots_move_to() -> None:
    hall = arena(size_m=[14.0, 9.0], walls=[[[5.0, 0.0], [5.0, 6.0]], [[9.0, 9.0], [9.0, 2.0]]])
    sight = SeenArea(hall, 1.0)
    random = np.random.Generator(np.random.Philox(7))
    position = random.uniform((0.1, 0.1), (13.9, 8.9), (60, 2))
    for _ in range(12):
        expected = shapely.union_all([seen_from(each, 1.0, hall) for each in position])
        assert sight.area(position).symmetric_difference(expected).area == pytest.approx(0.0, abs=1e-9)
        assert sight.fraction(position) == pytest.approx(expected.area / hall.area_m2, abs=1e-9)
        moved = random.choice(len(position), 4, replace=False)
        position = np.delete(position, moved[0], axis=0)
        position[moved[1:] % len(position)] = random.uniform((0.1, 0.1), (13.9, 8.9), (3, 2))
    assert sight.fraction(position[:0]) == 0.0
