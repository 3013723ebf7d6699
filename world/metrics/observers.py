"""Meters: what is measured all through a run, beside what `metrics` says of its end.

A group of metrics is switched on by its table in the scenario's `[metrics]`. A meter looks at the truth and changes nothing:
the trace of a run is the same with and without it.
"""

from collections.abc import Sequence
from typing import Protocol

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import MetricsTable
from zwerm.world.arena.arena import Arena
from zwerm.world.fields import Field
from zwerm.world.metrics.sight_growth import SightObserver
from zwerm.world.metrics.voronoi_coverage import VoronoiCoverageObserver
from zwerm.world.scene import Scene


class Observer(Protocol):
    """One group of metrics, over one run."""

    @property
    def every_s(self) -> float:
        """How often it looks where the scenario does not say [s]."""

    def look(self, scene: Scene, dead: Sequence[int]) -> None:
        """Take note of a scene, and of who is dead."""

    def metrics(self) -> dict[str, float]:
        """Return the metrics by name, after the last scene was looked at; nan is for what did not come to pass."""

    def series(self) -> dict[str, list[float]]:
        """Return what was noted, by name: one value for each look."""


class Observers:
    """The meters of one run, and when they look: every `every_s` of virtual time, and at the end.

    Where that is not given, all look as often as the one that needs to most.
    """

    def __init__(self, meters: Sequence[Observer] = (), every_s: float | None = None, dt_s: float = 1.0) -> None:
        self._meters = tuple(meters)
        every_s = every_s or min((meter.every_s for meter in meters), default=1.0)
        self._stride = max(1, round(every_s / dt_s))
        self._last_tick = -1
        self._time_s: list[float] = []

    def look(self, scene: Scene, dead: Sequence[int] = (), now: bool = False) -> bool:
        """Have the meters look, if it is time to or `now` is true, and they have not yet; tell whether they have."""
        if not self._meters or scene.tick == self._last_tick or (scene.tick % self._stride and not now):
            return False
        self._last_tick = scene.tick
        self._time_s.append(scene.time_s)
        for meter in self._meters:
            meter.look(scene, dead)
        return True

    def metrics(self) -> dict[str, float]:
        """Return every meter's metrics."""
        return {name: value for meter in self._meters for name, value in meter.metrics().items()}

    def newest(self) -> dict[str, float]:
        """Return the newest value of every series."""
        return {name: values[-1] for meter in self._meters for name, values in meter.series().items()}

    def series(self) -> dict[str, list[float]]:
        """Return every meter's series, and the times [s] they are of as `time_s`; nothing where there is no meter."""
        found = {name: values for meter in self._meters for name, values in meter.series().items()}
        return {"time_s": self._time_s, **found} if found else {}


def make_meters(table: MetricsTable, arena: Arena, field: Field | None, dt_s: float) -> Observers:
    """Return the meters that `table` switches on.

    Raises ScenarioError where the arena or the field lacks what one needs.
    """
    meters: list[Observer] = []
    if table.voronoi is not None:
        if not arena.is_convex:
            raise ScenarioError(["metrics.voronoi: needs a convex arena without obstacles and walls"])
        if field is None:
            raise ScenarioError(["metrics.voronoi: needs a field, and the scenario has none"])
        meters.append(VoronoiCoverageObserver(table.voronoi, arena, field))
    if table.sight_range_m is not None:
        meters.append(SightObserver(arena, table.sight_range_m))
    return Observers(meters, table.every_s, dt_s)
