"""Metrics of the user's own: a class, or a function of the truth, named `module:name` in `[metrics] own`."""

import inspect
import traceback
from collections.abc import Callable, Collection
from typing import Any, ClassVar

from zwerm.errors import ScenarioError
from zwerm.scenario.plugin_names import object_named
from zwerm.wire.telemetry_rules import is_telemetry_name
from zwerm.world.metrics import Metric, MetricContext, Truth


class FunctionMetric(Metric):
    """A function `f(truth) -> number`; its name is the metric's name. The metric is its value at the end."""

    names: ClassVar[Collection[str]] = ()
    every_s: ClassVar[float | None] = 1.0

    def __init__(self, parameters: Callable[[Truth], Any], context: MetricContext) -> None:
        self._function = parameters
        self._name = parameters.__name__
        self.names = (self._name,)  # type: ignore[misc]
        self._values: list[float] = []

    def sample(self, truth: Truth) -> None:
        """Call the function. Raises ScenarioError, in one line, where it raises or returns no number."""
        try:
            self._values.append(float(self._function(truth)))
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{last.filename}:{last.lineno}"
            reason = f"{type(error).__name__}: {error} ({where})"
            raise ScenarioError([f"metrics.own: {self._name} at tick {truth.scene.tick}: {reason}"]) from error

    def metrics(self) -> dict[str, float]:
        """Return the newest value."""
        return {self._name: self._values[-1]} if self._values else {}

    def series(self) -> dict[str, list[float]]:
        """Return the value at every sample."""
        return {self._name: self._values}


def own_metric(name: str, context: MetricContext) -> Metric:
    """Return the metric that `module:name` names.

    Raises ValueError, in one line, for a name that is neither a metric class nor a function of one argument. It raises
    it for bad names of metrics, too. Raises ScenarioError if the class refuses the scenario.
    """
    found = object_named(name, "metric")
    if isinstance(found, type):
        if not issubclass(found, Metric) or not isinstance(found.names, list | tuple | dict) or not found.names:
            raise ValueError(f"expected a subclass of zwerm.Metric that declares its `names`, got {name!r}")
        metric: Metric = found(None, context)
    elif callable(found) and hasattr(found, "__name__"):
        try:
            inspect.signature(found).bind(None)
        except (TypeError, ValueError):
            raise ValueError(f"expected a function of one argument, the truth, got {name!r}") from None
        metric = FunctionMetric(found, context)
    else:
        raise ValueError(f"expected a metric class or a function, got {name!r}")
    for each in metric.names:
        if not is_telemetry_name(str(each).replace("*", "x")):
            raise ValueError(f"expected metric names of [a-z][a-z0-9_]*, got {each!r}")
    return metric
