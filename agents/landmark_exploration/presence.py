"""Navigation without bearings: by which landmarks are seen, the compass, contact, and the robot's own steps.

A landmark appears and disappears at the range of sight. So a robot that knows the direction of its steps learns where landmarks
are relative to it: one that appears is ahead, and one that is seen is within the range. `PresenceTracker` keeps one
place for each landmark that agrees with the newest of these facts. Walls that hide a landmark, and contacts that shorten
a step, make places wrong for a while. `seek` follows a path of observations by these places, as `motion.travel` does by
bearings.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.landmark_complex import SHARED_MIN
from zwerm.agents.landmark_exploration.motion import STALLS_MAX, Drive
from zwerm.agents.landmark_exploration.view import ExplorerView

# Ticks after which the place of a landmark that is not seen is forgotten.
FORGET_TICKS: Final = 120
# Ticks for each vertex of the path, and one more, before the robot gives the path up.
SEEK_TICKS: Final = 120
# The robot is at a place where that is nearer than this [steps].
NEAR_STEPS: Final = 2.0
# Ticks of random motion where the robot is at the place that it aimed at, and does not see what it expected there.
SEARCH_TICKS: Final = 12

Place = tuple[float, float]


class PresenceTracker:
    """The places of landmarks relative to the robot, in steps and in the compass frame, `range_steps` the range of sight."""

    def __init__(self, range_steps: float) -> None:
        self.places: dict[int, Place] = {}
        self._range_steps = range_steps
        self._seen_at: dict[int, int] = {}

    def update(self, view: ExplorerView, moved_rad: float | None) -> None:
        """Take in what is seen after a step in the direction `moved_rad`, or after a tick without one."""
        step_x, step_y = (0.0, 0.0) if moved_rad is None else (math.cos(moved_rad), math.sin(moved_rad))
        range_steps, seen = self._range_steps, view.bearing
        for landmark, (x, y) in self.places.items():
            x, y = x - step_x, y - step_y
            length = math.hypot(x, y)
            if (landmark in seen) == (length > range_steps):
                if length == 0.0:
                    x, y, length = -step_x, -step_y, 1.0
                x, y = x * range_steps / length, y * range_steps / length
            self.places[landmark] = x, y
        for landmark in seen:
            if landmark not in self.places:
                ahead = 0.0 if view.tick == 1 else range_steps
                self.places[landmark] = ahead * step_x, ahead * step_y
            self._seen_at[landmark] = view.tick
        for landmark in [each for each, tick in self._seen_at.items() if view.tick - tick > FORGET_TICKS]:
            del self.places[landmark], self._seen_at[landmark]

    def toward(self, view: ExplorerView, landmarks: Sequence[int]) -> Place | None:
        """Return the way [steps] to where all of `landmarks` may be seen, or None where no place is known.

        Of those that are not seen it leads to the farthest. If all known ones are seen it leads to the middle of them.
        """
        known = [self.places[each] for each in landmarks if each in self.places]
        hidden = [self.places[each] for each in landmarks if each in self.places and each not in view.bearing]
        if hidden:
            return max(hidden, key=lambda place: math.hypot(*place))
        if not known:
            return None
        return sum(x for x, _ in known) / len(known), sum(y for _, y in known) / len(known)


def seek(
    view: ExplorerView,
    tracker: PresenceTracker,
    path: Sequence[BearingSnapshot],
    random: np.random.Generator,
    arrived: Callable[[], bool],
) -> Drive:
    """Follow `path` until `arrived()`, aiming at the farthest vertex of which enough landmarks are seen."""
    until = view.tick + SEEK_TICKS * (len(path) + 1)
    stalls = 0
    while not arrived():
        if view.tick >= until or stalls > STALLS_MAX:
            return "unreached"
        way = None
        for snapshot in reversed(path):
            if sum(landmark in view.bearing for landmark in snapshot.landmarks) >= SHARED_MIN:
                way = tracker.toward(view, snapshot.landmarks)
                break
        if way is not None and math.hypot(*way) >= NEAR_STEPS:
            yield math.atan2(way[1], way[0])
            continue
        stalls += 1
        direction = float(random.uniform(-math.pi, math.pi))
        for _ in range(SEARCH_TICKS):
            yield direction
            if arrived():
                break
    return "arrived"
