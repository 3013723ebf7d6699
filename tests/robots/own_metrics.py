"""Metrics of a user's own, sound and unsound, for tests of `[metrics] own`."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.tick.telemetry import TelemetryRecord

number = 3.0


def order_parameter(truth: Truth) -> float:
    """Return how far the robots agree in their headings, from 0 to 1."""
    heading = truth.scene.heading[truth.scene.present]
    return float(np.hypot(np.cos(heading).mean(), np.sin(heading).mean()))


def newest_tick(truth: Truth) -> float:
    """Return the newest tick that robot 2 reported."""
    return truth.telemetry.newest.get(2, {}).get("tick", -1.0)


def divides(truth: Truth) -> float:
    """Raise at every tick but the first."""
    return 1.0 / (truth.scene.tick == 0)


def two(truth: Truth, other: Truth) -> float:
    """Take two arguments."""
    return 0.0


def robots_in_arena(truth: Truth) -> float:
    """Be called as a metric of the world's is."""
    return 1e6


class Reports(Metric):
    """The number of records, and the distance that robots have gone [m]."""

    names: ClassVar[Sequence[str]] = ("records", "gone_m")
    every_s: ClassVar[float | None] = 0.5

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        self.records = 0
        self.gone_m: list[float] = []
        self.start: Any = None

    def report(self, record: TelemetryRecord) -> None:
        self.records += 1

    def sample(self, truth: Truth) -> None:
        if self.start is None:
            self.start = truth.scene.position
        self.gone_m.append(float(np.hypot(*(truth.scene.position - self.start).T).mean()))

    def metrics(self) -> dict[str, float]:
        return {"records": float(self.records), "gone_m": self.gone_m[-1]}

    def series(self) -> dict[str, list[float]]:
        return {"gone_m": self.gone_m}


class Nameless(Metric):
    """Lacks names."""

    def sample(self, truth: Truth) -> None:
        pass
