"""Redundant robots by relative homology. Ramaithitima et al. 2015, section III-D."""

from collections.abc import Collection

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.maths.simplicial import Edge, find_redundant


class RelativeHomology:
    """The vertices that a small relative 2-cycle through the fence does not use; base stations stay."""

    def redundant(self, scan: ScanResult, boundary_edges: Collection[Edge]) -> tuple[int, ...]:
        """Return slots that can all be vacated together: the remaining robots still cover all that is covered."""
        missed_max = 1 + len(scan.complex_.vertices) // 50
        return find_redundant(scan.complex_, boundary_edges, scan.bases, missed_max).redundant
