"""Test whether an empty slot would open frontier: an uncovered side of an edge, or a wide gap around a neighbour.

The link criterion (`zwerm.maths.simplicial.may_leave`) decides whether a departure opens a hole. This module decides
whether the planner would then send another robot to the same slot.
"""

from collections.abc import Iterable

from zwerm.agents.sensor_coverage.frontier.fence import VERTEX_BESIDE_RAD, Views, fence, wedges
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.maths.simplicial import Edge, FlagComplex


def opens(scan: ScanResult, slot: int, corner_margin_rad: float) -> bool:
    """Return whether vacating a slot opens frontier beside its neighbours."""
    views, complex_, _ = scan
    around = complex_.neighbours[slot]
    edges = [each for each in complex_.edges if each[0] in around and each[1] in around]
    now, then = (_open(views, each, edges, around, corner_margin_rad) for each in (complex_, complex_.without([slot])))
    return any(each not in now for each in then)


def _open(
    views: Views, complex_: FlagComplex, edges: Iterable[Edge], around: Iterable[int], corner_margin_rad: float
) -> list[tuple[int, int, int]]:
    """Return the uncovered sides of edges, and the wide gaps around vertices."""
    sides = fence(views, complex_, corner_margin_rad, edges).sides
    gaps = wedges(views, complex_, around)
    wide = [(i, a, b) for i, a, b, gap_rad in gaps if gap_rad >= 2.0 * VERTEX_BESIDE_RAD]
    return [*((each.i, each.j, each.sign) for each in sides), *wide]
