"""What a run leaves behind: its outcome, its numbers, and enough of its history to draw it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from zwerm.scenario import Scenario
from zwerm.world.arena import Arena
from zwerm.world.history import History
from zwerm.world.scene import Ints
from zwerm.world.told import Told


@dataclass(slots=True)
class RunResult:
    """The result of one run. `as_json` is what `zwerm run --json` prints."""

    scenario: Scenario
    seed: int
    runner: str
    outcome: str
    reason: str
    trace: str
    ticks: int
    sim_s: float
    wall_s: float
    robots: int
    robot_ticks: int
    metrics: dict[str, float]
    radio: dict[str, Any]
    middleware_lost: int
    crashed: list[int]
    restarted: list[int]
    arena: Arena
    history: History
    cell_counts: Ints | None = None
    hindered: dict[str, list[int]] = field(default_factory=dict)
    faults: list[dict[str, Any]] = field(default_factory=list)
    series: dict[str, list[float]] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)
    tracebacks: dict[int, str] = field(default_factory=dict)
    told: list[Told] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Tell whether the run ended as runs should: completed, or at its time limit."""
        return self.outcome in ("completed", "time-limit")

    def as_json(self) -> dict[str, Any]:
        """Return the stable summary of the run, ready for a JSON encoder."""
        return {
            "scenario": self.scenario.name,
            "seed": self.seed,
            "runner": self.runner,
            "outcome": self.outcome,
            "trace": self.trace,
            "ticks": self.ticks,
            "sim_s": self.sim_s,
            "wall_s": self.wall_s,
            "robots": self.robots,
            "robot_ticks": self.robot_ticks,
            "metrics": self.metrics,
            "radio": self.radio,
            "middleware_lost": self.middleware_lost,
            "nodes": {"crashed": self.crashed, "restarted": self.restarted, **self.hindered},
            "faults": self.faults,
        }

    def picture(self, path: str | Path) -> Path:
        """Draw arena, trails, final robots and coverage as a PNG at `path`, and return the path."""
        from zwerm.world.pictures import draw_run

        return draw_run(
            Path(path),
            self.arena,
            self.history,
            self.scenario.robots.body.radius_m,
            self.title,
            self.metrics,
            coverage_radius_m=self.scenario.metrics.coverage_radius_m,
            cells=self.scenario.metrics.cells,
        )

    def picture_complex(self, path: str | Path, cycle: int = -1) -> Path:
        """Draw the simplicial complex at a cycle (from 0; -1 is the last) at `path`, and return the path."""
        from zwerm.world.pictures_complex import cycles, draw_complex

        return draw_complex(Path(path), self.arena, cycles(self.told)[cycle])

    def animate(self, path: str | Path, progress: Callable[[int, int], None] | None = None) -> Path:
        """Draw the run as an animation at `path`, .gif or .mp4, and return the path."""
        from zwerm.world.pictures import animate_run

        return animate_run(
            Path(path),
            self.arena,
            self.history,
            self.scenario.robots.body.radius_m,
            self.title,
            coverage_radius_m=self.scenario.metrics.coverage_radius_m,
            cells=self.scenario.metrics.cells,
            progress=progress,
        )

    @property
    def title(self) -> str:
        """One line that names the run."""
        return f"{self.scenario.name}, seed {self.seed}: {self.robots} robots, {self.sim_s:g} s"
