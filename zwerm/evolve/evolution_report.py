"""Progress of an evolution on the terminal, its result as a table, as JSON and as a figure, and the study of its best."""

from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from zwerm.evolve.evolution import EvolutionResult, EvolutionSettings
from zwerm.scenario.load import built_in
from zwerm.scenario.tables import Scenario
from zwerm.scenario.toml import write_toml

_ESTIMATE_S: Final = 600.0
_STUDY_SEEDS: Final = 1000
_DPI: Final = 150


class EvolutionProgress:
    """Progress on `console`: generations of all runs done and remaining, and the best fitness. Shows nothing if `quiet`."""

    def __init__(self, console: Console, name: str, quiet: bool = False) -> None:
        self._progress = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            TextColumn("generations{task.fields[best]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            speed_estimate_period=_ESTIMATE_S,
            disable=quiet,
        )
        self._name = name
        self._best = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._progress.live.is_started:
            self._progress.stop()

    def begin(self, total: int, done: int) -> None:
        """Start the progress bar."""
        self._progress.start()
        self._task = self._progress.add_task(self._name, total=total, completed=done, best="")

    def generation(self, run: int, best: float) -> None:
        """Count an ended generation."""
        self._best = max(self._best, best)
        self._progress.update(self._task, advance=1, best=f", best fitness {self._best:.3f}")


def print_evolution(console: Console, result: EvolutionResult) -> None:
    """Print the fitness of the runs and the best controller."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("runs", "final fitness", "least", "best", "of run"):
        table.add_column(heading, justify="right")
    finals = np.array(result.finals)
    row = (finals.mean(), finals.min(), result.best_fitness)
    table.add_row(str(len(finals)), *(f"{each:.4f}" for each in row), str(result.run))
    console.print(table)
    console.print("best parameters:", highlight=False)
    for name, value in result.parameters.items():
        console.print(f"  {name} = {value!r}", markup=False, highlight=False)


def evolution_json(result: EvolutionResult, settings: EvolutionSettings, files: list[Path]) -> dict[str, Any]:
    """Return the result as one JSON object."""
    return {"settings": asdict(settings), **asdict(result), "files": [str(each) for each in files]}


def write_study(path: Path, scenario: Scenario, result: EvolutionResult) -> Path:
    """Write the study that runs the best controller beside the scenario's own, each with 1,000 seeds, and return its path."""
    name = scenario.place if scenario.name not in built_in() else scenario.name
    metrics = ["cell_coverage_fraction"]
    if scenario.metrics.coverage_radius_m is not None:
        metrics.append("area_coverage_fraction")
    settings = [f"robots.parameters.{key}={value!r}" for key, value in result.parameters.items()]
    study = {
        "name": path.stem,
        "summary": f"The best evolved controller of {scenario.name}, beside the scenario's own",
        "scenario": name if scenario.name in built_in() else str(Path(name).resolve()),
        "set": list(scenario.overrides),
        "seeds": _STUDY_SEEDS,
        "metrics": metrics,
        "variants": [{"name": "evolved", "set": settings}, {"name": "own"}],
    }
    path.write_text(write_toml(study), encoding="utf-8")
    return path


def draw_evolution(path: Path, scenario: Scenario, result: EvolutionResult) -> Path:
    """Draw the mean fitness of each run by generation, the figure of Ozdemir 2019, Fig. 2, and return its path."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for number, run in enumerate(result.fitness, 1):
        best = number == result.run
        axes.plot(range(1, len(run) + 1), run, linewidth=1.8 if best else 0.7, color="C0" if best else "0.6")
    axes.set_xlabel("generation")
    axes.set_ylabel("mean fitness of the candidates")
    axes.set_title(f"{scenario.name}: {len(result.fitness)} runs", fontsize="medium")
    figure.savefig(path, dpi=_DPI)
    return path
