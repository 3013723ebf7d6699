"""The points of a way along a wall close to its start, where bodies of dead robots may lie.

Whether a body counts as wall is known only when walls alone are in touch again (`dead_bodies`). So a point at a body waits
until then, as the waypoint that was made at the same place does.
"""

from collections import deque
from collections.abc import Callable

from zwerm.agents.sensor_coverage.messages.commands import Waypoint
from zwerm.agents.sensor_coverage.motion.walls.near_arcs import NearPoint, NearWay


class NearPoints:
    """Passes on the points of a way to `way`, in their order, as soon as it is known what they are in touch with."""

    def __init__(self, way: NearWay, report: Callable[[Waypoint], None]) -> None:
        self._way = way
        self._report = report
        self._waiting: deque[tuple[NearPoint, Waypoint, bool]] = deque()

    def expect(self, near: NearPoint, point: Waypoint, at_other: bool) -> None:
        """Note a point, and the waypoint at which it is; `at_other` if a robot that is no body is in touch there."""
        self._waiting.append((near, point, at_other))

    def take(self, point: Waypoint) -> None:
        """Take in the next waypoint, and report it. Where it is not the same as before, the bodies count as wall."""
        near, before, at_other = self._waiting.popleft()
        if (point.touched, point.robots) != (before.touched, before.robots):
            near = near._replace(walls=point.touched, at_body=False, at_robot=at_other)
        self._way.take(near)
        self._report(point)
