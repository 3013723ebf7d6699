"""What is added to the cost of a route for the kind of frontier at its end: the kinds are expanded one after the other."""

from collections.abc import Sequence
from typing import Final

from zwerm.agents.sensor_coverage.frontier.plan import Plan

# A robot that does not know yet whether it is at the frontier. Other robots do not push there.
DOUBT_COST: Final = 1_000.0
# A robot at a gap. Gaps are expanded when no edge can be expanded and no robot is in doubt.
GAP_COST: Final = 10_000.0
# A robot with a wide open arc, from which a robot must follow a wall. That comes after all edges and gaps.
WALL_COST: Final = 20_000.0
# A robot whose open arcs are all narrow.
NARROW_COST: Final = 40_000.0


def wall_cost(plans: Sequence[Plan]) -> float | None:
    """Return the cost of plans to follow walls, or None if there are none."""
    if not plans:
        return None
    return NARROW_COST if all(each.narrow for each in plans) else WALL_COST
