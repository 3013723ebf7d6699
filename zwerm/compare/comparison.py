"""Variants of a scenario compared pair by pair: with the same seed, and so the same luck, at every point of the sweeps.

A comparison is a study whose variants are its point. The first variant is what the others are compared with: for each seed
that both have run, the difference of a metric; over all such seeds, its mean and its 95 % interval (Student's, of the
differences). A run that failed counts with what it measured: to leave it out would flatter who fails where it is hard.
What a run never came to (a time to coverage that it did not reach) has no value, and its pair none.
"""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from zwerm.compare.variants import Sweep
from zwerm.errors import ScenarioError
from zwerm.maths.statistics import Sample, condense
from zwerm.scenario.load import built_in
from zwerm.study.plan import Point
from zwerm.study.summary import Results
from zwerm.study.tables import Setting, Study, VariantTable, check_study
from zwerm.study.trial import Row
from zwerm.world.drivers.lockstep import FAILED

# What is compared unless somebody says what: of these, what any run measured and not all as zero.
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

    `base` is a study to take variants, grid, settings, seeds and metrics from, where they are not given here. Raises
    ScenarioError with every mistake.
    """
    tables = base.table.model_dump(exclude={"paper"}, exclude_unset=True) if base else {}
    place = base.path if base else Path("compare")
    # Paths in a study start at its folder; that of the scenario is the user's.
    own = scenario if base is None or scenario in built_in() else str(Path(scenario).absolute())
    tables |= {"name": _name(scenario), "scenario": own, "picture": None}
    tables.setdefault("seeds", SEEDS)
    if variants:
        tables["variants"] = [each.model_dump(exclude_unset=True) for each in variants]
    given = {each.name: each for each in sweeps}
    grid = {name: each.values for name, each in given.items()}
    tables["grid"] = grid | {axis: values for axis, values in tables.get("grid", {}).items() if axis not in grid}
    # A sweep over words that the base has levels for is one over those levels.
    levels = {
        axis: each
        for axis, each in tables.get("levels", {}).items()
        if axis not in given or (not given[axis].levels and all(str(value) in each for value in given[axis].values))
    }
    tables["levels"] = levels | {name: each.levels for name, each in given.items() if each.levels}
    tables["metrics"] = list(metrics or tables.get("metrics", METRICS))
    study = check_study(tables, place)
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
    """What a comparison's trials have come to so far."""

    def __init__(self, results: Results) -> None:
        self.results = results
        self.study = results.study
        self.variants = [variant.name for variant in self.study.variants]
        by_settings: dict[tuple[tuple[str, Setting], ...], list[Point]] = {}
        for point in results.points:
            by_settings.setdefault(tuple(point.settings.items()), []).append(point)
        self.places = [SweepPoint(dict(settings), tuple(points)) for settings, points in by_settings.items()]
        rows = [row for point in results.points for row in results.every_row(point)]
        told = {name for name in self.study.table.metrics if any(_measured(row, name) for row in rows)}
        self.metrics = [name for name in self.study.table.metrics if name in told]
        if self.study.table.metrics == list(METRICS):
            self.metrics = [name for name in self.metrics if any(row.get(name) for row in rows)]
            # In a deployment the base or the coordinator says that all is done, and not every robot for itself.
            if "robots_deployed" in self.metrics and "robots_done_fraction" in self.metrics:
                self.metrics.remove("robots_done_fraction")

    def values(self, point: Point, metric: str) -> dict[int, float]:
        """Return a metric of a point's runs by seed, of those that have one; every run is `completed` or not."""
        if metric == COMPLETED:
            return {row["seed"]: float(row["outcome"] == COMPLETED) for row in self.results.every_row(point)}
        return {row["seed"]: row[metric] for row in self.results.every_row(point) if _measured(row, metric)}

    def sample(self, point: Point, metric: str) -> Sample:
        """Return a metric of a point, condensed."""
        return condense(list(self.values(point, metric).values()))

    def difference(self, place: SweepPoint, point: Point, metric: str) -> Sample:
        """Return what a metric of a point has over the first variant's there, seed by seed, condensed."""
        ours, theirs = self.values(point, metric), self.values(place.points[0], metric)
        return condense([_less(ours[seed], theirs[seed]) for seed in sorted(ours) if seed in theirs])

    def outcomes(self, point: Point) -> Counter[str]:
        """Return how a point's runs ended, failed ones by their reason."""
        return Counter(_ending(row) for row in self.results.every_row(point))

    def seeds(self, point: Point) -> list[int]:
        """Return the seeds that a point was run with."""
        return [row["seed"] for row in self.results.every_row(point)]


def _less(one: float, other: float) -> float:
    """Return one number less another; nothing where they differ by no more than the last digits of a computation."""
    return 0.0 if math.isclose(one, other, rel_tol=1e-9) else one - other


def _measured(row: Row, metric: str) -> bool:
    return metric in row and not math.isnan(row[metric])


def _ending(row: Row) -> str:
    """Return how a run ended, in words that are the same for runs that failed alike."""
    outcome, reason = str(row["outcome"]), str(row.get("reason", ""))
    if outcome != FAILED:
        return outcome
    gave_up = _GAVE_UP.search(reason)
    alike = gave_up[1] if gave_up else re.sub(r"\d+", "N", reason)
    return f"failed ({alike[:_REASON_LENGTH_MAX]})"
