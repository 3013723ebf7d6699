"""Faults: what goes wrong on purpose, and when. The schedule is data: `[[faults]]` tables in the scenario.

Every fault begins at a time or on a condition, and lasts for a time, until a time, until a `heal`, or to the end of the
run. While it lasts it is in force, and that is all there is to it: what a node, a link or a sensor suffers at a tick follows
from the faults in force at that tick. `radio`, `nodes` and `sensing` hold the kinds, `schedule` makes them come and go.
"""

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from zwerm.scenario.types import ARRAY, NonNegative, Positive, Table
from zwerm.world.radio import NodeName

Nodes = Annotated[list[NodeName], Field(min_length=1)]
Robots = Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1)]
Share = Annotated[float, Field(gt=0, le=1)]


class WhenTable(Table):
    """A condition: that a metric of coverage has reached `at_least`, or that `robot_deployed` has entered the arena."""

    metric: Literal["cell_coverage_fraction", "area_coverage_fraction"] | None = None
    at_least: Share | None = None
    robot_deployed: Annotated[int, Field(ge=0)] | None = None


class FaultTable(Table):
    """When a fault begins, `at_s` or `when`, and how long it lasts, `for_s` or `until_s`; without either, to the end.

    Or it begins at a time that the seed draws, uniformly, from `between_s`.
    """

    lasts: ClassVar[bool] = True  # whether it takes time, or happens at once

    at_s: NonNegative | None = None
    between_s: Annotated[tuple[NonNegative, NonNegative], ARRAY] | None = None
    when: WhenTable | None = None
    for_s: Positive | None = None
    until_s: Positive | None = None


def ticks(time_s: float, dt_s: float) -> int:
    """Return the first tick at or after `time_s`."""
    return math.ceil(time_s / dt_s - 1e-9)
