"""The stretches of wall of a walk, and their ends."""

from typing import NamedTuple

from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import StretchEnd, ends_of_stretch
from zwerm.agents.sensor_coverage.frontier.wall_proof import BLIND_MAX, TouchCounter, Walk


class Pocket(NamedTuple):
    """An end of a stretch at which the walking robot touched a standing robot, and a body's radius [m].

    `is_last` is true for the last point of the stretch.
    """

    end: StretchEnd
    radius_m: float
    is_last: bool


class FollowedStretch(NamedTuple):
    """A stretch of wall: the numbers of its first and last points of a walk, its ends, and the radius of a body [m]."""

    first_number: int
    last_number: int
    first: StretchEnd
    last: StretchEnd
    radius_m: float

    def pocket(self, number: int) -> Pocket | None:
        """Return the pocket at the point with this number, or None if it is no end of a way."""
        if self.first_number == self.last_number or number not in (self.first_number, self.last_number):
            return None  # the way of a single point leads nowhere
        is_last = number == self.last_number
        return Pocket(self.last if is_last else self.first, self.radius_m, is_last)


def stretches_of(walk: Walk) -> dict[int, FollowedStretch]:
    """Return the stretch of wall of each point of a walk in touch with a wall. A stretch ends at standing robots."""
    touch = TouchCounter()
    numbered: list[list[int]] = []
    since, robots = -1, False
    for number, point in enumerate(walk.points):
        touch.take(number, point.walls, point.at_body, point.left_walls)
        if not point.walls:
            robots = robots or bool(point.robots)
            continue
        if touch.since != since or robots:
            numbered.append([])
        since, robots = touch.since, False
        numbered[-1].append(number)
    found: dict[int, FollowedStretch] = {}
    for numbers in numbered:
        contacts = [(walk.points[each].at, walk.points[each].walls) for each in numbers]
        ends = ends_of_stretch(contacts, walk.hand, walk.radius_m)
        first, last = numbers[0], numbers[-1]
        beside = walk.points[max(0, first - BLIND_MAX) : first + 1], walk.points[last : last + BLIND_MAX + 1]
        ties = [[slot for point in points for slot in point.robots] for points in beside]
        if walk.end is not None and last + BLIND_MAX >= len(walk.points) - 1:
            ties[1].append(walk.end)
        tied = [end._replace(ties=tuple(dict.fromkeys(each))) for end, each in zip(ends, ties, strict=True)]
        found |= dict.fromkeys(numbers, FollowedStretch(first, last, tied[0], tied[1], walk.radius_m))
    return found
