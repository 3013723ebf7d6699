"""A study's file as strict typed tables: scenarios, settings, seeds, and a paper's values.

The rules are those of a scenario. Unknown keys and wrong types are refused. All errors are reported at once, each as
`file: path: rule, got value`. `plan` checks whether the settings exist in the scenario.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError

from zwerm.catalogue import shipped
from zwerm.errors import ScenarioError
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.load import SCENARIO_KEYS, STUDY_KEYS, read, suggestion
from zwerm.scenario.load import built_in as built_in_scenarios
from zwerm.scenario.types import Finite, NonNegative, Table

Setting = bool | int | float | str

# Reserved names of columns of the results.
RESERVED = (
    *("study", "variant", "seed", "outcome", "reason", "trace", "fingerprint", "ticks", "sim_s", "wall_s"),
    *("modules", "cell_counts", "series_time_s"),
)
# Reserved columns that a study may report like a metric.
REPORTABLE_COLUMNS = ("ticks", "sim_s", "wall_s")
# Metrics over all trials of a point: the smallest and the largest mean number of robots in a cell.
CELL_METRICS = ("least_cell_robots", "most_cell_robots")


def _one_kind(values: list[Any]) -> list[Setting]:
    """Return the values of an axis, all of one type; integers become floats if one value is a float."""
    if not values:
        raise ValueError("expected 1 value at least")
    kinds = {type(value) for value in values}
    if kinds == {int, float}:
        values = [float(value) for value in values]
    elif len(kinds) != 1 or not kinds <= {bool, int, float, str}:
        raise ValueError("expected an array of numbers, of strings or of booleans")
    if len(set(values)) < len(values):
        raise ValueError("expected different values")
    return values


def _seeds(given: Any) -> Any:
    """Return the seeds from a count (1 to count), from a table with first and last, or as listed."""
    if isinstance(given, int) and not isinstance(given, bool):
        if given < 1:
            raise ValueError("expected a count >= 1, an array of seeds, or first and last")
        return list(range(1, given + 1))
    if (
        isinstance(given, dict)
        and set(given) == {"first", "last"}
        and all(type(each) is int for each in given.values())
    ):
        return list(range(given["first"], given["last"] + 1))
    return given


def _different_seeds(seeds: list[int]) -> list[int]:
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError("expected seeds that differ, and 1 at least")
    return seeds


def _number_as_table(given: Any) -> Any:
    return {"value": given} if isinstance(given, int | float) and not isinstance(given, bool) else given


Axis = Annotated[list[Any], AfterValidator(_one_kind)]
Seeds = Annotated[list[Annotated[int, Field(ge=0)]], BeforeValidator(_seeds), AfterValidator(_different_seeds)]


class Published(Table):
    """A paper's value of a metric, or its lower bound. `tolerance` is the precision of the printed value."""

    value: Finite | None = None
    at_least: Finite | None = None
    tolerance: NonNegative | None = None


class PaperPoint(Table):
    """A paper's values of one variant, or of all, at the points of the grid with the settings `at`."""

    variant: str | None = None
    at: dict[str, Any] = Field(default_factory=dict)
    values: dict[str, Annotated[Published, BeforeValidator(_number_as_table)]]


class PaperTable(Table):
    """A paper's numbers. `trials` is the number of trials of each mean, if the paper gives it."""

    tolerance: NonNegative = 0.0
    trials: Annotated[int, Field(ge=1)] | None = None
    note: str = ""
    points: list[PaperPoint] = Field(default_factory=list)


class VariantTable(Table):
    """A variant of the scenario. `axes` maps an axis of the grid to the setting that it changes in this variant."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]*$")]
    scenario: str | None = None
    set: list[str] = Field(default_factory=list)
    axes: dict[str, str] = Field(default_factory=dict)


class StudyTable(Table):
    """One study. Each variant runs at each point of the grid with each seed.

    An axis of the grid sets the path that it names, or several, `PATH+PATH`; the values of an axis with `levels` name lists
    of settings.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")]
    summary: str = ""
    source: str = ""
    scenario: str | None = None
    set: list[str] = Field(default_factory=list)
    seeds: Seeds
    metrics: Annotated[list[str], Field(min_length=1)]
    series: list[Literal["robots_in_arena", "robots_entered", "mean_error_m"]] = Field(default_factory=list)
    grid: dict[str, Axis] = Field(default_factory=dict)
    levels: dict[str, dict[str, list[str]]] = Field(default_factory=dict)
    variants: list[VariantTable] = Field(default_factory=list)
    paper: PaperTable = Field(default_factory=PaperTable)
    picture: Literal["line", "bars", "heatmap", "series", "tracks", "density"] | None = None


@dataclass(frozen=True)
class Study:
    """A checked study and its file. Relative paths in it start at the file's folder."""

    table: StudyTable
    path: Path
    lenient: bool = False  # a metric that no scenario measures is left out

    @property
    def name(self) -> str:
        """The study's name."""
        return self.table.name

    @property
    def variants(self) -> list[VariantTable]:
        """The variants; one without a name if the file has none."""
        return self.table.variants or [VariantTable.model_construct(name="")]

    @property
    def trials(self) -> int:
        """The number of trials: variants times points of the grid times seeds."""
        return len(self.variants) * math.prod(len(axis) for axis in self.table.grid.values()) * len(self.table.seeds)

    def published(self, variant: str, settings: Mapping[str, Setting]) -> dict[str, Published]:
        """Return the paper's value of each metric at this point, with its tolerance; later tables override earlier ones."""
        found: dict[str, Published] = {}
        for point in self.table.paper.points:
            if point.variant in (None, variant) and all(settings[axis] == value for axis, value in point.at.items()):
                found |= point.values
        rest = {"tolerance": self.table.paper.tolerance}
        return {
            metric: each if each.tolerance is not None else each.model_copy(update=rest)
            for metric, each in found.items()
        }


def built_in() -> Mapping[str, Path]:
    """Return the files of the built-in studies, by name."""
    return shipped("studies")


def load_study(name: str) -> Study:
    """Return the study `name`: a built-in one, or a path.

    Raises ScenarioError with every mistake.
    """
    path = built_in().get(name, Path(name))
    if not path.is_file():
        if name in built_in_scenarios():
            raise ScenarioError([f"{name}: is a scenario and no study; run it with: zwerm run {name}"])
        hint = suggestion(name, built_in(), "zwerm list")
        raise ScenarioError([f"{name}: expected a study's file or the name of a built-in one{hint}"])
    tables = read(path)
    if SCENARIO_KEYS & tables.keys() and not STUDY_KEYS & tables.keys():
        raise ScenarioError([f"{name}: is a scenario and no study; run it with: zwerm run {name}"])
    tables.setdefault("name", path.stem)
    return check_study(tables, path)


def check_study(tables: dict[str, Any], path: Path) -> Study:
    """Return the study of `tables`, read from `path`.

    Raises ScenarioError with every mistake.
    """
    try:
        study = Study(StudyTable.model_validate(tables), path)
    except ValidationError as error:
        raise ScenarioError(mistakes(error, str(path), table=StudyTable)) from None
    found = [f"{path}: {line}" for line in _contradictions(study.table)]
    if found:
        raise ScenarioError(found)
    return study


# The most seeds of a study: each is a run. A seed has at most as many digits as fit into 63 bits.
SEEDS_MAX: Final = 1_000_000
_SEED_DIGITS_MAX: Final = 18


def parse_seeds(text: str) -> list[int]:
    """Return the seeds of `N` (1 to N) or `FIRST-LAST`.

    Raises ScenarioError if `text` is neither.
    """
    first, dash, last = text.partition("-")
    ends = (first, last) if dash else ("1", first)
    if all(each.isascii() and each.isdigit() and len(each) <= _SEED_DIGITS_MAX for each in ends):
        if int(ends[1]) - int(ends[0]) >= SEEDS_MAX:
            raise ScenarioError([f"seeds: expected at most {SEEDS_MAX}, got {text!r}"])
        seeds = list(range(int(ends[0]), int(ends[1]) + 1))
        if seeds:
            return seeds
    raise ScenarioError([f"seeds: expected a count, or FIRST-LAST, got {text!r:.80}"])


def _contradictions(table: StudyTable) -> Iterator[str]:
    """Yield the contradictions between tables."""
    if table.scenario is None and not table.variants:
        yield "scenario: required, and missing"
    for name, count in Counter(variant.name for variant in table.variants).items():
        if count > 1:
            yield f"variants: expected different names, got {name!r} {count} times"
    for index, variant in enumerate(table.variants):
        if table.scenario is None and variant.scenario is None:
            yield f"variants.{index}.scenario: required where the study has none, and missing"
        for axis in variant.axes:
            if axis not in table.grid:
                yield f"variants.{index}.axes.{axis}: the grid has no such axis"
    for axis, levels in table.levels.items():
        if axis not in table.grid:
            yield f"levels.{axis}: the grid has no such axis"
        for value in table.grid.get(axis, ()):
            if value not in levels:
                yield f"levels.{axis}: expected what {value!r} of the grid sets"
    for axis in table.grid:
        if axis in RESERVED or axis in table.metrics:
            yield f"grid.{axis}: the results have a column of that name"
    for metric, count in Counter(table.metrics).items():
        if count > 1 or (metric in RESERVED and metric not in REPORTABLE_COLUMNS):
            yield f"metrics: expected different names of metrics, got {metric!r}"
    for index, point in enumerate(table.paper.points):
        yield from (f"paper.points.{index}.{line}" for line in _point_contradictions(point, table))


def _point_contradictions(point: PaperPoint, table: StudyTable) -> Iterator[str]:
    names = [variant.name for variant in table.variants]
    if point.variant is not None and point.variant not in names:
        yield f"variant: expected one of {', '.join(names) or 'none'}, got {point.variant!r}"
    for axis, value in point.at.items():
        if axis not in table.grid:
            yield f"at.{axis}: the grid has no such axis"
        elif value not in table.grid[axis]:
            yield f"at.{axis}: the grid has no such value, got {value!r}"
    for metric, published in point.values.items():
        if metric not in table.metrics:
            yield f"values.{metric}: the study reports no such metric"
        if (published.value is None) == (published.at_least is None):
            yield f"values.{metric}: expected a number, or a table with either value or at_least"
