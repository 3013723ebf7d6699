"""Metrics of agreement, from the robots' telemetry: the spread of their values, and the number of leaders."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from zwerm.maths.sums import added
from zwerm.world.metrics import Metric, MetricContext, Truth


class Spread(Metric):
    """The greatest difference between the newest values of two robots that are not down for good."""

    names: ClassVar[Mapping[str, str]] = {
        "value_spread": "greatest difference between two robots' newest values, where robots report `value`",
    }
    every_s: ClassVar[float | None] = 0.1

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        self._spread: list[float] = []

    def sample(self, truth: Truth) -> None:
        """Compare the newest values."""
        values = _newest(truth, "value")
        self._spread.append(max(values) - min(values) if values else float("nan"))

    def metrics(self) -> dict[str, float]:
        """Return the spread at the end; nothing where no robot reports a value."""
        return {} if math.isnan(self._spread[-1]) else {"value_spread": self._spread[-1]}

    def series(self) -> dict[str, list[float]]:
        """Return the spread over time."""
        return {"value_spread": self._spread}


class Leaders(Metric):
    """The time in which no robot led, and the time in which more than one did. The second violates the guarantee of a
    lease."""

    names: ClassVar[Mapping[str, str]] = {
        "leaders_max": "greatest number of robots that led at the same time, where robots report `leader`",
        "leaderless_s": "time without a leader",
        "two_leaders_s": "time with more than one",
    }
    every_s: ClassVar[float | None] = 0.1

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        self._leaders: list[int] = []
        self._reported = False
        self._last_s = 0.0
        self._seconds = {0: 0.0, 2: 0.0}

    def sample(self, truth: Truth) -> None:
        """Count the robots that report to lead; the count holds since the sample before."""
        reports = _newest(truth, "leader")
        self._reported = self._reported or bool(reports)
        leaders = round(added(reports))
        elapsed_s, self._last_s = truth.time_s - self._last_s, truth.time_s
        if leaders != 1:
            self._seconds[min(leaders, 2)] += elapsed_s
        self._leaders.append(leaders)

    def metrics(self) -> dict[str, float]:
        """Return the greatest number of leaders, and the durations [s]; nothing where no robot reports whether it leads."""
        if not self._reported:
            return {}
        return {
            "leaders_max": float(max(self._leaders)),
            "leaderless_s": self._seconds[0],
            "two_leaders_s": self._seconds[2],
        }

    def series(self) -> dict[str, list[float]]:
        """Return the number of leaders over time."""
        return {"leaders": [float(each) for each in self._leaders]}


def _newest(truth: Truth, name: str) -> list[float]:
    """Return the newest value of each node that has reported it and is not down for good."""
    reports = truth.telemetry.newest.items()
    return [numbers[name] for node, numbers in sorted(reports) if name in numbers and node not in truth.dead]
