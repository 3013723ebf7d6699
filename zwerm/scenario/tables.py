"""A scenario: everything that defines an experiment but its seed, as strict typed tables read from TOML.

Every table refuses keys it does not know and values of another type: "25" is no number, and true is no 1. All mistakes
are reported at once, each as `file: path: rule, got value`. What a sensor or a controller takes as parameters is theirs
to type; the tables here carry them as they are.
"""

import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from zwerm.errors import ScenarioError
from zwerm.scenario.diagnostics import mistakes as mistakes  # for those who type tables of their own
from zwerm.scenario.overrides import override as override
from zwerm.scenario.services import ServicesTable

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]

# TOML knows arrays only: a tuple that takes one says so with this, and its items stay strict.
ARRAY = Field(strict=False)
Point = Annotated[tuple[Finite, Finite], ARRAY]
Size = Annotated[tuple[Positive, Positive], ARRAY]
Pose = Annotated[tuple[Finite, Finite, Finite], ARRAY]
Grid = Annotated[tuple[Count, Count], ARRAY]


def _rectangle(corners: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    xmin, ymin, xmax, ymax = corners
    if not (xmin < xmax and ymin < ymax):
        raise ValueError("expected [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax")
    return corners


def _name(text: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", text):
        raise ValueError("expected letters, digits, '.', '_' and '-', and no sign first")
    return text


Rectangle = Annotated[tuple[Finite, Finite, Finite, Finite], ARRAY, AfterValidator(_rectangle)]


class Table(BaseModel):
    """A TOML table with a fixed set of keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class OpenTable(BaseModel):
    """A TOML table that names a plug-in by `kind` and carries the plug-in's own parameters beside it."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    kind: str

    @property
    def parameters(self) -> dict[str, Any]:
        """The keys besides `kind`, for the plug-in to type."""
        return dict(self.__pydantic_extra__ or {})


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


class Scenario(Table):
    """One experiment."""

    name: Annotated[str, AfterValidator(_name)]
    summary: str = ""
    source: str = ""
    time: TimeTable = TimeTable()
    arena: ArenaTable
    robots: RobotsTable
    base: BaseTable | None = None
    coordinator: CoordinatorTable | None = None
    services: ServicesTable | None = None
    field: OpenTable | None = None
    landmarks: list[Point] = []
    radio: RadioTable | None = None
    uplink: ChannelTable | None = None
    faults: list[OpenTable] = []
    random_faults: RandomFaultsTable | None = None
    metrics: MetricsTable = MetricsTable()
    _folder: Path = PrivateAttr(default=Path())
    _place: str = PrivateAttr(default="scenario")

    @model_validator(mode="after")
    def _someone_provides_the_services(self) -> Self:
        services = self.services
        if services is None:
            return self
        if services.centre and self.coordinator is None:
            raise ValueError("services: what the coordinator provides needs the table [coordinator]")
        if services.path == "gradient":
            if self.radio is None:
                raise ValueError("services.path: robots that find the path need the table [radio]")
            if self.base is None or self.base.stations > 1:
                raise ValueError("services.path: robots find the path from one base station")
        elif services.spares == "link" and self.radio is None:
            raise ValueError("services.redundancy: robots that agree among themselves need the table [radio]")
        return self

    @property
    def folder(self) -> Path:
        """Where the relative paths in it start."""
        return self._folder

    @property
    def place(self) -> str:
        """What messages call it: its file."""
        return self._place


BUILT_IN = Path(__file__).parents[1] / "scenarios"


def built_in() -> dict[str, Path]:
    """Return the scenarios that ship with Zwerm, by name."""
    return {path.stem: path for path in sorted(BUILT_IN.glob("*.toml"), key=lambda each: each.stem)}


def locate(name: str) -> Path:
    """Return the file of a built-in scenario's name, or of a path.

    Raises ScenarioError where neither exists.
    """
    if name in built_in():
        return built_in()[name]
    path = Path(name)
    if path.is_file():
        return path
    hint = "" if path.suffix == ".toml" else "; built in are " + ", ".join(built_in())
    raise ScenarioError([f"{name}: expected a scenario file or the name of a built-in one{hint}"])


def read(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file, unchecked.

    Raises ScenarioError where it is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError([f"{path}: not TOML: {error}"]) from None
    except OSError as error:
        raise ScenarioError([f"{path}: cannot be read: {error.strerror}"]) from None


def load(name: str, overrides: tuple[str, ...] = ()) -> Scenario:
    """Return the scenario `name` (built in, or a path) with each `path=value` of `overrides` applied.

    Raises ScenarioError with every mistake.
    """
    tables, path = tables_of(name, overrides)
    return validate(tables, str(path), path.parent)


def tables_of(name: str, overrides: tuple[str, ...] = ()) -> tuple[dict[str, Any], Path]:
    """Return what `load` would validate, and the scenario's file. Raises ScenarioError where there is none to validate."""
    path = locate(name)
    tables = read(path)
    tables.setdefault("name", path.stem)
    for assignment in overrides:
        override(tables, assignment)
    return tables, path


def validate(tables: dict[str, Any], place: str, folder: Path) -> Scenario:
    """Return `tables` as a Scenario whose relative paths start at `folder`.

    Raises ScenarioError with every mistake, each led by `place`.
    """
    try:
        scenario = Scenario.model_validate(tables)
    except ValidationError as error:
        raise ScenarioError(mistakes(error, place)) from None
    if scenario.services is not None and not scenario.services.centre:
        scenario = _without_coordinator(scenario)
    scenario._folder, scenario._place = folder, place
    return scenario


def _without_coordinator(scenario: Scenario) -> Scenario:
    """Return a scenario in which the coordinator has nothing to do without it, its uplink, and the faults of both."""
    faults = []
    for each in scenario.faults:
        nodes = each.parameters.get("nodes")
        if each.parameters.get("channel") == "uplink" or nodes == ["coordinator"]:
            continue
        if isinstance(nodes, list) and "coordinator" in nodes:
            each = OpenTable(kind=each.kind, **each.parameters | {"nodes": [n for n in nodes if n != "coordinator"]})
        faults.append(each)
    return scenario.model_copy(update={"coordinator": None, "uplink": None, "faults": faults})
