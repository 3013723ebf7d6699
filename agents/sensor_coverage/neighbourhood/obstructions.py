"""Attempts to expand that a body stopped: the space behind a dead robot may be unseen."""

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Final

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.frontier.fence import VERTEX_BESIDE_RAD, Fence, wedges
from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.messages.beacons import StateBeacon

# A body is seen from the other side if the directions to it differ by more than this [rad].
BEHIND_RAD: Final = math.pi / 2.0


class Obstructions:
    """The attempts from one slot that bodies stopped.

    `stopped` has the robot whose body stopped an attempt, by the attempt's key. `finished` are dead robots that claimed no
    frontier when they died.
    """

    def __init__(self) -> None:
        self.stopped: dict[tuple[int, ...], int] = {}
        self.finished: dict[int, None] = {}

    def count(
        self,
        me: int,
        scan: ScanResult,
        fence: Fence,
        seen: Mapping[int, float],
        known: Collection[int],
        mutual: Iterable[StateBeacon],
    ) -> int:
        """Return the number of sides and gaps at slot `me` that are closed only by the body of a dead robot.

        No robot must look behind a dead robot that did not claim a frontier when it died. The same holds if a neighbour of
        `mutual` sees the body from the other side. `seen` has the directions [rad] of visible robots; those in `known` live.
        """
        if not self.stopped:
            return 0
        sides = {(*side.edge, side.sign) for side in fence.sides}
        around = {(me, a) for _, a, _, gap in wedges(scan.views, scan.complex_, [me]) if gap >= 2.0 * VERTEX_BESIDE_RAD}
        mutual = tuple(mutual)
        return sum(
            (key[:3] in sides or (key[2] == 0 and key[:2] in around))
            and not self._is_seen_past(body, seen, known, mutual)
            for key, body in self.stopped.items()
        )

    def _is_seen_past(
        self, body: int, seen: Mapping[int, float], known: Collection[int], mutual: Iterable[StateBeacon]
    ) -> bool:
        if body in self.finished or body in known or body not in seen:
            return True
        return any(
            each.node == body and angle_between(each.direction_rad, seen[body]) > BEHIND_RAD
            for state in mutual
            for each in state.seen
        )
