"""Walks along walls, as the swarm remembers them: in directions from the slots that saw them."""

from collections.abc import Mapping
from typing import NamedTuple


class Arc(NamedTuple):
    """Directions from `start_rad` to the left, over `width_rad`."""

    start_rad: float
    width_rad: float


class WalkPoint(NamedTuple):
    """A point of a walk: the direction [rad] to it from each slot that it sees, the directions of walls that it touches.

    `robots` are the slots that the walking robot touches.
    """

    seen: Mapping[int, float]
    walls: tuple[float, ...]
    robots: tuple[int, ...]

    @property
    def in_touch(self) -> bool:
        """True if the walking robot touched anything."""
        return bool(self.walls or self.robots)

    def turned(self, by: float) -> "WalkPoint":
        """Return the same point with all directions turned by an angle [rad]."""
        return WalkPoint(
            {slot: each + by for slot, each in self.seen.items()}, tuple(each + by for each in self.walls), self.robots
        )


class Walk(NamedTuple):
    """A stretch of wall that a robot followed, in the frame of one robot; `hand` is +1 if the wall was on the left."""

    frame: int
    hand: int
    points: tuple[WalkPoint, ...]

    def turned(self, frame: int, by: float) -> "Walk":
        """Return the walk in another frame."""
        return Walk(frame, self.hand, tuple(each.turned(by) for each in self.points))
