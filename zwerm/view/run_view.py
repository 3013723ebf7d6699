"""The parts of a run's result that pictures are drawn from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from zwerm.record.history import History
from zwerm.world.arena.arena import Arena
from zwerm.world.tick.telemetry import TelemetryArrays, TelemetryRecord


@dataclass(frozen=True)
class RunView:
    """The drawable part of one run: `name` is its scenario and seed, `ending` says how it ended.

    `cells` is (columns, rows); `snapshots` and `series` are those of the run's result; `coordinator` is the id of its node.
    `landmarks` are places [m]. `layers` are classes of picture layers, as `module:Class`, drawn in this order over the arena.
    `colour_by` names the telemetry that colours robots. `links` are pairs of robots to connect.
    """

    arena: Arena
    history: History
    radius_m: float
    name: str
    ending: str = ""
    coverage_radius_m: float | None = None
    cells: tuple[int, int] | None = None
    sight_range_m: float | None = None
    bases: int = 0
    snapshots: Sequence[TelemetryRecord] = ()
    series: Mapping[str, Sequence[float]] = field(default_factory=dict)
    layers: Sequence[str] = ()
    coordinator: int | None = None
    landmarks: Sequence[tuple[float, float]] = ()
    telemetry: TelemetryArrays = field(default_factory=TelemetryArrays.empty)
    colour_by: str = ""
    links: Sequence[tuple[int, int]] = ()

    @property
    def title(self) -> str:
        """One line that names the run."""
        return f"{self.name}: {self.ending}" if self.ending else self.name
