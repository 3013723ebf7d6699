"""A scenario: everything that defines an experiment but its seed, as strict typed tables read from TOML.

Every table refuses keys it does not know and values of another type: "25" is no number, and true is no 1. All mistakes
are reported at once, each as `file: path: rule, got value`. Parameters of sensors and controllers are typed by their
own classes; the tables here carry them unchanged.
"""

from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    SerializeAsAny,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    create_model,
    model_validator,
)

from zwerm.catalogue import FAULTS, METRICS, Variant, algorithm_of
from zwerm.scenario.plugin_names import class_named
from zwerm.scenario.services import choose, lacking
from zwerm.scenario.types import (
    ARRAY,
    Count,
    Fraction,
    Grid,
    NonNegative,
    OpenTable,
    Place,
    Point,
    Pose,
    Positive,
    Rectangle,
    Size,
    Table,
    scenario_name,
)

# The most ticks that a run may have. At a million a second it takes eleven days.
TICKS_MAX: Final = 1e12


class TimeTable(Table):
    """Virtual time, and how long the world waits for a node in wall-clock time."""

    dt_s: Positive = 0.1
    duration_s: Positive = 60.0
    straggler_s: Positive = 30.0
    deadman_s: Positive = 0.5

    @model_validator(mode="after")
    def _has_an_end(self) -> Self:
        if not self.duration_s / self.dt_s <= TICKS_MAX:
            raise ValueError(
                f"expected duration_s of at most {TICKS_MAX:g} times dt_s, got {self.duration_s / self.dt_s:g}"
            )
        return self


class ArenaTable(Table):
    """The space in which robots move: exactly one of size_m, polygon, wkt, geojson or map, less obstacles and walls.

    `map` is a ROS map_server YAML, a bitmap (dark is wall) with `resolution_m` or `size_m`, or a grid map (MovingAI
    `.map`, or `.mcpp`) with `resolution_m`; `start` is a place [m] in the part to keep, else the largest is. Paths are
    relative to the scenario. `scale` multiplies all lengths, or `free_area_m2` is the free space after scaling. Then
    gaps narrower than `passage_m` are closed, and what lies behind them is left out."""

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
    """A robot's body. A command takes effect `latency_ticks` ticks after the observation it answers.

    `kind` is the drive: `differential`, `holonomic`, or a class of your own as module:Class. With
    `continuous_collision` two bodies that meet stop where they touch, at any speed; without it, fast bodies may overlap
    for a substep.
    """

    kind: str = "differential"
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
    continuous_collision: bool = False


class PlacementTable(Table):
    """The places at which robots start: `uniform` in the arena, in a `disc`, in a random `cell` of a grid, at `poses`,
    or at `roots`.

    `disc` takes `radius_m` and optionally `center_m` (else a random one that fits); `cell` takes `grid` and `radius_m`
    about the centre of a random cell, or of `cell` where given; `poses` are [x_m, y_m, heading_rad]; `roots` are the
    start cells of a `.mcpp` map.
    """

    kind: Literal["uniform", "disc", "cell", "poses", "roots"] = "uniform"
    radius_m: Positive | None = None
    center_m: Point | None = None
    grid: Grid | None = None
    cell: Annotated[tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]], ARRAY] | None = None
    poses: list[Pose] | None = None


class EntranceTable(Table):
    """Robots wait in a depot and enter one by one, at random places of a rectangle; they leave in another."""

    every_s: Positive
    entry_m: Rectangle
    exit_m: Rectangle | None = None


class ClockTable(Table):
    """Clocks that differ: each robot's reads (1 + drift) * t + offset, both drawn from the seed.

    The offset is uniform in +-`offset_s_max`, the drift in +-`drift_ppm_max` millionths. A robot's `time_s` and its
    wakes are by its own clock; the tick of an observation is not.
    """

    offset_s_max: NonNegative = 0.0
    drift_ppm_max: Annotated[float, Field(ge=0, lt=1e6)] = 0.0


class RobotsTable(Table):
    """The swarm: the number of robots, their body, sensors and start positions, and their controller."""

    count: Annotated[int, Field(ge=1, le=100_000)]
    controller: str
    parameters: dict[str, Any] = {}
    body: BodyTable = BodyTable()
    placement: PlacementTable = PlacementTable()
    entrance: EntranceTable | None = None
    sensors: list[OpenTable] = []
    on_crash: Literal["fail", "continue"] = "fail"
    clock: ClockTable | None = None


class BaseTable(Table):
    """A base station: robot 0, which never moves. The others wait in its depot until it releases them, one at a time.

    It stands at its `pose`, else at a random free place. With several `poses`, or `count` at random places, there are
    as many base stations: robots 0, 1, ... Each has a depot of its own, and the other robots are distributed to the
    depots in turn. A pose is [x_m, y_m, heading_rad], or [x_m, y_m], where the seed draws the heading. The robots of a
    station have its heading when they come out.
    """

    controller: str
    parameters: dict[str, Any] = {}
    pose: Place | None = None
    poses: Annotated[list[Place], Field(min_length=1)] | None = None
    count: Count | None = None

    @property
    def stations(self) -> int:
        """Number of base stations."""
        return len(self.poses) if self.poses is not None else self.count or 1

    @model_validator(mode="after")
    def _at_most_one_placement(self) -> Self:
        given = [name for name in ("pose", "poses", "count") if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"expected at most one of pose, poses and count, got {' and '.join(given)}")
        return self


class CoordinatorTable(Table):
    """The optional central node. It has no body and no sensors; robots send to it on the channel `uplink`."""

    controller: str
    parameters: dict[str, Any] = {}


class ScatterTable(Table):
    """Landmarks at random places, none in a wall: every place in the arena sees one within `dispersion_m`.

    They are drawn from `seed`, or else from the run's.
    """

    dispersion_m: Positive
    seed: Annotated[int, Field(ge=0)] | None = None


class ChannelTable(Table):
    """The models of a channel. `loss` is independent loss; `models` judge packets in order. `check` audits every tick.

    On an `anonymous` channel no receiver gets the id of a sender.
    """

    loss: Fraction = 0.0
    models: list[OpenTable] = []
    anonymous: bool = False
    check: bool = False


class RadioTable(ChannelTable):
    """The radio between robots, channel `robots`. Without this table there is none."""

    range_m: Positive | None = None
    line_of_sight: bool = False


_PER_H: Final = "_per_h"


class RandomFaultsTable(Table):
    """Faults at random times. `KIND_per_h` is the mean number of faults of a kind per hour, over the whole swarm.

    Each fault lasts `mean_s` on average. `seed`, by default that of the run, determines the schedule; the result of the
    run has it as `[[faults]]` tables.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, NonNegative]

    seed: Annotated[int, Field(ge=0)] | None = None
    mean_s: Positive = 10.0

    @model_validator(mode="before")
    @classmethod
    def _only_rates(cls, given: Any) -> Any:
        keys = given if isinstance(given, dict) else ()
        unknown = [key for key in keys if key not in cls.model_fields and not _is_rate(key)]
        if unknown:
            raise ValueError(
                f"expected seed, mean_s, or KIND{_PER_H} with a built-in fault ({', '.join(FAULTS)}) or module:Class, "
                f"got {', '.join(unknown)}"
            )
        return given

    @property
    def rates_per_h(self) -> dict[str, float]:
        """The rate of each kind that is given [1/h]."""
        return {key.removesuffix(_PER_H): rate for key, rate in (self.__pydantic_extra__ or {}).items()}


def _is_rate(key: str) -> bool:
    """Return whether a key is the rate of a kind of fault: one of the catalogue, or `module:Class`."""
    kind = key.removesuffix(_PER_H)
    return kind != key and (kind in FAULTS or ":" in kind)


class MetricsTable(Table):
    """The metrics of the run. Each other key switches on the metrics of its row in the catalogue, and is typed there.

    Metrics that sample during a run do so every `every_s`. `own` names metrics of the user's own as `module:name`: a
    subclass of `zwerm.Metric`, or a function of the truth.
    """

    every_s: Positive | None = None
    own: list[str] = []

    def __getattr__(self, name: str) -> Any:
        """Return None for a key of the catalogue that the scenario does not give."""
        if name in METRICS:
            return None
        return super().__getattr__(name)  # type: ignore[misc]


@cache
def metrics_table(keys: tuple[str, ...] = tuple(METRICS)) -> type[MetricsTable]:
    """Return the table `[metrics]` with these keys of the catalogue, each typed by the `Parameters` of its row's class.

    The key of a class without parameters is a switch, true or false.
    """
    types = {key: class_named(METRICS[key], "metric", METRICS).Parameters for key in keys}
    fields: dict[str, Any] = {key: ((bool if each is None else each) | None, None) for key, each in types.items()}
    return create_model("MetricsTable", __base__=MetricsTable, __doc__=MetricsTable.__doc__, **fields)


def _metrics(given: Any, otherwise: ValidatorFunctionWrapHandler) -> Any:
    """Validate `[metrics]` by the rows of the keys that it has."""
    if isinstance(given, dict):
        return metrics_table(tuple(key for key in METRICS if key in given)).model_validate(given)
    return otherwise(given)


class PicturesTable(Table):
    """Pictures and animations of the run: `layers`, as module:Class, are drawn over those of the algorithm.

    `colour_by` names the telemetry by which robots are coloured. `links` connects robots whose packets have arrived.
    """

    layers: list[str] = []
    colour_by: str = ""
    links: bool = False


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
    scatter: ScatterTable | None = None
    radio: RadioTable | None = None
    uplink: ChannelTable | None = None
    faults: list[OpenTable] = []
    random_faults: RandomFaultsTable | None = None
    metrics: Annotated[SerializeAsAny[MetricsTable], WrapValidator(_metrics)] = MetricsTable()
    pictures: PicturesTable = PicturesTable()
    _folder: Path = PrivateAttr(default=Path())
    _place: str = PrivateAttr(default="scenario")
    _overrides: tuple[str, ...] = PrivateAttr(default=())

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
        """The folder at which the relative paths in it start."""
        return self._folder

    @property
    def place(self) -> str:
        """Name of the scenario in messages: its file."""
        return self._place

    @property
    def overrides(self) -> tuple[str, ...]:
        """The settings, `path=value`, that were applied to it."""
        return self._overrides
