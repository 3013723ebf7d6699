"""The perception of a robot at one tick, in the frame of its compass, in which all robots have the same directions."""

import math
from typing import Final

import numpy as np

from zwerm.agents.landmark_exploration.mapping.bearing_steps import LANDMARKS_MAX, BearingSnapshot, all_to_steps
from zwerm.wire.messages import BodyVelocity, Observation

_FULL: Final = 2.0 * math.pi


class ExplorerView:
    """Landmarks by bearing [rad], the directions of contacts [rad], and the time in ticks since the robot began."""

    def __init__(self) -> None:
        self.tick = 0
        self.heading_rad = 0.0
        self.bearing: dict[int, float] = {}
        self.contacts: tuple[float, ...] = ()
        self.snapshot = BearingSnapshot((), ())

    def take(self, observation: Observation) -> None:
        """Store an observation. Landmarks with ids of LANDMARKS_MAX or more are left out: they do not fit into an entry."""
        self.tick += 1
        heading = self.heading_rad = observation.compass_rad or 0.0
        seen = observation.landmarks or ()
        self.bearing = {each.landmark: each.bearing_rad + heading for each in seen if each.landmark < LANDMARKS_MAX}
        self.snapshot = BearingSnapshot(tuple(self.bearing), all_to_steps(self.bearing.values()))
        self.contacts = tuple([each.bearing_rad + heading for each in observation.touch or ()])

    def drive(self, direction_rad: float | None, speed_m_s: float) -> BodyVelocity:
        """Return the drive that moves the body in a direction of the compass frame, or stops it where that is None."""
        if direction_rad is None:
            return BodyVelocity()
        ahead_rad = direction_rad - self.heading_rad
        return BodyVelocity(speed_m_s * math.cos(ahead_rad), speed_m_s * math.sin(ahead_rad), 0.0)


def apart_rad(a_rad: float, b_rad: float) -> float:
    """Return the angle between two directions, in [0, pi]."""
    between = abs(a_rad - b_rad) % _FULL
    return min(between, _FULL - between)


class Slide:
    """Slides along obstacles: turns the wanted direction away from contacts, to the same side for a time."""

    # Ticks for which a side is kept after the last contact.
    KEEP_TICKS: Final = 15
    # Ticks for which it is kept at most: in a corner one side leads from wall to wall without end.
    HAND_TICKS_MAX: Final = 60
    # The wanted direction is turned in steps of this size until it leads away from every contact.
    _TURN_RAD: Final = math.radians(12.0)

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._hand = 0
        self._until = 0
        self._hand_until = 0

    def along(self, direction_rad: float | None, view: ExplorerView) -> float | None:
        """Return the direction to drive in; None where every direction is blocked."""
        if direction_rad is None or not view.contacts:
            return direction_rad
        if view.tick >= min(self._until, self._hand_until):
            self._hand = 0
        self._until = view.tick + self.KEEP_TICKS
        if self._is_free(direction_rad, view):
            return direction_rad
        if self._hand == 0:
            self._hand_until = view.tick + self.HAND_TICKS_MAX
            left, right = self._turned(direction_rad, view, 1), self._turned(direction_rad, view, -1)
            if left is None or right is None:
                return None
            nearer = apart_rad(left, direction_rad) - apart_rad(right, direction_rad)
            self._hand = (
                (1 if self._random.random() < 0.5 else -1) if abs(nearer) < 0.1 else (1 if nearer < 0.0 else -1)
            )
        return self._turned(direction_rad, view, self._hand)

    def _turned(self, direction_rad: float, view: ExplorerView, hand: int) -> float | None:
        for step in range(1, 30):
            turned = direction_rad + hand * step * self._TURN_RAD
            if self._is_free(turned, view):
                return turned
        return None

    @staticmethod
    def _is_free(direction_rad: float, view: ExplorerView) -> bool:
        return all(math.cos(direction_rad - contact) <= 0.05 for contact in view.contacts)
