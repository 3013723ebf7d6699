"""A scenario as a batch: thousands of its arenas at once, for swarms of robots with one bit of line of sight.

A batch has the scenario's start positions for each seed, the same as a run's. Its noise is drawn otherwise, and its contacts
are pushed apart by position and not solved with velocities. So a batch agrees with runs in distribution and not seed by seed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from zwerm.agents.runtime.controllers import find, parameters_of
from zwerm.catalogue import algorithm_of
from zwerm.errors import MissingExtraError, ScenarioError
from zwerm.evolve.reactive_kernel import CELLS_MAX, HALF_TURN_MAX_RAD, kernel
from zwerm.maths.keyed_random import Draws
from zwerm.run.assembly import prepare
from zwerm.scenario.tables import ArenaTable, Scenario
from zwerm.world.arena.placement import place
from zwerm.world.metrics.position_coverage import area_coverage_fraction
from zwerm.world.scene import Floats

Singles = NDArray[np.float32]

_COUNTED: Final = np.iinfo(np.uint8).max


@dataclass(frozen=True)
class BatchResult:
    """The result of A arenas: `occupied` (A, ticks + 1) cells with a robot, and the last `position` (A, n, 2) [m]."""

    occupied: NDArray[np.uint8]
    position: Floats


class Batch:
    """The arenas of one scenario. `cells` is the number of its cells, `ticks` its duration."""

    def __init__(self, scenario: Scenario) -> None:
        """Raises ScenarioError, a line for each rule of a batch that the scenario breaks, and MissingExtraError."""
        self._arena = prepare(scenario).arena
        mistakes = list(_mistakes(scenario))
        if mistakes:
            raise ScenarioError([f"{scenario.place}: {line}" for line in mistakes])
        robots = scenario.robots
        row = algorithm_of(robots.controller)
        assert row is not None
        module, _, name = row.reactive[robots.controller].partition(":")
        self.scenario = scenario
        self.ticks = round(scenario.time.duration_s / scenario.time.dt_s)
        columns, rows = scenario.metrics.cells
        self.cells: int = columns * rows
        self._fractions = getattr(import_module(module), name)
        self._parameters = parameters_of(find(robots.controller))
        self._starts: dict[int, tuple[Singles, Singles]] = {}
        try:
            self._kernel = kernel()
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                f"evolve: needs {error.name}; install it with: pip install 'zwerm[evolve]'"
            ) from None

    def run(self, parameters: Sequence[Mapping[str, Any]], seeds: Sequence[int]) -> BatchResult:
        """Run arena i with `parameters[i]` of the controller and the start positions of `seeds[i]`."""
        scenario, body = self.scenario, self.scenario.robots.body
        starts = [self._start(seed) for seed in seeds]
        position, heading = (np.stack(each) for each in zip(*starts, strict=True))
        wheels = [self._fractions(msgspec.convert(dict(each), self._parameters)) for each in parameters]
        keys = np.array([Draws(seed).bits("batch-noise", 0) for seed in seeds], dtype=np.uint64)
        occupied = np.zeros((len(seeds), self.ticks + 1), dtype=np.uint8)
        noise = scenario.robots.sensors[0].parameters
        combined = noise.get("combined", 0.0)
        self._kernel(
            position,
            heading,
            (np.array(wheels) * body.max_speed_m_s).astype(np.float32),
            (keys >> np.uint64(32)).astype(np.uint32),
            self.ticks,
            body.latency_ticks,
            body.substeps,
            scenario.time.dt_s,
            body.wheel_base_m,
            body.radius_m,
            body.max_speed_m_s,
            body.drive_noise_fraction,
            # A bit that is replaced by a random one changes half of the time.
            max(noise.get("false_negative", 0.0), combined) / 2.0,
            max(noise.get("false_positive", 0.0), combined) / 2.0,
            np.array(scenario.arena.size_m, dtype=np.float64),
            np.array(scenario.metrics.cells, dtype=np.int64),
            occupied,
        )
        return BatchResult(occupied, position.astype(np.float64))

    def draw_starts(self, seeds: Sequence[int]) -> None:
        """Draw the start positions of these seeds, which takes milliseconds each, and keep them."""
        for seed in seeds:
            self._start(seed)

    def cell_coverage(self, result: BatchResult) -> Floats:
        """Return (A,) the fraction of cells with a robot at the end. Ozdemir 2019, eq. 2."""
        covered: Floats = result.occupied[:, -1] / self.cells
        return covered

    def area_coverage(self, result: BatchResult) -> Floats:
        """Return (A,) the fraction of the area near a robot at the end. Ozdemir 2019, eq. 3.

        It needs `metrics.coverage_radius_m`, and about a millisecond for an arena.
        """
        radius_m = self.scenario.metrics.coverage_radius_m
        return np.array([area_coverage_fraction(each, radius_m, self._arena) for each in result.position])

    def fitness(self, result: BatchResult) -> Floats:
        """Return (A,) the mean cell coverage over all ticks t, weighted by t. Ozdemir 2019, eq. 4."""
        tick = np.arange(self.ticks + 1)
        weighed: Floats = result.occupied @ (tick / (tick.sum() * self.cells))
        return weighed

    def _start(self, seed: int) -> tuple[Singles, Singles]:
        """Return the positions (n, 2) [m] and headings (n,) [rad] at which a run with this seed starts."""
        if seed not in self._starts:
            robots = self.scenario.robots
            table, radius_m = robots.placement, robots.body.radius_m
            position, heading = place(table, self._arena, robots.count, radius_m, Draws(seed))
            self._starts[seed] = position.astype(np.float32), heading.astype(np.float32)
        return self._starts[seed]


def _mistakes(scenario: Scenario) -> list[str]:
    """Return a line `path: rule` for each thing of a scenario that a batch does not have."""
    robots, body = scenario.robots, scenario.robots.body
    row = algorithm_of(robots.controller)
    found = []
    if row is None or robots.controller not in row.reactive:
        found.append(
            f"robots.controller: expected one that has a batch (zwerm list names them), got {robots.controller!r}"
        )
    if scenario.arena.size_m is None or scenario.arena != ArenaTable(size_m=scenario.arena.size_m):
        found.append("arena: expected size_m and no other key: a batch has no walls inside its arenas")
    kinds = [each.kind for each in robots.sensors]
    if kinds != ["line_of_sight"] or robots.sensors[0].parameters.get("range_m") is not None:
        found.append(f"robots.sensors: expected line_of_sight alone, without range_m, got {', '.join(kinds)}")
    if body.kind != "differential" or body.friction or not body.collide or body.continuous_collision:
        expected = "kind = 'differential', friction = 0, collide = true, continuous_collision = false"
        found.append(f"robots.body: expected {expected}")
    if body.max_speed_m_s / body.wheel_base_m * scenario.time.dt_s > HALF_TURN_MAX_RAD:
        found.append(f"robots.body: expected turns of at most {2 * HALF_TURN_MAX_RAD:g} rad in a tick")
    absent = ("base", "coordinator", "radio", "uplink", "field", "scatter", "random_faults")
    extra = [name for name in absent if getattr(scenario, name) is not None]
    extra += [name for name in ("faults", "landmarks") if getattr(scenario, name)]
    extra += [f"robots.{name}" for name in ("entrance", "clock") if getattr(robots, name) is not None]
    found += [f"{name}: a batch has none" for name in extra]
    cells = scenario.metrics.cells
    if cells is None or cells[0] * cells[1] > min(CELLS_MAX, _COUNTED):
        found.append(f"metrics.cells: expected a grid of at most {CELLS_MAX} cells, got {cells}")
    return found
