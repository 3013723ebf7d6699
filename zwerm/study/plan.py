"""From a study to its trials: every variant at every point of the grid with every seed, each scenario checked beforehand.

A point's fingerprint names everything that decides what a trial gives, but for its seed and Zwerm's own code between two
releases: the scenario, the shape of the arena, the files it names and the user's own modules that it names.
"""

import itertools
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any

from zwerm.errors import ScenarioError
from zwerm.run.assembly import prepare
from zwerm.run.runner import Runner
from zwerm.scenario.load import built_in as built_in_scenarios
from zwerm.scenario.load import load
from zwerm.scenario.tables import Scenario
from zwerm.study.tables import Setting, Study, VariantTable
from zwerm.version import __version__

# What a scenario says of itself and no run depends on.
_WORDS = {"name", "summary", "source"}
_PATH_LENGTH_MAX = 255


@dataclass(frozen=True)
class Point:
    """One variant at one point of the grid: a scenario that is ready to run."""

    variant: str
    settings: dict[str, Setting]
    scenario: Scenario
    fingerprint: str

    @property
    def label(self) -> str:
        """The point in words."""
        return label(self.variant, self.settings)


@dataclass(frozen=True)
class Trial:
    """One run of a study."""

    study: str
    point: Point
    seed: int
    series: tuple[str, ...] = ()
    runner: Runner = "inline"

    @property
    def key(self) -> tuple[str, str, int]:
        """What tells this trial from all others, whatever file it is in."""
        return self.point.variant, self.point.fingerprint, self.seed


def label(variant: str, settings: dict[str, Setting]) -> str:
    """Return `variant, axis=value, ...`."""
    return ", ".join([*([variant] if variant else []), *(f"{axis}={value}" for axis, value in settings.items())])


def make_points(study: Study, sets: Sequence[str] = ()) -> list[Point]:
    """Return the points of `study`, by variant and then in the order of the grid; `sets` override what the file sets.

    Raises ScenarioError with every mistake at every point, each mistake once.
    """
    points: list[Point] = []
    found: dict[str, str] = {}
    for variant in study.variants:
        for values in itertools.product(*study.table.grid.values()):
            settings = dict(zip(study.table.grid, values, strict=True))
            try:
                points.append(_make_point(study, variant, settings, sets))
            except ScenarioError as error:
                where = label(variant.name, settings)
                for line in error.mistakes:
                    found.setdefault(line, f"{study.path}: {where}: {line}" if where else f"{study.path}: {line}")
    if found:
        raise ScenarioError(list(found.values()))
    return points


def make_trials(study: Study, points: Sequence[Point], seeds: Sequence[int], runner: Runner = "inline") -> list[Trial]:
    """Return the trials by seed and then by point, so that whatever part of them is done says something of every point."""
    series = tuple(study.table.series)
    return [Trial(study.name, point, seed, series, runner) for seed in seeds for point in points]


def _make_point(study: Study, variant: VariantTable, settings: dict[str, Setting], sets: Sequence[str]) -> Point:
    name = variant.scenario or study.table.scenario or ""
    beside = study.path.parent / name
    if name not in built_in_scenarios() and beside.is_file():
        name = str(beside)
    axes = [each for axis, value in settings.items() for each in _assignments(study, variant, axis, value)]
    scenario = load(name, (*study.table.set, *variant.set, *sets, *axes))
    arena = prepare(scenario).arena
    return Point(variant.name, settings, scenario, _fingerprint(scenario, arena.segments.tobytes()))


def _assignments(study: Study, variant: VariantTable, axis: str, value: Setting) -> list[str]:
    """Return what a value of an axis sets in a variant."""
    if axis in study.table.levels:
        return study.table.levels[axis][str(value)]
    return [f"{path}={json.dumps(value)}" for path in variant.axes.get(axis, axis).split("+")]


def _fingerprint(scenario: Scenario, walls: bytes) -> str:
    digest = blake2b(__version__.encode(), digest_size=16)
    tables = scenario.model_dump(mode="json", exclude=_WORDS)
    digest.update(json.dumps(tables, sort_keys=True).encode())
    digest.update(walls)
    for text in _strings(tables):
        for file in (scenario.folder / text[:_PATH_LENGTH_MAX], _source(text)):
            if file is not None and file.is_file():
                digest.update(file.read_bytes())
    return digest.hexdigest()


def _source(text: str) -> Path | None:
    """Return the file of the user's module that `module:Class` names, and that checking the scenario has imported."""
    name, colon, _ = text.partition(":")
    module = sys.modules.get(name) if colon and not name.startswith("zwerm.") else None
    file = getattr(module, "__file__", None)
    return None if file is None else Path(file)


def _strings(value: Any) -> list[str]:
    """Return every string in nested tables and arrays, in order."""
    if isinstance(value, str):
        return [value]
    if isinstance(value, dict):
        return [text for each in value.values() for text in _strings(each)]
    return [text for each in value for text in _strings(each)] if isinstance(value, list) else []
