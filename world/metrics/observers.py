"""The metrics of one run: their classes, the times of their samples, and their values."""

from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from typing import Any, Final

from zwerm.catalogue import ALGORITHMS, METRICS, Algorithm, algorithm_of
from zwerm.errors import ScenarioError
from zwerm.scenario.plugin_names import class_named
from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.fields import Field
from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.metrics.own import own_metric
from zwerm.world.tick.telemetry import TelemetrySink

# Metrics of every run, independent of the scenario, and those of a radio or an uplink.
ENGINE_NAMES: Final = (
    *("robots_in_arena", "robots_exited", "faults_missed", "refused_messages"),
    *("late_commands", "deadman_stops", "tick_overruns", "telemetry_dropped"),
)
RADIO_NAMES: Final = (
    *("robots_done_fraction", "delivered_fraction", "out_of_reach_fraction"),
    *("messages_per_robot_*", "bytes_per_robot_*", "information_age_*"),
)
TELEMETRY_NAMES: Final = "telemetry.*"

# A longer period, in ticks, samples the beginning and the end only.
STRIDE_MAX: Final = 1e15


class Observers:
    """Metrics of one run. They take samples every `every_s` of virtual time, and at the end.

    If `every_s` is None, all observers that sample during a run use the shortest period that one of them needs.
    """

    def __init__(self, metrics: Sequence[Metric] = (), every_s: float | None = None, dt_s: float = 1.0) -> None:
        self._metrics = tuple(metrics)
        self._periodic = tuple(each for each in metrics if every_s is not None or each.every_s is not None)
        period_s = every_s or min((each.every_s for each in self._periodic if each.every_s is not None), default=1.0)
        self._stride = max(1, round(min(period_s / dt_s, STRIDE_MAX)))
        self._last_tick = -1
        self._time_s: list[float] = []

    @property
    def names(self) -> list[str]:
        """The names of all metrics, where `*` stands for any characters."""
        return [name for metric in self._metrics for name in metric.names]

    def subscribe(self, telemetry: TelemetrySink) -> None:
        """Give every metric that has a method `report` each telemetry record as it comes."""
        telemetry.listeners += [each.report for each in self._metrics if hasattr(each, "report")]

    def is_due(self, tick: int) -> bool:
        """Return whether a sample is due at a tick and has not been taken."""
        return bool(self._periodic) and tick % self._stride == 0 and tick != self._last_tick

    def sample(self, truth: Truth) -> None:
        """Have the metrics that sample during a run take a sample."""
        self._last_tick = truth.scene.tick
        self._time_s.append(truth.time_s)
        for metric in self._periodic:
            metric.sample(truth)

    def finish(self, truth: Truth) -> dict[str, float]:
        """Have every metric take its last sample, and return all metrics by name."""
        for metric in self._metrics:
            if metric not in self._periodic:
                metric.sample(truth)
        if self._periodic and truth.scene.tick != self._last_tick:
            self.sample(truth)
        return {name: value for metric in self._metrics for name, value in metric.metrics().items()}

    def newest(self) -> dict[str, float]:
        """Return the newest value of every series."""
        return {name: values[-1] for metric in self._periodic for name, values in metric.series().items()}

    def series(self) -> dict[str, list[float]]:
        """Return every series, and the times of the samples as `time_s` [s]; nothing where there is no series."""
        found = {name: values for metric in self._periodic for name, values in metric.series().items()}
        return {"time_s": self._time_s, **found} if found else {}


def make_observers(scenario: Scenario, arena: Arena, field: Field | None) -> Observers:
    """Return the metrics that a scenario switches on: by key of `[metrics]`, by algorithm, and its user's own.

    Raises ScenarioError with every mistake, each `metrics.<key>: rule`.
    """
    context = MetricContext(arena, field, scenario.time.dt_s, scenario)
    metrics: list[Metric] = []
    mistakes: list[str] = []
    for kind, parameters in _asked_for(scenario):
        try:
            metrics.append(class_named(kind, "metric", METRICS)(parameters, context))
        except ScenarioError as error:
            mistakes += error.mistakes
    known = [*ENGINE_NAMES, *RADIO_NAMES, TELEMETRY_NAMES, *_catalogue_names()] if scenario.metrics.own else []
    for index, name in enumerate(scenario.metrics.own):
        try:
            metric = own_metric(name, context)
            _refuse_taken(metric.names, known)
            known += metric.names
            metrics.append(metric)
        except ValueError as error:
            mistakes.append(f"metrics.own.{index}: {error}")
        except ScenarioError as error:
            mistakes += [f"metrics.own.{index}: {line}" for line in error.mistakes]
    if mistakes:
        raise ScenarioError(mistakes)
    return Observers(metrics, scenario.metrics.every_s, scenario.time.dt_s)


def is_measured(name: str, names: Sequence[str]) -> bool:
    """Return whether one of `names`, where `*` stands for any characters, is that of a metric."""
    return any(fnmatchcase(name, each) for each in names)


def algorithms(scenario: Scenario) -> list[Algorithm]:
    """Return the rows of the catalogue whose controllers a scenario uses, each once."""
    tables = (scenario.robots, scenario.base, scenario.coordinator)
    rows = [algorithm_of(table.controller) for table in tables if table is not None]
    return list({row.name: row for row in rows if row is not None}.values())


def _asked_for(scenario: Scenario) -> Iterator[tuple[str, Any]]:
    """Yield every metric class of the catalogue that a scenario switches on, as `module:Class`, and its parameters."""
    for key, path in METRICS.items():
        parameters = getattr(scenario.metrics, key)
        if class_named(path, "metric", METRICS).Parameters is None:  # the key is a switch
            if parameters:
                yield path, None
        elif parameters is not None:
            yield path, parameters
    for row in algorithms(scenario):
        yield from ((path, None) for path in row.metrics)


def _catalogue_names() -> list[str]:
    paths = [*METRICS.values(), *(path for row in ALGORITHMS for path in row.metrics)]
    return [name for path in paths for name in class_named(path, "metric", METRICS).names]


def _refuse_taken(names: Iterable[str], known: Sequence[str]) -> None:
    for name in names:
        if is_measured(name, known):
            raise ValueError(f"expected a name that no other metric has, got {name!r}")
