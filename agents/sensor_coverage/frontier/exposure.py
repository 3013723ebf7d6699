"""What would come open if a place were left: sides of edges, and gaps so wide that one expands there.

The link criterion (`zwerm.maths.simplicial.may_leave`) says whether a hole would come; this says whether somebody would be sent
there again all the same.
"""

from collections.abc import Iterable

from zwerm.agents.sensor_coverage.frontier.fence import Views, fence, wedges
from zwerm.agents.sensor_coverage.frontier.planner import VERTEX_BESIDE_RAD
from zwerm.agents.sensor_coverage.frontier.services import ScanResult
from zwerm.maths.simplicial import Edge, FlagComplex


def opens(picture: ScanResult, place: int, corner_margin_rad: float) -> bool:
    """Tell whether something would come open beside the neighbours of a place if that were left."""
    views, complex_, _ = picture
    around = complex_.neighbours[place]
    edges = [each for each in complex_.edges if each[0] in around and each[1] in around]
    now, then = (_open(views, each, edges, around, corner_margin_rad) for each in (complex_, complex_.without([place])))
    return any(each not in now for each in then)


def _open(
    views: Views, complex_: FlagComplex, edges: Iterable[Edge], around: Iterable[int], corner_margin_rad: float
) -> list[tuple[int, int, int]]:
    """Return the open sides of edges, and the wide gaps around vertices."""
    sides = fence(views, complex_, corner_margin_rad, edges).sides
    gaps = wedges(views, complex_, around)
    wide = [(i, a, b) for i, a, b, gap_rad in gaps if gap_rad >= 2.0 * VERTEX_BESIDE_RAD]
    return [*((each.i, each.j, each.sign) for each in sides), *wide]
