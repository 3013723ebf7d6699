"""The trials of a study: each variant at each point of the grid with each seed. All scenarios are checked first.

The fingerprint of a point depends on all inputs of its trials except the seed; `trial_identity` says which.
"""

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass, field

from zwerm.errors import ScenarioError
from zwerm.run.assembly import prepare
from zwerm.run.measurement import metric_names
from zwerm.run.runner import Runner
from zwerm.scenario.load import built_in as built_in_scenarios
from zwerm.scenario.load import load
from zwerm.scenario.nearest import did_you_mean
from zwerm.scenario.tables import Scenario
from zwerm.scenario.user_modules import UserModules
from zwerm.study.study_tables import CELL_METRICS, REPORTABLE_COLUMNS, Setting, Study, VariantTable
from zwerm.study.trial_identity import Identities
from zwerm.world.metrics.observers import is_measured


@dataclass(frozen=True)
class Point:
    """One variant at one point of the grid, with its checked scenario."""

    variant: str
    settings: dict[str, Setting]
    scenario: Scenario
    fingerprint: str
    metrics: tuple[str, ...] = ()  # names of its metrics, where `*` stands for any characters
    modules: UserModules = field(default_factory=UserModules)

    @property
    def label(self) -> str:
        """The variant and the settings as text."""
        return label(self.variant, self.settings)


@dataclass(frozen=True)
class Trial:
    """One run of a study."""

    study: str
    point: Point
    seed: int
    series: tuple[str, ...] = ()
    runner: Runner = "inline"

    @property
    def key(self) -> tuple[str, str, int]:
        """Identity of the trial in any results file: variant, fingerprint, seed."""
        return self.point.variant, self.point.fingerprint, self.seed


def label(variant: str, settings: dict[str, Setting]) -> str:
    """Return `variant, axis=value, ...`."""
    return ", ".join([*([variant] if variant else []), *(f"{axis}={value}" for axis, value in settings.items())])


def make_points(study: Study, sets: Sequence[str] = (), runner: Runner = "inline") -> list[Point]:
    """Return the points of `study`, by variant and then in the order of the grid; `sets` override the file's settings.

    Raises ScenarioError with every mistake at every point, each mistake once.
    """
    points: list[Point] = []
    found: dict[str, str] = {}
    identities = Identities()
    for variant in study.variants:
        for values in itertools.product(*study.table.grid.values()):
            settings = dict(zip(study.table.grid, values, strict=True))
            try:
                points.append(_make_point(study, variant, settings, sets, identities, runner))
            except ScenarioError as error:
                where = label(variant.name, settings)
                for line in error.mistakes:
                    found.setdefault(line, f"{study.path}: {where}: {line}" if where else f"{study.path}: {line}")
    if not found and not study.lenient:
        found = _unmeasured(study, points)
    if found:
        raise ScenarioError(list(found.values()))
    return points


def _unmeasured(study: Study, points: Sequence[Point]) -> dict[str, str]:
    """Return one line for every metric of a study that no scenario of it measures."""
    names = list(dict.fromkeys(name for point in points for name in point.metrics))
    known = [
        *names,
        *REPORTABLE_COLUMNS,
        *(CELL_METRICS if any(point.scenario.metrics.cells for point in points) else ()),
    ]
    listed = ", ".join(sorted(known))
    return {
        metric: f"{study.path}: metrics: expected names of metrics that its scenarios measure ({listed}), "
        f"got {metric!r}{did_you_mean(metric, known)}"
        for metric in study.table.metrics
        if not is_measured(metric, known)
    }


def make_trials(study: Study, points: Sequence[Point], seeds: Sequence[int], runner: Runner = "inline") -> list[Trial]:
    """Return the trials by seed and then by point, so that an interrupted study has results for every point."""
    series = tuple(study.table.series)
    return [Trial(study.name, point, seed, series, runner) for seed in seeds for point in points]


def _make_point(
    study: Study,
    variant: VariantTable,
    settings: dict[str, Setting],
    sets: Sequence[str],
    identities: Identities,
    runner: Runner,
) -> Point:
    name = variant.scenario or study.table.scenario or ""
    beside = study.path.parent / name
    if name not in built_in_scenarios() and beside.is_file():
        name = str(beside)
    axes = [each for axis, value in settings.items() for each in _assignments(study, variant, axis, value)]
    scenario = load(name, (*study.table.set, *variant.set, *sets, *axes), tuple(sets))
    prepared = prepare(scenario)
    modules = identities.modules(scenario, runner)
    fingerprint = identities.fingerprint(scenario, prepared.arena.segments.tobytes(), modules)
    metrics = tuple(metric_names(scenario, prepared.observers))
    return Point(variant.name, settings, scenario, fingerprint, metrics, modules)


def _assignments(study: Study, variant: VariantTable, axis: str, value: Setting) -> list[str]:
    """Return the settings, `PATH=VALUE`, of a value of an axis in a variant."""
    if axis in study.table.levels:
        return study.table.levels[axis][str(value)]
    return [f"{path}={json.dumps(value)}" for path in variant.axes.get(axis, axis).split("+")]
