"""What a swarm sees, against areas known by hand."""

import math
from pathlib import Path

import numpy as np
import pytest

from zwerm.running import run
from zwerm.scenario import ArenaTable
from zwerm.world.arena import Arena
from zwerm.world.sight import hexagonal_packing_robots, holes, obstacles, sight_coverage_fraction


def arena(**table: object) -> Arena:
    return Arena.from_table(ArenaTable.model_validate(table), Path())


def test_a_disc_in_an_open_hall_covers_its_area() -> None:
    found = sight_coverage_fraction(np.array([[5.0, 5.0]]), 1.0, arena(size_m=[10.0, 10.0]))
    assert found == pytest.approx(math.pi / 100.0, rel=1e-3)


def test_what_is_behind_a_wall_is_not_covered() -> None:
    hall = arena(size_m=[2.0, 2.0], walls=[[[1.0, 0.0], [1.0, 2.0]]])
    assert sight_coverage_fraction(np.array([[0.5, 1.0]]), 9.0, hall) == pytest.approx(0.5, abs=1e-6)
    assert sight_coverage_fraction(np.array([[0.5, 1.0], [1.5, 1.0]]), 9.0, hall) == pytest.approx(1.0, abs=1e-6)


def test_the_shadow_of_an_obstacle_is_that_of_a_lamp() -> None:
    """From (1, 2), a square that spans 1 m across at 1 m away hides a wedge: 2 at the near side, the rest by similarity."""
    hall = arena(size_m=[4.0, 4.0], obstacles=[[[2.0, 1.5], [3.0, 1.5], [3.0, 2.5], [2.0, 2.5]]])
    # The wedge between the rays through the near corners, x from 2 to 4, less the square itself.
    hidden = (1.0 + 3.0) / 2.0 * 2.0 - 1.0
    found = sight_coverage_fraction(np.array([[1.0, 2.0]]), 20.0, hall)
    assert found == pytest.approx(1.0 - hidden / 15.0, abs=1e-6)


def test_a_robot_that_nearly_touches_a_wall_sees_nothing_beyond_it() -> None:
    hall = arena(size_m=[4.0, 4.0], walls=[[[0.0, 2.0], [4.0, 2.0]]])
    assert sight_coverage_fraction(np.array([[2.0, 1.999]]), 20.0, hall) == pytest.approx(0.5, abs=1e-3)


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
    pictures = pytest.importorskip("zwerm.world.pictures_complex")
    settings = ["arena.size_m=[2.2,1.6]", "base.pose=[0.2,0.8,0.0]", "robots.count=14"]
    result = run("sensor-coverage", runner="inline", overrides=settings)
    told = pictures.cycles(result.told)
    assert [each.told["complex"]["cycle"] for each in told] == list(
        range(2, int(result.metrics["deployment_cycles"]) + 1)
    )
    assert told[0].told["complex"]["frontier"]
    assert not told[-1].told["complex"]["frontier"]
    for path in (
        result.picture_complex(tmp_path / "complex.png", cycle=1),
        pictures.draw_coverage(tmp_path / "coverage.png", result.arena, result.told, 1.0),
    ):
        assert path.stat().st_size > 5_000
