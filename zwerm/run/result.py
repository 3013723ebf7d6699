"""The result of a run: its outcome, its numbers, and enough of its history to draw it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from zwerm.catalogue import PICTURE_LAYERS, layers_of
from zwerm.record.history import History
from zwerm.run.frames import FrameKind, frame_of
from zwerm.run.positions import Positions
from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.scene import Floats, Ints
from zwerm.world.tick.telemetry import TelemetryArrays, TelemetryRecord

if TYPE_CHECKING:  # pictures need matplotlib
    from pandas import DataFrame

    from zwerm.view.picture_style import PictureStyle
    from zwerm.view.run_view import RunView


@dataclass(slots=True)
class RunResult:
    """The result of one run. `as_json` is what `zwerm run --json` prints.

    `metrics` are the values at the end by name. `series` are the metrics that were sampled during the run, as arrays
    (k,) by name, `time_s` among them. `telemetry` are the numbers that nodes reported. `snapshots` are records for the
    algorithm's own pictures. `history` is what pictures are drawn from; `positions` gives it as arrays.
    """

    scenario: Scenario  # the scenario, with its settings
    seed: int  # of the run
    runner: str  # inline, processes or remote
    outcome: str  # completed, time-limit, failed or interrupted
    reason: str  # why it failed or was interrupted, in words
    trace: str  # hash of all observations and commands
    ticks: int  # number of ticks
    sim_s: float  # virtual time at the end [s]
    wall_s: float  # wall-clock time [s]
    robots: int  # number of robots
    robot_ticks: int  # number of observations
    metrics: dict[str, float]  # values at the end, by name
    radio: dict[str, Any]  # the radio's ledger: totals, and channels by name
    middleware_lost: int  # messages that the middleware lost
    crashed: list[int]  # ids of nodes that crashed, ascending
    restarted: list[int]  # ids of nodes that were restarted
    arena: Arena  # walls and free space
    history: History  # what pictures are drawn from
    cell_counts: Ints | None = None  # (rows, columns) robots at the end; None without metrics.cells
    hindered: dict[str, list[int]] = field(default_factory=dict)  # ids that were paused, slow or late
    faults: list[dict[str, Any]] = field(default_factory=list)  # the faults of the run, as [[faults]] tables
    missed_faults: list[str] = field(default_factory=list)  # in words, those that never came
    series: dict[str, Floats] = field(default_factory=dict)  # (k,) samples by name, time_s among them
    refused: dict[str, int] = field(default_factory=dict)  # refused messages, by reason
    refused_by: dict[int, dict[str, int]] = field(default_factory=dict)  # of them, by node and reason; -1: not known
    problems: list[str] = field(default_factory=list)  # what could not be written during the run
    tracebacks: dict[int, str] = field(default_factory=dict)  # of controllers that raised, by node
    crash_reasons: dict[int, str] = field(default_factory=dict)  # "tick 5: ..." of programs that ended, by node
    telemetry: TelemetryArrays = field(default_factory=TelemetryArrays.empty)  # numbers that nodes reported
    snapshots: list[TelemetryRecord] = field(default_factory=list)  # records for the algorithm's own pictures

    @property
    def ok(self) -> bool:
        """Return whether the run ended without failure: completed, or at its time limit."""
        return self.outcome in ("completed", "time-limit")

    @property
    def positions(self) -> Positions:
        """The true poses of all robots over time."""
        tracks = self.history.arrays()
        x_m, y_m = np.where(tracks.present[:, :, None], tracks.position, np.nan).transpose(2, 0, 1)
        heading = np.where(tracks.present, tracks.heading, np.nan)
        return Positions(tracks.time_s, np.arange(self.robots), x_m, y_m, heading, tracks.present)

    def to_frame(self, kind: FrameKind = "positions") -> "DataFrame":
        """Return a pandas frame of the run.

        `positions`: time_s, node, x_m, y_m, heading_rad, present, a row for each sample and robot. `metrics`: time_s
        and a column for each metric that was sampled during the run. `telemetry`: tick, time_s, node, name, value, a
        row for each number. Raises MissingExtraError without pandas, and ValueError for another kind.
        """
        return frame_of(kind, self.positions, self.series, self.telemetry)

    def as_json(self) -> dict[str, Any]:
        """Return the stable summary of the run, ready for a JSON encoder."""
        return {
            "scenario": self.scenario.name,
            "seed": self.seed,
            "runner": self.runner,
            "outcome": self.outcome,
            "trace": self.trace,
            "ticks": self.ticks,
            "sim_s": self.sim_s,
            "wall_s": self.wall_s,
            "robots": self.robots,
            "robot_ticks": self.robot_ticks,
            "metrics": self.metrics,
            "radio": self.radio,
            "middleware_lost": self.middleware_lost,
            "nodes": {
                "crashed": self.crashed,
                "restarted": self.restarted,
                **self.hindered,
                "reasons": {str(node): reason for node, reason in sorted(self.crash_reasons.items())},
            },
            "faults": self.faults,
            "refused": {
                "reasons": self.refused,
                "nodes": {"unknown" if node < 0 else str(node): each for node, each in self.refused_by.items()},
            },
        }

    def picture(
        self,
        path: str | Path,
        cycle: int | None = None,
        at_s: float | None = None,
        *,
        size_in: tuple[float, float] | None = None,
        bare: bool = False,
        colour_by: str | None = None,
        links: bool | None = None,
    ) -> Path:
        """Draw the run at its end, at a deployment cycle or at a time [s] at `path`, and return the path.

        The suffix chooses the format: .png, .pdf or .svg. `size_in` is the greatest width and height [inches] of the
        arena. A `bare` picture has no title, numbers, legend and curve. `colour_by` names the telemetry that colours
        robots, and `links` connects robots whose packets have arrived; by default the scenario's `[pictures]` decides
        on both, and a colour that no robot reported is left out. Raises PictureError where the file cannot be written,
        the moment is not of the run, or no robot reported `colour_by`.
        """
        from zwerm.view.stills import draw_run

        style = self._style(size_in, bare, colour_by, links)
        return draw_run(Path(path), self._view(style), self.metrics, cycle, at_s, style)

    def animate(
        self,
        path: str | Path,
        progress: Callable[[int, int], None] | None = None,
        *,
        size_in: tuple[float, float] | None = None,
        bare: bool = False,
        colour_by: str | None = None,
        links: bool | None = None,
    ) -> Path:
        """Draw the run as an animation at `path`, .gif or .mp4, and return the path. The other arguments are as in
        `picture`."""
        from zwerm.view.animation import animate_run

        style = self._style(size_in, bare, colour_by, links)
        return animate_run(Path(path), self._view(style), progress=progress, style=style)

    def _style(
        self, size_in: tuple[float, float] | None, bare: bool, colour_by: str | None, links: bool | None
    ) -> "PictureStyle":
        from zwerm.view.picture_style import PictureStyle

        chosen = self.scenario.pictures
        return PictureStyle(
            size_in,
            bare,
            ("" if self.missing_colour else chosen.colour_by) if colour_by is None else colour_by,
            chosen.links if links is None else links,
        )

    def __repr__(self) -> str:
        """Return one line: the arrays of a run fill screens."""
        return f"<RunResult {self.title}: {self.outcome}, {len(self.metrics)} metrics, trace {self.trace}>"

    @property
    def missing_colour(self) -> str:
        """The telemetry by which the scenario colours robots, if no robot reported it: another controller runs."""
        name = self.scenario.pictures.colour_by
        return "" if name in self.telemetry.name else name

    def _links(self) -> list[tuple[int, int]]:
        """Return the pairs of robots, smaller id first, between which a packet has arrived on the robots' channel."""
        columns = self.radio["channels"].get("robots", {}).get("links")
        if not columns:
            return []
        rows = zip(columns["sender"], columns["receiver"], columns["delivered"], strict=True)
        return sorted({(min(a, b), max(a, b)) for a, b, count in rows if count and max(a, b) < self.robots})

    def _view(self, style: "PictureStyle") -> "RunView":
        from zwerm.view.run_view import RunView

        table = self.scenario.metrics
        return RunView(
            self.arena,
            self.history,
            self.scenario.robots.body.radius_m,
            self.name,
            self.ending,
            table.coverage_radius_m,
            table.cells,
            table.sight_range_m,
            0 if self.scenario.base is None else self.scenario.base.stations,
            self.snapshots,
            {name: values.tolist() for name, values in self.series.items()},
            (*layers_of(self.scenario.robots.controller), *PICTURE_LAYERS, *self.scenario.pictures.layers),
            None if self.scenario.coordinator is None else self.robots,
            self.scenario.landmarks,
            self.telemetry,
            style.colour_by,
            self._links() if style.links else (),
        )

    @property
    def name(self) -> str:
        """The scenario and the seed."""
        return f"{self.scenario.name}, seed {self.seed}"

    @property
    def ending(self) -> str:
        """Number of robots at the end, and duration of the run."""
        there = int(self.metrics.get("robots_deployed", self.metrics.get("robots_in_arena", self.robots)))
        robots = f"{self.robots} robot{'' if self.robots == 1 else 's'}"
        return f"{robots if there == self.robots else f'{there} of {robots}'}, {self.sim_s:g} s"

    @property
    def title(self) -> str:
        """One line that names the run, and says how it ended."""
        return f"{self.name}: {self.ending}"
