"""Radio models of a user's own, for tests: both drop everything, and differ in what they say of the receivers."""

from typing import Any, ClassVar

import numpy as np

from zwerm.world.radio import Air, LinkTable, ModelPlace, Packets, Verdict


class Lossy:
    """Loses everything."""

    kind: ClassVar[str] = "lossy"
    cause: ClassVar[str] = "silence"
    needs_positions: ClassVar[bool] = False
    Parameters: ClassVar[type[LinkTable]] = LinkTable

    def __init__(self, parameters: Any, place: ModelPlace) -> None:
        pass

    def judge(self, air: Air, packets: Packets) -> Verdict:
        return Verdict(np.ones(len(packets), dtype=np.bool_))


class Shadowed(Lossy):
    """Finds every receiver out of reach."""

    out_of_reach: ClassVar[bool] = True
