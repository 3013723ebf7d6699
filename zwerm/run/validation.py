"""Every mistake in a scenario at once, of both stages: its tables, and the objects that are made of them.

Objects can be made of correct tables only. So wrong tables are left out, and the other tables are checked as if they
were complete. Mistakes at, around or inside a place that was left out are then ignored, because the omission may cause
them.
"""

import copy
from collections import Counter
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

from zwerm.agents.conformance.check import setup_violations
from zwerm.agents.conformance.stimuli import sensor_class
from zwerm.agents.runtime.controllers import find
from zwerm.catalogue import algorithm_of
from zwerm.deploy.node_specs import node_specs
from zwerm.errors import ScenarioError
from zwerm.run.assembly import assemble, prepare
from zwerm.scenario.load import load, tables_of, validate
from zwerm.scenario.overrides import blame
from zwerm.scenario.tables import Scenario

Path = tuple[str, ...]


def scenario_mistakes(name: str, overrides: tuple[str, ...] = ()) -> list[str]:
    """Return one line for every mistake in the scenario `name` with `overrides`: `place: path: rule, got value`."""
    try:
        scenario = load(name, overrides)
    except ScenarioError as error:
        return list(dict.fromkeys([*error.mistakes, *_mistakes_of_the_rest(name, overrides)]))
    try:
        assemble(scenario, seed=1)
    except ScenarioError as error:
        return error.mistakes
    return own_controller_mistakes(scenario)


def own_controller_mistakes(scenario: Scenario) -> list[str]:
    """Return how the scenario's own controllers, `module:Class`, break the contract; one line for each rule that is broken.

    The conformance kit makes and steps one controller of each role in this process, with the node's Setup of the
    scenario.
    """
    found: dict[str, None] = {}
    tried: set[str] = set()
    for controller, setup in node_specs(scenario, 1).values():
        if algorithm_of(controller) is not None or controller in tried or _is_built_in(controller):
            continue
        tried.add(controller)
        if all(hasattr(sensor_class(sensor), "stimulus") for sensor in setup.sensors):
            for violation in _each_once(setup_violations(find(controller), setup)):
                found[f"{scenario.place}: {setup.role}: {controller}: {violation}"] = None
    return list(found)


def _each_once(violations: Sequence[str]) -> list[str]:
    """Return the first of the violations that differ only in the observation that shows them, with the number of others."""
    counts = Counter(_without_observation(each) for each in violations)
    firsts = {_without_observation(each): each for each in reversed(violations)}
    return [
        firsts[rule] + (f", and on {count - 1} more observations" if count > 1 else "")
        for rule, count in counts.items()
    ]


def _without_observation(violation: str) -> str:
    return violation.rpartition(", on ")[0] or violation


def _is_built_in(controller: str) -> bool:
    return controller.startswith("zwerm.")


def _mistakes_of_the_rest(name: str, overrides: tuple[str, ...]) -> list[str]:
    try:
        tables, file = tables_of(name, overrides)
    except ScenarioError:
        return []  # there is no rest
    rest = copy.deepcopy(tables)
    unsound = _leave_out_unsound(rest)
    try:
        prepare(validate(rest, str(file), file.parent))
    except ScenarioError as error:
        found = [each.removeprefix(f"{file}: ") for each in error.mistakes]
        lines = [f"{file}: {each}" for each in found if not any(_touches(each, path) for path in unsound)]
        return blame(lines, str(file), overrides)
    return []


def _leave_out_unsound(tables: dict[str, Any]) -> list[Path]:
    """Remove the wrong entries from `tables`, and return their paths. An array is removed as a whole, so that no index
    shifts."""
    try:
        Scenario.model_validate(tables)
    except ValidationError as error:
        paths = {_keys(each["loc"]): None for each in error.errors(include_url=False)}
    else:
        return []
    for path in paths:
        table: Any = tables
        for key in path[:-1]:
            table = table.get(key) if isinstance(table, dict) else None
        if isinstance(table, dict) and path:
            table.pop(path[-1], None)
    return list(paths)


def _keys(where: tuple[int | str, ...]) -> Path:
    keys: list[str] = []
    for key in where:
        if isinstance(key, int):
            break
        keys.append(key)
    return tuple(keys)


def _touches(line: str, path: Path) -> bool:
    """Return whether the path of a line is `path`, or one of the two contains the other."""
    place = tuple(line.partition(": ")[0].split("."))
    shared = min(len(place), len(path))
    return place[:shared] == path[:shared]
