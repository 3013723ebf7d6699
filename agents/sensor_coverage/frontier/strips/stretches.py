"""The stretches of wall of a walk, and their ends."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence

from zwerm.agents.sensor_coverage.frontier.directions import angle_between
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import (
    Contact,
    FollowedStretch,
    Pocket,
    StretchEnd,
    Vector,
    direction_of,
    end_of_stretch,
    place_of_robot,
)
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    BLIND_MAX,
    POCKET_RAD,
    TouchCounter,
    Walk,
    WalkPoint,
    is_backward,
)


def pocket_of(
    stretch: FollowedStretch,
    number: int,
    at: Vector,
    there_rad: float,
    before: StretchEnd | None = None,
    ends_rad: tuple[float | None, float | None] = (None, None),
) -> Pocket | None:
    """Return the pocket beside a robot that was touched at the point with this number, or None if that is no end of a way.

    The walking robot was at the place `at` then. The touched robot sees it in a direction [rad], and saw it at the first and
    the last point of the stretch in the directions `ends_rad` [rad], if it did. There is no pocket if the standing robot is
    between the end of the way and the wall: the walking robot passed it meanwhile.
    """
    if stretch.first_number == stretch.last_number:
        return None  # the way of a single point leads nowhere
    is_last = stretch.last_number <= number <= stretch.last_number + BLIND_MAX
    if not (is_last or stretch.first_number - BLIND_MAX <= number <= stretch.first_number):
        return None
    place = place_of_robot(at, there_rad, stretch.radius_m)
    in_touch = number in (stretch.first_number, stretch.last_number)
    end = stretch.last if is_last else stretch.first
    if angle_between(direction_of(place, end.at), direction_of(place, end.touched)) > POCKET_RAD:
        return None
    if is_last:
        return Pocket(stretch.last, stretch.first, stretch.radius_m, True, place, in_touch, end_rad=ends_rad[1])
    return Pocket(stretch.first, stretch.last, stretch.radius_m, False, place, in_touch, before, ends_rad[0])


def pockets_beside(
    slot: int, number: int, points: Sequence[WalkPoint], stretches: Sequence[FollowedStretch], hand: int
) -> Iterator[tuple[int, Pocket]]:
    """Yield the pockets beside a slot whose robot the walking robot touches at a point, by the first points of their stretches.

    The point has this number in its walk, with the wall at the `hand`. A robot that passes between others and a wall has that
    at its other hand: then what the way and the wall enclose is on the other side of the end, and there is no pocket.
    """
    point, before = points[number], None
    for each in stretches:
        ends_rad = points[each.first_number].seen.get(slot), points[each.last_number].seen.get(slot)
        pocket = pocket_of(each, number, point.at, point.seen[slot], before, ends_rad)
        if pocket is not None:
            last = each.last_number if pocket.is_last else each.first_number + 1
            if not is_backward(points[last - 1], points[last], hand):
                yield each.first_number, pocket
        before = each.last


class StretchTracker:
    """Finds the stretch of wall that a walking robot follows with the wall at its `hand`. A stretch ends at standing robots.

    `latest` is the latest stretch, as far as it was followed: None before the first wall. `found` has all stretches by the
    numbers of their first points.
    """

    def __init__(self, hand: int, radius_m: float) -> None:
        self.latest: FollowedStretch | None = None
        self.found: dict[int, FollowedStretch] = {}
        self._hand, self._radius_m = hand, radius_m
        self._touch = TouchCounter()
        self._since = -1
        self._met = False  # robots, since the latest wall
        self._first: list[Contact] = []  # the first two contacts of the stretch, and the last two
        self._last: list[Contact] = []
        self._robots: deque[Sequence[int]] = deque(maxlen=BLIND_MAX + 1)  # touched at the latest points
        self._ties: tuple[dict[int, None], dict[int, None]] = {}, {}

    @property
    def touch_since(self) -> int:
        """The number of the point since which the robot follows the wall."""
        return self._touch.since

    def take(
        self,
        number: int,
        at: Vector,
        walls: Sequence[float],
        robots: Sequence[int],
        seen: Iterable[int],
        at_body: bool = False,
        left_walls: bool = False,
    ) -> None:
        """Take in the point with this number: the place, the walls and robots in touch, who saw it; see `WalkPoint`."""
        self._touch.take(number, walls, at_body, left_walls)
        self._robots.append(robots)
        latest = self.latest
        if not walls:
            self._met = self._met or bool(robots)
            if latest is not None and robots and number <= latest.last_number + BLIND_MAX:
                self._ties[1].update(dict.fromkeys(robots))
                self._note(latest._replace(last=latest.last._replace(ties=tuple(self._ties[1]))))
            return
        if latest is None or self._touch.since != self._since or self._met:
            latest = None
            self._first = []
            self._last = []
            self._ties = dict.fromkeys(each for robots in self._robots for each in robots), {}
        self._since, self._met = self._touch.since, False
        if len(self._first) < 2:
            self._first.append((at, walls))
        self._last = [*self._last[-1:], (at, walls)]
        self._ties = self._ties[0], dict.fromkeys(robots)
        seen = tuple(seen)
        first_number, first_seen = (number, seen) if latest is None else (latest.first_number, latest.first.seen)
        first = end_of_stretch(self._first, self._hand, self._radius_m, False)
        last = end_of_stretch(self._last, self._hand, self._radius_m, True)
        first = first._replace(ties=tuple(self._ties[0]), seen=first_seen)
        last = last._replace(ties=tuple(self._ties[1]), seen=seen)
        self._note(FollowedStretch(first_number, number, first, last, self._radius_m))

    def _note(self, stretch: FollowedStretch) -> None:
        self.latest = self.found[stretch.first_number] = stretch


def stretches_of(walk: Walk) -> dict[int, FollowedStretch]:
    """Return the stretch of wall of each point of a walk in touch with a wall. A stretch ends at standing robots."""
    tracker = StretchTracker(walk.hand, walk.radius_m)
    first_numbers: dict[int, int] = {}
    for number, point in enumerate(walk.points):
        if not point.is_bridged:
            tracker.take(number, point.at, point.walls, point.robots, point.seen, point.at_body, point.left_walls)
        if point.walls and tracker.latest is not None:
            first_numbers[number] = tracker.latest.first_number
    found, last = tracker.found, tracker.latest
    if walk.end is not None and last is not None and last.last_number + BLIND_MAX >= len(walk.points) - 1:
        found[last.first_number] = last.tied_at_end(walk.end)
    return {number: found[first_number] for number, first_number in first_numbers.items()}
