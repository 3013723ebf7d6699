"""Faults by name: those of the catalogue, and `module:Class` for any other.

Input: `[[faults]]` tables of a scenario. Output: checked parameters, or every mistake in a table at once.
"""

from typing import Any

from pydantic import ValidationError

from zwerm.catalogue import FAULTS
from zwerm.errors import ScenarioError
from zwerm.scenario.diagnostics import mistakes
from zwerm.scenario.plugin_names import class_named, takes
from zwerm.scenario.tables import Scenario
from zwerm.scenario.types import OpenTable
from zwerm.world.faults import Fault, FaultTable, unknown_nodes


def find(kind: str) -> type[Fault]:
    """Return the fault class that `kind` names.

    Raises ValueError, in one line, if there is none or it is no fault.
    """
    found = class_named(FAULTS.get(kind, kind), "fault", FAULTS)
    parameters = getattr(found, "Parameters", FaultTable)
    if not isinstance(parameters, type) or not issubclass(parameters, FaultTable):
        raise ValueError(f"{kind} is no fault: its `Parameters` must be a subclass of FaultTable")
    # A class with the same methods need not inherit: it gets the defaults of the base class behind its own attributes.
    kept = found if issubclass(found, Fault) else type(found.__name__, (found, Fault), {})
    if not takes(kept, 2):
        raise ValueError(f"{kind} is no fault: its constructor must take (parameters, context)")
    return kept


def checked(path: str, table: OpenTable, scenario: Scenario) -> tuple[type[Fault], FaultTable]:
    """Return the class of the fault that stands at `path`, and its parameters.

    Raises ScenarioError with every mistake, each `path: rule, got value`.
    """
    try:
        kind = find(table.kind)
    except ValueError as error:
        raise ScenarioError([f"{path}.kind: {error}"]) from None
    try:
        parameters = kind.Parameters.model_validate(table.parameters)
    except ValidationError as error:
        named = f"{scenario.place}: "
        lines = mistakes(error, scenario.place, f"{path}.", kind.Parameters)
        raise ScenarioError([line.removeprefix(named) for line in lines]) from None
    wrong = [*_wrong_times(kind, parameters, scenario), *kind.check(parameters, scenario)]
    if wrong:
        raise ScenarioError([f"{path}{line}" for line in wrong])
    return kind, parameters


def _wrong_times(kind: type[Fault], table: FaultTable, scenario: Scenario) -> list[str]:
    """Return a line for each mistake in the beginning and the end of a fault."""
    found: list[str] = []
    duration_s = scenario.time.duration_s
    if [table.at_s, table.when, table.between_s].count(None) != 2:
        found.append(": expected one of at_s, between_s and when")
    if table.for_s is not None and table.until_s is not None:
        found.append(": expected for_s or until_s, not both")
    if not kind.lasts and (table.for_s is not None or table.until_s is not None):
        found.append(": happens at once: no for_s and no until_s")
    if table.at_s is not None and table.at_s >= duration_s:
        found.append(f".at_s: the run ends after {duration_s:g} s, got {table.at_s:g}")
    if table.between_s is not None and not table.between_s[0] < table.between_s[1] < duration_s:
        found.append(
            f".between_s: expected [first, last] before the end at {duration_s:g} s, got {list(table.between_s)}"
        )
    if table.until_s is not None and table.until_s > duration_s:
        found.append(f".until_s: the run ends after {duration_s:g} s, got {table.until_s:g}")
    if table.until_s is not None and table.until_s <= (table.at_s or (table.between_s or (0.0, 0.0))[1]):
        found.append(f".until_s: expected later than it begins, got {table.until_s:g}")
    if table.when is not None:
        found += [f".when{line}" for line in _wrong_condition(table.when, scenario)]
    return found


def _wrong_condition(when: Any, scenario: Scenario) -> list[str]:
    """Return a line for each mistake in a condition."""
    if (when.metric is None) == (when.robot_deployed is None):
        return [": expected either metric and at_least, or robot_deployed"]
    if when.robot_deployed is not None:
        unknown = unknown_nodes([when.robot_deployed], ".robot_deployed", scenario)
        return [line.replace(".robot_deployed.0", ".robot_deployed") for line in unknown]
    if when.at_least is None:
        return [".at_least: required, and missing"]
    needed = "cells" if when.metric == "cell_coverage_fraction" else "coverage_radius_m"
    if getattr(scenario.metrics, needed) is None:
        return [f".metric: needs metrics.{needed}, got {when.metric!r}"]
    return []
