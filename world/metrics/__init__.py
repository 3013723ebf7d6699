"""Metrics: measurements of a run that change nothing in it. The trace is the same with and without them.

A metric is one class, a subclass of `Metric`, and one row of the catalogue. A row of `METRICS` is switched on by its
key of `[metrics]` in the scenario; the key's value holds the parameters. A row of `Algorithm.metrics` is measured in
every run of the algorithm's controllers. A scenario adds a class or a function of the user's own by `[metrics] own =
["module:name"]`.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.fields import Field
from zwerm.world.scene import Scene
from zwerm.world.tick.telemetry import TelemetrySink


@dataclass(frozen=True, slots=True, eq=False)
class MetricContext:
    """The data of a run that a metric may use before the run starts. `field` is None where the scenario has none."""

    arena: Arena
    field: Field | None
    dt_s: float
    scenario: Scenario

    @property
    def coordinator(self) -> int | None:
        """The id of the coordinator's node, or None."""
        return None if self.scenario.coordinator is None else self.scenario.robots.count

    @property
    def stations(self) -> range:
        """The ids of the base stations."""
        return range(0 if self.scenario.base is None else self.scenario.base.stations)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The true state of a run at one tick, as a metric sees it. Nothing in it may be changed.

    `dead` are the nodes that are down for good, ascending; `completed`: the task is done; `messages` is the number of radio
    transmissions of all nodes so far.
    """

    scene: Scene  # the robots at this tick
    dead: Sequence[int] = ()
    completed: bool = False
    telemetry: TelemetrySink = field(default_factory=TelemetrySink)  # the reports of nodes
    messages: int = 0

    @property
    def time_s(self) -> float:
        """Virtual time [s]."""
        return self.scene.time_s


class Metric:
    """A group of metrics over one run. Derive from this class and override what the metric needs.

    `names` are the names of its metrics, units last; `*` in a name stands for any characters. In the catalogue it is a mapping
    from each name to what it means, for the reference. `every_s` is the sampling period [s] where the scenario does not give
    `metrics.every_s`; None samples at the end only. `Parameters` is the pydantic type of its key's value in `[metrics]`; with
    None the key is a switch, true or false. A method `report(record)`, if there is one, gets every TelemetryRecord as it
    comes.
    """

    names: ClassVar[Collection[str]] = ()
    every_s: ClassVar[float | None] = None
    Parameters: ClassVar[Any] = None

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        """Prepare for one run. Raises ScenarioError, `metrics.<key>: rule`, where the scenario lacks what it needs."""

    def sample(self, truth: Truth) -> None:
        """Take a sample: at tick 0 and every `every_s` where that is not None, and always at the end."""

    def metrics(self) -> dict[str, float]:
        """Return the metrics by name, after the last sample. nan stands for an event that did not happen."""
        return {}

    def series(self) -> dict[str, list[float]]:
        """Return the series by name: one value for each sample. Called only where `every_s` applies."""
        return {}
