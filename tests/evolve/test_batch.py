"""The batch kernel against the emulator: one robot's path, distributions of small swarms, and the stored table of a study."""

import csv
from typing import Any

import numpy as np
import pytest
from support import ROOT, scenario

from zwerm.errors import MissingExtraError, ScenarioError
from zwerm.evolve import reactive_kernel
from zwerm.evolve.batch import Batch, BatchResult
from zwerm.evolve.reactive_kernel import CELLS_MAX
from zwerm.run.runner import run
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.position_coverage import cell_counts, cell_coverage_fraction

pytest.importorskip("numba", reason="the kernel is compiled by numba, which `make dev` installs")


def small(**robots: Any) -> Scenario:
    """Return a scenario that a batch has: six e-pucks in a square of 1 m, for 20 s."""
    body = {"latency_ticks": 1, "drive_noise_fraction": 0.05} | robots.pop("body", {})
    return scenario(
        time={"duration_s": 20.0},
        arena={"size_m": [1.0, 1.0]},
        robots={"count": 6, "body": body, **robots},
        metrics={"cells": [3, 3], "coverage_radius_m": 0.2},
    )


def ran(given: Scenario, arenas: int) -> tuple[Batch, BatchResult]:
    batch = Batch(given)
    return batch, batch.run([given.robots.parameters] * arenas, range(1, arenas + 1))


@pytest.mark.parametrize("latency", [0, 1, 3])
def test_a_robot_without_noise_takes_the_path_that_the_emulator_gives_it(latency: int) -> None:
    given = small(count=1, body={"latency_ticks": latency, "drive_noise_fraction": 0.0})
    for seed in (1, 2, 3):  # the circle of one of them meets a wall
        batch = Batch(given)
        end = batch.run([{"right_0": 0.6}], [seed]).position[0, 0]
        track = run(
            given.model_copy(update={"robots": given.robots.model_copy(update={"parameters": {"right_0": 0.6}})}),
            seed,
            "inline",
        ).history.arrays()
        assert end == pytest.approx(track.position[-1, 0], abs=2e-3)


def test_a_command_acts_later_by_the_latency_of_the_body() -> None:
    """The negative control of the paths: with another latency, the robot ends elsewhere by its way in that time."""
    circle_m_s = (0.719558 + 0.412543) / 2.0 * 0.128
    bodies = [{"latency_ticks": latency, "drive_noise_fraction": 0.0} for latency in (0, 10)]
    ends = [Batch(small(count=1, body=body)).run([{}], [2]).position[0, 0] for body in bodies]
    assert 0.5 * circle_m_s < np.hypot(*(ends[0] - ends[1])) < 1.01 * circle_m_s


def test_small_swarms_cover_as_many_cells_as_on_the_emulator() -> None:
    given, trials = small(), 24
    batch, result = ran(given, 150)
    runs = [run(given, seed, "inline") for seed in range(1, trials + 1)]
    ours, theirs = batch.cell_coverage(result), np.array([each.metrics["cell_coverage_fraction"] for each in runs])
    areas = np.array([each.metrics["area_coverage_fraction"] for each in runs])
    for mine, emulated in ((ours, theirs), (batch.area_coverage(result), areas)):
        margin = 4.0 * np.sqrt(emulated.var(ddof=1) / len(emulated) + mine.var(ddof=1) / len(mine))
        assert mine.mean() == pytest.approx(emulated.mean(), abs=margin)
        assert mine.std(ddof=1) == pytest.approx(emulated.std(ddof=1), rel=0.5)


@pytest.mark.parametrize("variant", ["computation-free", "open-loop", "greedy"])
def test_the_batch_has_the_coverage_that_the_study_on_the_emulator_stored(variant: str) -> None:
    name = variant if variant == "computation-free" else f"computation-free-{variant}"
    with (ROOT / "docs/measurements/computation-free-comparison.csv").open(newline="", encoding="utf-8") as file:
        rows = {row["metric"]: row for row in csv.DictReader(file) if row["variant"] == variant}
    batch, result = ran(load(name), 100)
    for metric, mine in (
        ("cell_coverage_fraction", batch.cell_coverage(result)),
        ("area_coverage_fraction", batch.area_coverage(result)),
    ):
        half_width = float(rows[metric]["half_width"]) / 1.96
        margin = 4.0 * np.hypot(half_width, mine.std(ddof=1) / np.sqrt(len(mine)))
        assert mine.mean() == pytest.approx(float(rows[metric]["mean"]), abs=margin)


def test_a_batch_without_the_latency_of_the_paper_covers_less() -> None:
    """The negative control of the comparison with the emulator: a wrong body is seen."""
    batch, result = ran(load("computation-free", ("robots.body.latency_ticks=0",)), 100)
    assert batch.cell_coverage(result).mean() < 0.70


def test_noise_of_the_sensor_replaces_bits_by_random_ones() -> None:
    """Both readings random is the worst of the paper's three kinds of noise. Ozdemir 2019, Fig. 4."""
    noises = ("false_negative", "false_positive", "combined")
    means = []
    for noise in noises:
        batch, result = ran(load("computation-free", (f"robots.sensors.0.{noise}=1.0",)), 50)
        means.append(batch.cell_coverage(result).mean())
    assert means[2] < 0.4 < 0.5 < min(means[:2])


def test_cells_are_counted_as_the_metric_counts_them() -> None:
    given = small()
    batch, result = ran(given, 20)
    bounds = Arena.from_table(given.arena, given.folder).bounds
    counted = [cell_coverage_fraction(cell_counts(each, bounds, (3, 3))) for each in result.position]
    assert batch.cell_coverage(result).tolist() == counted


def test_the_same_seeds_give_the_same_batch_in_any_order_and_others_do_not() -> None:
    given = small()
    batch = Batch(given)
    some = batch.run([{}] * 3, [7, 8, 9])
    turned = batch.run([{}] * 2, [9, 7])
    assert (turned.position == some.position[[2, 0]]).all()
    assert (turned.occupied == some.occupied[[2, 0]]).all()
    assert not (some.position[0] == some.position[1]).all()


def test_robots_stay_in_the_arena_and_apart() -> None:
    given = small(count=30, placement={"kind": "uniform"})
    _, result = ran(given, 20)
    radius = given.robots.body.radius_m
    assert (result.position >= radius - 1e-6).all()
    assert (result.position <= 1.0 - radius + 1e-6).all()
    gaps = np.linalg.norm(result.position[:, :, None] - result.position[:, None], axis=-1)
    gaps[:, np.arange(30), np.arange(30)] = np.inf
    # One push for each overlap and substep leaves a tenth of a diameter where many robots press on each other.
    assert gaps.min() > 1.7 * radius


@pytest.mark.parametrize(
    ("tables", "rule"),
    [
        ({"robots": {"controller": "random-walk"}}, "robots.controller: expected one that has a batch"),
        ({"arena": {"size_m": [2.0, 2.0], "walls": [[[0.5, 0.5], [1.0, 1.0]]]}}, "arena: expected size_m and no other"),
        (
            {"robots": {"sensors": [{"kind": "line_of_sight", "range_m": 1.0}]}},
            "robots.sensors: expected line_of_sight",
        ),
        ({"robots": {"body": {"friction": 0.5}}}, "robots.body: expected kind = 'differential', friction = 0"),
        ({"time": {"dt_s": 1.0}}, "robots.body: expected turns of at most 2 rad in a tick"),
        ({"radio": {}}, "radio: a batch has none"),
        ({"robots": {"clock": {"offset_s_max": 1.0}}}, "robots.clock: a batch has none"),
        ({"metrics": {"cells": [9, 8]}}, f"metrics.cells: expected a grid of at most {CELLS_MAX} cells, got (9, 8)"),
        ({"metrics": {"cells": None}}, f"metrics.cells: expected a grid of at most {CELLS_MAX} cells, got None"),
    ],
)
def test_a_scenario_that_a_batch_cannot_have_is_refused_in_one_line(tables: dict[str, Any], rule: str) -> None:
    base = {"metrics": {"cells": [2, 2]}}
    with pytest.raises(ScenarioError) as refused:
        Batch(scenario(**base | tables))
    (line,) = refused.value.mistakes
    assert line.startswith(f"small.toml: {rule}")


def test_without_numba_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "numba", None)
    reactive_kernel.kernel.cache_clear()
    with pytest.raises(MissingExtraError, match=r"evolve: needs numba; install it with: pip install 'zwerm\[evolve\]'"):
        Batch(small())
    reactive_kernel.kernel.cache_clear()
