"""Reading scenarios: by the name of a built-in one or by a path, with overrides, checked as a whole."""

import copy
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from zwerm.catalogue import shipped
from zwerm.errors import ScenarioError
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.nearest import nearest
from zwerm.scenario.overrides import blame, override
from zwerm.scenario.renamed import rename
from zwerm.scenario.tables import Scenario
from zwerm.scenario.toml_text import parse_toml
from zwerm.scenario.types import OpenTable, is_file

# Tables that every scenario has and no study, and keys that every study has one of and no scenario.
SCENARIO_KEYS: Final = frozenset({"time", "arena", "robots"})
STUDY_KEYS: Final = frozenset({"scenario", "variants"})


def built_in() -> Mapping[str, Path]:
    """Return the scenarios that ship with Zwerm, by name."""
    return shipped("scenarios")


def locate(name: str) -> Path:
    """Return the file of a built-in scenario's name, or of a path.

    Raises ScenarioError where neither exists.
    """
    path = Path(name)
    own = built_in().get(name)
    if own is not None:
        return own
    if is_file(path):
        return path
    if name in shipped("studies"):
        raise ScenarioError([f"{name}: is a study and no scenario; run it with: zwerm study {name}"])
    hint = suggestion(name, built_in(), "zwerm list")
    raise ScenarioError([f"{name}: expected a scenario file or the name of a built-in one{hint}"])


def suggestion(name: str, known: Iterable[str], command: str) -> str:
    """Return the files or else the known names that are most similar to `name`, three at most, as part of a line.

    The files are those of the folder that `name` leads to. The command that lists all names follows, unless `name` is a
    path.
    """
    path = Path(name)
    files = _toml_files(path.parent)
    if path.suffix != ".toml" and f"{path.name}.toml" in files:
        return f"; did you mean {path}.toml?"
    found = nearest(path.name, files, count=3, similarity=0.7)
    if found:
        return f"; nearest are {', '.join(str(path.with_name(each)) for each in found)}"
    if path.suffix == ".toml":
        return ""
    similar = nearest(name, known, count=3, similarity=0.3)
    return f"; nearest are {', '.join(similar)}; `{command}` names all" if similar else f"; `{command}` names all"


def _toml_files(folder: Path) -> list[str]:
    """Return the names of the TOML files of a folder, none where it cannot be read."""
    try:
        return sorted(each.name for each in folder.glob("*.toml"))
    except (OSError, ValueError):
        return []


def read(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file, unchecked.

    Raises ScenarioError where it is no TOML.
    """
    try:
        return parse_toml(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ScenarioError([f"{path}: not TOML: {error}"]) from None
    except OSError as error:
        raise ScenarioError([f"{path}: cannot be read: {error.strerror}"]) from None


def load(name: str, overrides: tuple[str, ...] = (), blamed: tuple[str, ...] | None = None) -> Scenario:
    """Return the scenario `name` (built in, or a path) with each `path=value` of `overrides` applied.

    `blamed` are the overrides that a mistake may name as its place, by default all. Raises ScenarioError with every
    mistake.
    """
    tables, path = tables_of(name, overrides)
    return _validated(tables, str(path), path.parent, overrides if blamed is None else blamed)


def tables_of(name: str, overrides: tuple[str, ...] = ()) -> tuple[dict[str, Any], Path]:
    """Return what `load` would validate, and the scenario's file. Raises ScenarioError where there is none to
    validate."""
    path = locate(name)
    tables = read(path)
    if STUDY_KEYS & tables.keys() and not SCENARIO_KEYS & tables.keys():
        raise ScenarioError([f"{name}: is a study and no scenario; run it with: zwerm study {name}"])
    rename(tables, str(path))
    tables.setdefault("name", path.stem)
    for assignment in overrides:
        override(tables, assignment)
    rename(tables, str(path))
    return tables, path


def validate(tables: dict[str, Any], place: str, folder: Path, overrides: tuple[str, ...] = ()) -> Scenario:
    """Return `tables` as a Scenario whose relative paths start at `folder`.

    Raises ScenarioError with every mistake, each led by `place`, or by the one of `overrides` that made it.
    """
    tables = copy.deepcopy(tables)
    rename(tables, place)
    return _validated(tables, place, folder, overrides)


def _validated(tables: dict[str, Any], place: str, folder: Path, overrides: tuple[str, ...]) -> Scenario:
    try:
        scenario = Scenario.model_validate(tables)
    except ValidationError as error:
        raise ScenarioError(blame(mistakes(error, place, table=Scenario), place, overrides)) from None
    if scenario.variant is not None and not scenario.variant.coordinator:
        scenario = _without_coordinator(scenario)
    scenario._folder, scenario._place, scenario._overrides = folder, place, overrides
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
