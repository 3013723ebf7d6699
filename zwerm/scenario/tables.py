"""A scenario: everything that defines an experiment but its seed, as strict typed tables read from TOML.

Every table refuses keys it does not know and values of another type: "25" is no number, and true is no 1. All mistakes
are reported at once, each as `file: path: rule, got value`. What a sensor or a controller takes as parameters is theirs
to type; the tables here carry them as they are.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from zwerm.catalogue import Variant, algorithm_of
from zwerm.scenario.services import choose, lacking
from zwerm.scenario.types import (
    ARRAY,
    Count,
    Fraction,
    Grid,
    NonNegative,
    OpenTable,
    Point,
    Pose,
    Positive,
    Rectangle,
    Size,
    Table,
    scenario_name,
)


class TimeTable(Table):
    """Virtual time, and how long the world waits for a node in wall-clock time."""

    dt_s: Positive = 0.1
    duration_s: Positive = 60.0
    straggler_s: Positive = 30.0
    deadman_s: Positive = 0.5


class ArenaTable(Table):
    """The space robots live in: exactly one of size_m, polygon, wkt, geojson or map, less obstacles and walls.

    `map` is a ROS map_server YAML, or a bitmap (dark is wall) with `resolution_m` or `size_m`; `start` is a place [m] in the
    part to keep, else the largest is. Paths are relative to the scenario. `scale` multiplies all lengths, or `free_area_m2`
    is the free space after scaling. Then gaps narrower than `passage_m` are closed, and what lies behind them is left out."""

    size_m: Size | None = None
    polygon: list[Point] | None = Field(default=None, min_length=3)
    wkt: str | None = None
    geojson: str | None = None
    map: str | None = None
    resolution_m: Positive | None = None
    start: Point | None = None
    scale: Positive = 1.0
    free_area_m2: Positive | None = None
    passage_m: Positive | None = None
    obstacles: list[Annotated[list[Point], Field(min_length=3)]] = []
    walls: list[Annotated[list[Point], Field(min_length=2)]] = []


class BodyTable(Table):
    """A robot's body. A command takes effect `latency_ticks` ticks after the observation it answers."""

    kind: Literal["differential", "holonomic"] = "differential"
    radius_m: Positive = 0.037
    mass_kg: Positive = 0.152
    wheel_base_m: Positive = 0.051
    max_speed_m_s: Positive = 0.128
    max_turn_rad_s: Positive = 6.0
    latency_ticks: Annotated[int, Field(ge=0, le=100)] = 0
    substeps: Annotated[int, Field(ge=1, le=1000)] = 10
    friction: NonNegative = 0.0
    drive_noise_fraction: Fraction = 0.0
    collide: bool = True


class PlacementTable(Table):
    """Where robots start: `uniform` in the arena, within a `disc`, in a random `cell` of a grid, or at given `poses`.

    `disc` takes `radius_m` and optionally `center_m` (else a random one that fits); `cell` takes `grid` and `radius_m`
    about the centre of a random cell, or of `cell` where given; `poses` are [x_m, y_m, heading_rad].
    """

    kind: Literal["uniform", "disc", "cell", "poses"] = "uniform"
    radius_m: Positive | None = None
    center_m: Point | None = None
    grid: Grid | None = None
    cell: Annotated[tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]], ARRAY] | None = None
    poses: list[Pose] | None = None


class InflowTable(Table):
    """Robots wait in a depot and enter one by one, at random places of a rectangle; they leave in another."""

    every_s: Positive
    entry_m: Rectangle
    exit_m: Rectangle | None = None


class RobotsTable(Table):
    """The swarm: how many, what they are, what they sense, what runs on them."""

    count: Annotated[int, Field(ge=1, le=100_000)]
    controller: str
    parameters: dict[str, Any] = {}
    body: BodyTable = BodyTable()
    placement: PlacementTable = PlacementTable()
    inflow: InflowTable | None = None
    sensors: list[OpenTable] = []
    on_crash: Literal["fail", "continue"] = "fail"


class BaseTable(Table):
    """A base station: robot 0, which never moves. The others wait in its depot until it releases them, one at a time.

    It stands at its `pose`, else at a random free place. With several `poses`, or `count` at random places, there are as many
    base stations, robots 0, 1, ..., each with a depot of its own: the other robots are dealt out to them in turn.
    """

    controller: str
    parameters: dict[str, Any] = {}
    pose: Pose | None = None
    poses: Annotated[list[Pose], Field(min_length=1)] | None = None
    count: Count | None = None

    @property
    def stations(self) -> int:
        """How many base stations there are."""
        return len(self.poses) if self.poses is not None else self.count or 1

    @model_validator(mode="after")
    def _one_way_to_say_where(self) -> Self:
        given = [name for name in ("pose", "poses", "count") if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"expected at most one of pose, poses and count, got {' and '.join(given)}")
        return self


class CoordinatorTable(Table):
    """The optional central node. It has no body and no sensors; it hears robots over the `uplink` channel."""

    controller: str
    parameters: dict[str, Any] = {}


class ChannelTable(Table):
    """What happens to packets on a channel: `loss` is independent loss, `models` judge in order. `check` audits every tick.

    An `anonymous` channel tells no receiver who sent a packet.
    """

    loss: Fraction = 0.0
    models: list[OpenTable] = []
    anonymous: bool = False
    check: bool = False


class RadioTable(ChannelTable):
    """The radio between robots, channel `robots`: who hears whom. Without this table there is none."""

    range_m: Positive | None = None
    line_of_sight: bool = False


Rate = NonNegative


class RandomFaultsTable(Table):
    """Faults at random times: for each kind how many to expect an hour, over the whole swarm. Each lasts `mean_s` on average.

    The schedule is drawn from `seed`, or else from the run's; the run's result holds it as `[[faults]]` tables.
    """

    seed: Annotated[int, Field(ge=0)] | None = None
    mean_s: Positive = 10.0
    crash_per_h: Rate = 0.0
    pause_per_h: Rate = 0.0
    slow_per_h: Rate = 0.0
    partition_per_h: Rate = 0.0
    jam_per_h: Rate = 0.0
    blackout_per_h: Rate = 0.0
    cut_per_h: Rate = 0.0
    camera_blackout_per_h: Rate = 0.0
    dead_beacon_per_h: Rate = 0.0
    stuck_touch_per_h: Rate = 0.0


class VoronoiMetricsTable(Table):
    """Coverage of the field by Voronoi cells: errors, cost, when statistics of the error fall below `converged_m`.

    With `peak_m` also the density in `rings` about it. The first `stationary` robots have cells, and no errors.
    """

    converged_m: Positive = 1e-7
    peak_m: Point | None = None
    rings: Count = 10
    stationary: Annotated[int, Field(ge=0)] = 0


class MetricsTable(Table):
    """What is measured of the run; metrics whose settings are absent are not computed.

    What is measured all through the run is looked at every `every_s`.
    """

    cells: Grid | None = None
    coverage_radius_m: Positive | None = None
    sight_range_m: Positive | None = None
    every_s: Positive | None = None
    voronoi: VoronoiMetricsTable | None = None


class PicturesTable(Table):
    """Pictures and animations of the run: `layers`, as module:Class, are drawn over those of the algorithm."""

    layers: list[str] = []


class Scenario(Table):
    """One experiment."""

    name: Annotated[str, AfterValidator(scenario_name)]
    summary: str = ""
    source: str = ""
    time: TimeTable = TimeTable()
    arena: ArenaTable
    robots: RobotsTable
    base: BaseTable | None = None
    coordinator: CoordinatorTable | None = None
    services: dict[str, str] | None = None
    field: OpenTable | None = None
    landmarks: list[Point] = []
    radio: RadioTable | None = None
    uplink: ChannelTable | None = None
    faults: list[OpenTable] = []
    random_faults: RandomFaultsTable | None = None
    metrics: MetricsTable = MetricsTable()
    pictures: PicturesTable = PicturesTable()
    _folder: Path = PrivateAttr(default=Path())
    _place: str = PrivateAttr(default="scenario")

    @model_validator(mode="after")
    def _variant_can_run(self) -> Self:
        variant = self.variant
        if variant is not None:
            stations = 0 if self.base is None else self.base.stations
            missing = lacking(variant, self.coordinator is not None, self.radio is not None, stations)
            if missing:
                raise ValueError(missing)
        return self

    @property
    def variant(self) -> Variant | None:
        """The variant that `services` chooses, or None where it chooses none or the controller is not in the catalogue.

        Raises ValueError, in one line, where no variant has these services.
        """
        row = algorithm_of(self.robots.controller)
        return None if self.services is None or row is None else choose(row, self.services)

    @property
    def folder(self) -> Path:
        """Where the relative paths in it start."""
        return self._folder

    @property
    def place(self) -> str:
        """What messages call it: its file."""
        return self._place
