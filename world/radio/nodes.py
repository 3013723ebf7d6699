"""Nodes of a radio by the names that a scenario uses: a robot's id, `base` or `coordinator`."""

from collections.abc import Sequence

import numpy as np

from zwerm.scenario.tables import Scenario
from zwerm.world.radio import NodeName
from zwerm.world.scene import Bools


def node_count(scenario: Scenario) -> int:
    """Return the number of nodes: robots, and the coordinator if there is one, whose id is the largest."""
    return scenario.robots.count + (scenario.coordinator is not None)


def node_id(name: NodeName, scenario: Scenario) -> int:
    """Return the id of the node that `name` names. Raises ValueError, in one line, if there is none."""
    count = scenario.robots.count
    if name == "coordinator":
        if scenario.coordinator is None:
            raise ValueError("the scenario has no coordinator")
        return count
    if name == "base":
        if scenario.base is None:
            raise ValueError("the scenario has no base station")
        return 0
    if not 0 <= name < count:
        raise ValueError(f"no such robot: ids are 0 to {count - 1}, got {name}")
    return name


def selected(names: Sequence[NodeName] | None, scenario: Scenario, path: str, wrong: list[str]) -> Bools:
    """Return (nodes,) whether a node is named, all of them if `names` is None; add a line to `wrong` for each unknown name."""
    if names is None:
        return np.ones(node_count(scenario), dtype=np.bool_)
    chosen = np.zeros(node_count(scenario), dtype=np.bool_)
    for index, name in enumerate(names):
        try:
            chosen[node_id(name, scenario)] = True
        except ValueError as error:
            wrong.append(f"{path}.{index}: {error}")
    return chosen
