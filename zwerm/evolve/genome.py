"""The parameters of a controller that a search may change: every number with a least and a greatest value."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from zwerm.agents.runtime.controllers import find, parameters_of
from zwerm.errors import ScenarioError
from zwerm.scenario.tables import Scenario
from zwerm.world.scene import Floats


@dataclass(frozen=True)
class Genome:
    """The `names` of k parameters, and their `bounds` (k, 2): least and greatest. `others` are parameters that stay."""

    names: tuple[str, ...]
    bounds: Floats
    others: dict[str, Any]

    def parameters(self, values: Sequence[float]) -> dict[str, Any]:
        """Return the controller's parameters for a candidate's values (k,)."""
        return self.others | {name: float(value) for name, value in zip(self.names, values, strict=True)}


def genome_of(scenario: Scenario) -> Genome:
    """Return the genome of a scenario's robots.

    Raises ScenarioError for a controller with fewer than two parameters that have both bounds: CMA-ES needs two.
    """
    controller = scenario.robots.controller
    found: dict[str, tuple[float, float]] = {}
    for each in msgspec.inspect.type_info(parameters_of(find(controller))).fields:  # type: ignore[attr-defined]
        if isinstance(each.type, msgspec.inspect.FloatType) and each.type.ge is not None and each.type.le is not None:
            found[each.name] = (each.type.ge, each.type.le)
    if len(found) < 2:
        raise ScenarioError(
            [
                f"{scenario.place}: robots.controller: expected one with two or more numbers that have a least and a greatest "
                f"value, got {controller!r} with {len(found)}"
            ]
        )
    others = {name: value for name, value in scenario.robots.parameters.items() if name not in found}
    return Genome(tuple(found), np.array(list(found.values()), dtype=np.float64), others)
