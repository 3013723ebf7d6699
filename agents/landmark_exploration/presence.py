"""Navigation without bearings: by which landmarks are seen, the compass, contact, and the robot's own steps.

A landmark appears and disappears at the range of sight, if no wall hides it. So a robot that knows the direction of its
steps learns where landmarks are relative to it: at each of these events the landmark is one range away, and one that
appears is ahead. `PresenceTracker` keeps the newest events of each landmark, and the place that agrees with them. Walls
that hide a landmark, and contacts that shorten a step, make places wrong for a while. `seek` follows a path of
observations by these places, as `motion.travel` does by bearings.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.landmark_complex import SHARED_MIN
from zwerm.agents.landmark_exploration.motion import Drive
from zwerm.agents.landmark_exploration.view import ExplorerView
from zwerm.maths.sums import added

# Ticks after which the place of a landmark that is not seen is dropped.
DROP_TICKS: Final = 120
# A place is dropped, too, if its landmark is not seen from within this fraction of the range.
DISPROVED: Final = 0.7
# Events of a landmark that are kept, and passes over them that move its place onto their circles.
EVENTS_MAX: Final = 5
PASSES: Final = 4
# Ticks for each vertex of the path, and for one more, before the robot gives the path up.
SEEK_TICKS: Final = 120
# The robot is at a place if the distance is less than this [steps].
NEAR_STEPS: Final = 1.0
# Ticks of a straight walk if the robot is at its target place, and does not see the landmarks that it expected there.
SEARCH_TICKS: Final = 12
# Lengths of the successive walks if it sees more than half of these landmarks.
LOCAL_SEARCH_TICKS: Final = (2, 4, 6, 8)
# Searches without any landmark of the path in view before the robot gives the path up.
LOST_MAX: Final = 5
# The deviation of its direction [rad] from the one that leads away from landmarks that are not expected there.
SEARCH_SD_RAD: Final = 0.8

Place = tuple[float, float]


class PresenceTracker:
    """The places of landmarks relative to the robot, in steps and in the compass frame, `range_steps` the range of sight."""

    def __init__(self, range_steps: float) -> None:
        self.places: dict[int, Place] = {}
        self._range_steps = range_steps
        self._events: dict[int, list[Place]] = {}  # places of the robot, relative to where it is now
        self._seen_at: dict[int, int] = {}

    def update(self, view: ExplorerView, moved_rad: float | None) -> None:
        """Update the places after a step in the direction `moved_rad`, or after a tick without a step."""
        dx, dy = (0.0, 0.0) if moved_rad is None else (math.cos(moved_rad), math.sin(moved_rad))
        tick, range_steps, seen = view.tick, self._range_steps, view.bearing
        for landmark, (x, y) in list(self.places.items()):
            self.places[landmark] = x, y = x - dx, y - dy
            self._events[landmark] = [(ex - dx, ey - dy) for ex, ey in self._events[landmark]]
            length = math.hypot(x, y)
            if landmark in seen:
                if self._seen_at[landmark] < tick - 1:
                    self._cross(landmark, dx, dy)
                elif length > range_steps:
                    self.places[landmark] = _onto_circle((x, y), (0.0, 0.0), range_steps)
            elif self._seen_at[landmark] == tick - 1:
                self._cross(landmark, dx, dy)
            elif length < DISPROVED * range_steps or tick - self._seen_at[landmark] > DROP_TICKS:
                del self.places[landmark], self._events[landmark], self._seen_at[landmark]
        for landmark in seen:
            if landmark not in self.places:
                ahead = 0.0 if tick == 1 else range_steps
                self.places[landmark] = ahead * dx, ahead * dy
                self._events[landmark] = [] if tick == 1 else [(-0.5 * dx, -0.5 * dy)]
            self._seen_at[landmark] = tick

    def events(self, landmark: int) -> Sequence[Place]:
        """Return where the robot was, relative to now [steps], when a landmark last appeared or disappeared."""
        return self._events.get(landmark, ())

    def _cross(self, landmark: int, dx: float, dy: float) -> None:
        """Record that a landmark appeared or disappeared during the step (dx, dy), one range away."""
        events = self._events[landmark] = [*self._events[landmark], (-0.5 * dx, -0.5 * dy)][-EVENTS_MAX:]
        place = self.places[landmark]
        for _ in range(PASSES):
            for event in events:
                place = _onto_circle(place, event, self._range_steps)
        self.places[landmark] = place

    def toward(self, landmarks: Sequence[int]) -> Place | None:
        """Return the way [steps] to the middle of `landmarks`: to where the farthest known one is nearest; or None."""
        known = [self.places[each] for each in landmarks if each in self.places]
        middle = _mean(known)
        if middle is None:
            return None
        x, y = middle
        for number in range(2, 20):  # Badoiu and Clarkson 2003: the centre of the smallest enclosing circle
            far_x, far_y = max(known, key=lambda place: (place[0] - x) ** 2 + (place[1] - y) ** 2)
            x, y = x + (far_x - x) / number, y + (far_y - y) / number
        return x, y

    def onward(self, view: ExplorerView, landmarks: Sequence[int]) -> float | None:
        """Return the direction [rad] from the landmarks that are seen and not in `landmarks` to those that are, or None."""
        inside = _mean([self.places[each] for each in view.bearing if each in landmarks])
        outside = _mean([self.places[each] for each in view.bearing if each not in landmarks])
        if inside is None or outside is None:
            return None
        return math.atan2(inside[1] - outside[1], inside[0] - outside[0])


def _onto_circle(place: Place, centre: Place, radius: float) -> Place:
    x, y = place[0] - centre[0], place[1] - centre[1]
    length = math.hypot(x, y)
    if length == 0.0:
        return place
    return centre[0] + x * radius / length, centre[1] + y * radius / length


def _mean(places: Sequence[Place]) -> Place | None:
    if not places:
        return None
    return added(x for x, _ in places) / len(places), added(y for _, y in places) / len(places)


def seek(
    tracker: PresenceTracker,
    view: ExplorerView,
    path: Sequence[BearingSnapshot],
    random: np.random.Generator,
    arrived: Callable[[], bool],
) -> Drive:
    """Follow `path` until `arrived()`, aiming at the farthest vertex of which enough landmarks are seen."""
    until = view.tick + SEEK_TICKS * (len(path) + 1)
    aim, searches, lost = -1, 0, 0
    while not arrived():
        aim = _aim(view, path, aim)
        lost = lost + 1 if aim < 0 else 0
        if view.tick >= until or lost > LOST_MAX:
            return "unreached"
        way = onward = None
        is_near = False
        if aim >= 0:
            landmarks = path[aim].landmarks
            way, onward = tracker.toward(landmarks), tracker.onward(view, landmarks)
            is_near = 2 * sum(landmark in view.bearing for landmark in landmarks) > len(landmarks)
        if way is not None and math.hypot(*way) >= NEAR_STEPS:
            yield math.atan2(way[1], way[0])
            continue
        ticks = SEARCH_TICKS
        if is_near:
            ticks = LOCAL_SEARCH_TICKS[searches % len(LOCAL_SEARCH_TICKS)]
            searches += 1
        if onward is None or is_near:
            direction = float(random.uniform(-math.pi, math.pi))
        else:
            direction = onward + float(random.normal(0.0, SEARCH_SD_RAD))
        for _ in range(ticks):
            yield direction
            if arrived():
                break
    return "arrived"


def _aim(view: ExplorerView, path: Sequence[BearingSnapshot], aim: int) -> int:
    """Return the number of the farthest vertex of which enough landmarks are seen, or of `aim` if any of its are; or -1.

    A robot that kept no aim could alternate between two of them.
    """
    for number in range(len(path) - 1, -1, -1):
        shared = sum(landmark in view.bearing for landmark in path[number].landmarks)
        if shared >= SHARED_MIN or (shared and number == aim):
            return number
    return -1
