"""Paired comparison of a scenario's variants: same seeds and same random draws at each point of the sweeps.

A comparison is a study with at least two variants. The first variant is the reference. For each seed that both variants
ran, the comparison takes the difference of a metric. Over these seeds it gives the mean and its 95 % interval
(Student's t). A failed run counts with its measured values: leaving it out would favour a variant that fails in hard
cases. A metric without a value (a time to a coverage that a run did not reach) gives no difference for that seed.
"""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from zwerm.compare.variants import Sweep
from zwerm.errors import ScenarioError
from zwerm.maths.statistics import Sample, condense
from zwerm.scenario.load import built_in
from zwerm.study.study_tables import Setting, Study, VariantTable, check_study
from zwerm.study.summary import Results
from zwerm.study.trial import Row
from zwerm.study.trial_plan import Point
from zwerm.world.tick.completion import FAILED

# Default metrics to compare: those of them that a run measured, unless all values are zero.
METRICS: Final = (
    *("coverage_fraction", "cell_coverage_fraction", "area_coverage_fraction", "coverage_cost", "mean_error_m"),
    *("robots_deployed", "deployment_cycles", "robots_done_fraction"),
    *("messages_per_robot_mean", "bytes_per_robot_mean", "delivered_fraction"),
    *("time_to_50_percent_coverage_s", "time_to_90_percent_coverage_s", "time_to_99_percent_coverage_s"),
    *("convergence_time_s", "sim_s", "faults_missed"),
)
COMPLETED: Final = "completed"
SEEDS: Final = 10
_GAVE_UP: Final = re.compile(r"gave up: ([^:,]+)")
_REASON_LENGTH_MAX: Final = 40


def make_comparison(
    scenario: str,
    variants: Sequence[VariantTable] = (),
    sweeps: Sequence[Sweep] = (),
    metrics: Sequence[str] = (),
    base: Study | None = None,
) -> Study:
    """Return the study that compares `variants` of a scenario over `sweeps`, in this order.

    Variants, grid, settings, seeds and metrics that are not given come from the study `base`. Raises ScenarioError with
    every error.
    """
    tables = base.table.model_dump(exclude={"paper"}, exclude_unset=True) if base else {}
    place = base.path if base else Path("compare")
    # Paths in a study start at its folder; the scenario's path starts at the current folder.
    own = scenario if base is None or scenario in built_in() else str(Path(scenario).absolute())
    tables |= {"name": _name(scenario), "scenario": own, "picture": None}
    tables.setdefault("seeds", SEEDS)
    if variants:
        tables["variants"] = [each.model_dump(exclude_unset=True) for each in variants]
    given = {each.name: each for each in sweeps}
    grid = {name: each.values for name, each in given.items()}
    tables["grid"] = grid | {axis: values for axis, values in tables.get("grid", {}).items() if axis not in grid}
    # If the base study has levels for all values of a sweep, the sweep is over these levels.
    levels = {
        axis: each
        for axis, each in tables.get("levels", {}).items()
        if axis not in given or (not given[axis].levels and all(str(value) in each for value in given[axis].values))
    }
    tables["levels"] = levels | {name: each.levels for name, each in given.items() if each.levels}
    chosen = bool(metrics) or "metrics" in tables
    tables["metrics"] = list(metrics or tables.get("metrics", METRICS))
    study = replace(check_study(tables, place), lenient=not chosen)
    if len(study.variants) < 2:
        raise ScenarioError([f"{place}: variants: expected 2 at least to compare, got {len(study.table.variants)}"])
    return study


def _name(scenario: str) -> str:
    return "compare-" + (re.sub(r"[^a-z0-9]+", "-", Path(scenario).stem.lower()).strip("-") or "scenario")


@dataclass(frozen=True)
class SweepPoint:
    """One point of the sweeps: every variant's point there, the first variant's first."""

    settings: Mapping[str, Setting]
    points: tuple[Point, ...]


class Comparison:
    """The results of a comparison so far."""

    def __init__(self, results: Results) -> None:
        self.results = results
        self.study = results.study
        self.variants = [variant.name for variant in self.study.variants]
        by_settings: dict[tuple[tuple[str, Setting], ...], list[Point]] = {}
        for point in results.points:
            by_settings.setdefault(tuple(point.settings.items()), []).append(point)
        self.places = [SweepPoint(dict(settings), tuple(points)) for settings, points in by_settings.items()]
        rows = [row for point in results.points for row in results.every_row(point)]
        measured = {name for name in self.study.table.metrics if any(_measured(row, name) for row in rows)}
        self.metrics = [name for name in self.study.table.metrics if name in measured]
        if self.study.table.metrics == list(METRICS):
            self.metrics = [name for name in self.metrics if any(row.get(name) for row in rows)]
            # In a deployment the base or the coordinator ends the run, and robots do not report that they are done.
            if "robots_deployed" in self.metrics and "robots_done_fraction" in self.metrics:
                self.metrics.remove("robots_done_fraction")

    def values(self, point: Point, metric: str) -> dict[int, float]:
        """Return a metric of a point's runs by seed, if measured. The metric `completed` is 1 or 0 for each run."""
        if metric == COMPLETED:
            return {row["seed"]: float(row["outcome"] == COMPLETED) for row in self.results.every_row(point)}
        return {row["seed"]: row[metric] for row in self.results.every_row(point) if _measured(row, metric)}

    def sample(self, point: Point, metric: str) -> Sample:
        """Return the statistics of a metric at a point."""
        return condense(list(self.values(point, metric).values()))

    def difference(self, place: SweepPoint, point: Point, metric: str) -> Sample:
        """Return the statistics of a metric minus the first variant's, seed by seed, at a point."""
        values, reference = self.values(point, metric), self.values(place.points[0], metric)
        return condense([_difference(values[seed], reference[seed]) for seed in sorted(values) if seed in reference])

    def outcomes(self, point: Point) -> Counter[str]:
        """Return the number of a point's runs by outcome; failed runs by reason."""
        return Counter(_ending(row) for row in self.results.every_row(point))

    def seeds(self, point: Point) -> list[int]:
        """Return the seeds of a point's runs."""
        return [row["seed"] for row in self.results.every_row(point)]


def _difference(one: float, other: float) -> float:
    """Return `one - other`, or 0 if they differ by rounding errors only."""
    return 0.0 if math.isclose(one, other, rel_tol=1e-9) else one - other


def _measured(row: Row, metric: str) -> bool:
    return metric in row and not math.isnan(row[metric])


def _ending(row: Row) -> str:
    """Return the outcome of a run, with a failure's reason without numbers, so that equal failures are counted together."""
    outcome, reason = str(row["outcome"]), str(row.get("reason", ""))
    if outcome != FAILED:
        return outcome
    gave_up = _GAVE_UP.search(reason)
    alike = gave_up[1] if gave_up else re.sub(r"\d+", "N", reason)
    return f"failed ({alike[:_REASON_LENGTH_MAX]})"
