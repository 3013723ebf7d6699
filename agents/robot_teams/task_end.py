"""The end of a robot's part of the task: all is covered, or nothing that the robot can reach is open. No radio, no motion."""

import math
from typing import Final

from zwerm.agents.robot_teams.mapping.facts import End, Wreck
from zwerm.agents.robot_teams.mapping.slice_map import CoverageCertificate, SliceMap
from zwerm.agents.robot_teams.motion.manoeuvres import SliceGrid
from zwerm.agents.robot_teams.motion.senses import DEAD_M, GAP_M, Senses

# A robot nearer than this to an end, or to its segment, stands in the same part of the free space: no wall and no wreck
# fits between [m].
AT_PLACE_M: Final = 0.1


def reason(certificate: CoverageCertificate) -> str:
    """Return why a robot gives up that reaches nothing of what is open; empty if nothing is open."""
    count = len(certificate.ends_without_mate) + len(certificate.open_ports)
    return f"blocked: no way leads to {count} open ends and ports" if count else ""


class TaskEnd:
    """Whether one robot is `done`, or why it `gave_up`.

    A wreck may stand between the robot and the end that it took for its place. What that end reaches then says nothing of
    what the robot reaches. So the robot has to stand at an end again after every new wreck.
    """

    def __init__(self, slice_map: SliceMap, grid: SliceGrid, radius_m: float) -> None:
        self.done = False
        self.gave_up = ""
        self._map, self._grid = slice_map, grid
        # A robot this near to a wreck touches it: distance of the two centres [m].
        self._touch_m = 2.0 * radius_m + GAP_M + DEAD_M
        # The wrecks that were known when the robot last stood at an end.
        self._placed: frozenset[Wreck] = frozenset()

    @property
    def over(self) -> bool:
        """True if the robot is done or gave up."""
        return self.done or bool(self.gave_up)

    @property
    def is_placed(self) -> bool:
        """True if the robot stood at its end since it learned of the newest wreck, so that no wreck divides the two."""
        return self._placed >= self._map.wrecks

    def judge(self, here: End | None, senses: Senses) -> None:
        """Decide anew; `here` is the known end that the robot takes for its place."""
        slice_map = self._map
        if here is not None and not self.is_placed and self._is_at(here, senses):
            self._placed = slice_map.wrecks
        self.done, self.gave_up = False, ""
        if self.is_placed and slice_map.complete_from(here):
            if slice_map.wrecks and not slice_map.certificate.complete:
                self.hide_closed_ports()
            self.done = slice_map.certificate.complete
            self.gave_up = "" if self.done else reason(slice_map.certificate)

    def hide_closed_ports(self) -> None:
        """Add to the map which ends a wreck hides because a robot there touches it, and the open arc goes towards it.

        No way leads to such an end. The arc passes between the wreck and the wall, where no robot goes.
        """
        certificate, voids = self._map.certificate, self._map.voids
        for end, direction in certificate.open_ports:
            if end in certificate.ends_without_mate:
                continue
            # The wreck is at the middle of the smallest of its voids: the last one in this order is kept.
            there = [void for void in voids if void.slice == end.slice]
            least = {void.wreck: void for void in sorted(there, key=lambda each: each.low_mm - each.high_mm)}
            for void in least.values():
                dx = void.x_mm / 1000.0 - self._grid.x_m(end.slice)
                dy = (void.low_mm + void.high_mm - 2 * end.y_mm) / 2000.0
                if dx * direction > 0.0 and math.hypot(dx, dy) < self._touch_m:
                    low, high = min(void.low_mm, end.y_mm), max(void.high_mm, end.y_mm)
                    self._map.add(void._replace(low_mm=low, high_mm=high))

    def _is_at(self, end: End, senses: Senses) -> bool:
        """Return whether the robot stands at an end, or on the swept segment to its mate, and no wreck blocks that."""
        mate = self._map.mate(end)
        low, high = sorted((end.y_mm, end.y_mm if mate is None else mate.stop.y_mm))
        dx, y_m = senses.x_m - self._grid.x_m(end.slice), senses.y_m
        dy = max(low / 1000.0 - y_m, y_m - high / 1000.0, 0.0)
        return dx * dx + dy * dy <= AT_PLACE_M**2
