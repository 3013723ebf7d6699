"""Who can be spared, by relative homology. Ramaithitima et al. 2015, section III-D."""

from collections.abc import Collection

from zwerm.agents.sensor_coverage.frontier.services import ScanResult
from zwerm.maths.simplicial import Edge, sparing


class RelativeHomology:
    """The vertices that a small relative 2-cycle through the fence does without; base stations stay."""

    def redundant(self, picture: ScanResult, rim: Collection[Edge]) -> tuple[int, ...]:
        """Return places that can all be left at once and leave nothing uncovered."""
        missed_max = 1 + len(picture.complex_.vertices) // 50
        return sparing(picture.complex_, rim, picture.bases, missed_max).redundant
