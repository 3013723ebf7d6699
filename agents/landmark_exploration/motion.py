"""Execution of a task by a robot: both phases of section IV-D of Ramaithitima and Bhattacharya 2018, as generators.

A generator yields, once a tick, the direction to drive in, in the compass frame (None: stand still), and returns the
outcome. Phase 1 follows a path of observations by bearings alone (the controller of section II-B). Phase 2 crosses the line
between the frontier's landmarks and searches the region behind it by a biased random walk.
"""

import math
from collections.abc import Callable, Generator, Sequence
from typing import Final, Literal

import numpy as np

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot, to_rad
from zwerm.agents.landmark_exploration.mapping.landmark_complex import SHARED_MIN
from zwerm.agents.landmark_exploration.view import ExplorerView, apart_rad
from zwerm.maths.sums import added

Direction = float | None
Outcome = Literal["cleared", "boundary", "timed-out", "unreached", "arrived"]
Drive = Generator[Direction, None, Outcome]

# The bearing-only controller has arrived where its output is shorter than this.
ARRIVED: Final = 0.08
# Ticks of random motion after the controller has arrived without the next vertex in view.
JITTER_TICKS: Final = 5
# Number of such motions before the robot gives the path up.
STALLS_MAX: Final = 15
# Ticks without progress along the path, after which the robot gives the path up.
PROGRESS_TICKS: Final = 120

# Phase 2: the sum of the unit vectors to both landmarks is shorter than this on the line between them, or near it.
NEAR_LINE: Final = 0.25
# Contact on the near side counts as contact at the line where the sum of the unit vectors is shorter than this.
AT_LINE: Final = 0.6
# Contact within this number of ticks of the crossing is an obstacle at the line, if it lasts for TOUCH_TICKS: contact with
# another robot is shorter.
CROSSED_TICKS: Final = 4
TOUCH_TICKS: Final = 6
# The angle from the outward direction, from tick to tick: the fraction that remains, and the deviation added [rad].
KEPT_ANGLE: Final = 0.9
TURN_SD_RAD: Final = 0.35

# The idle walk: the deviation of its direction [rad] from tick to tick.
WANDER_SD_RAD: Final = 0.05

# The walk without bearings: the deviation of its direction [rad], and the straight ticks after a new observation.
ROAM_SD_RAD: Final = 0.3
NEWS_TICKS: Final = 10


def homing(bearing: dict[int, float], target: dict[int, float]) -> tuple[float, float]:
    """Return the control input u of section II-B as (length, direction [rad]) for the best pair of common landmarks.

    Of all pairs of landmarks that are both seen and in the target, one is used: that whose relative bearing at the
    target is nearest to a right angle. Needs two common landmarks.
    """
    common = [landmark for landmark in target if landmark in bearing]
    best, pair = -1.0, (common[0], common[1])
    for i, a in enumerate(common):
        for b in common[i + 1 :]:
            spread = abs(math.sin(target[b] - target[a]))
            if spread > best:
                best, pair = spread, (a, b)
    x = y = 0.0
    for landmark in pair:
        gamma = bearing[landmark]
        # -(gamma* . gamma_perp) gamma_perp, with gamma_perp = (-sin gamma, cos gamma)
        projection = -math.sin(target[landmark] - gamma)
        x -= projection * math.sin(gamma)
        y += projection * math.cos(gamma)
    return math.hypot(x, y), math.atan2(y, x)


def travel(
    view: ExplorerView,
    path: Sequence[BearingSnapshot],
    random: np.random.Generator,
    arrived: Callable[[], bool],
) -> Drive:
    """Follow `path` until `arrived()`, aiming at the farthest vertex that shares enough landmarks with what is seen.

    A robot that loses sight of its target vertex returns to one before it, and goes all the way to that one. Otherwise it
    could see the farther vertex again, lose it again, and alternate between the two.
    """
    targets = [dict(zip(each.landmarks, map(to_rad, each.bearings), strict=True)) for each in path]
    last = len(targets) - 1
    best, before, farthest = -1, -1, last
    until = view.tick + PROGRESS_TICKS
    stalls = 0
    while not arrived():
        if view.tick >= until or stalls > STALLS_MAX:
            return "unreached"
        aim = _farthest(view.bearing, targets[: farthest + 1])
        length, direction = (0.0, 0.0) if aim is None else homing(view.bearing, targets[aim])
        if aim is not None:
            if aim > best:
                best, until = aim, view.tick + PROGRESS_TICKS
            if aim < before:
                farthest = aim
            before = aim
            if length >= ARRIVED:
                yield direction
                continue
        if farthest < last:
            farthest, before = last, -1
            continue
        stalls += 1
        direction = float(random.uniform(-math.pi, math.pi))
        for _ in range(JITTER_TICKS):
            yield direction
            if arrived():
                break
    return "arrived"


def _farthest(bearing: dict[int, float], targets: Sequence[dict[int, float]]) -> int | None:
    for number in range(len(targets) - 1, -1, -1):
        if sum(landmark in bearing for landmark in targets[number]) >= SHARED_MIN:
            return number
    return None


def explore(
    view: ExplorerView,
    a: int,
    b: int,
    random: np.random.Generator,
    cleared: Callable[[], bool],
    ticks: int,
    after_ticks: int,
) -> Drive:
    """Explore the frontier <a, b>: move to the left of the line from a to b, and search there (phase 2).

    Takes at most `ticks` to cross the line and `after_ticks` behind it.
    """
    began, crossed, touched = view.tick, -1, 0
    outward = angle = 0.0
    while not cleared():
        bearing_a, bearing_b = view.bearing.get(a), view.bearing.get(b)
        toward = outward
        length = 2.0
        if bearing_a is not None and bearing_b is not None:
            x, y = math.cos(bearing_a) + math.cos(bearing_b), math.sin(bearing_a) + math.sin(bearing_b)
            length = math.hypot(x, y)
            # The left normal of the segment from a to b.
            outward = math.atan2(math.cos(bearing_b) - math.cos(bearing_a), math.sin(bearing_a) - math.sin(bearing_b))
            left = 0.0 < (bearing_b - bearing_a) % (2.0 * math.pi) < math.pi
            if left and crossed < 0:
                crossed = view.tick
            toward = outward if length < NEAR_LINE else math.atan2(y, x)
        elif crossed < 0 and view.tick == began:
            return "unreached"
        if crossed < 0:
            if view.tick - began >= ticks:
                return "timed-out"
            direction = toward
        else:
            if view.tick - crossed >= after_ticks:
                return "timed-out"
            angle = KEPT_ANGLE * angle + float(random.normal(0.0, TURN_SD_RAD))
            direction = outward + angle
        at_line = view.tick - crossed <= CROSSED_TICKS if crossed >= 0 else length < AT_LINE
        if (at_line or touched) and any(apart_rad(each, outward) < math.pi / 3.0 for each in view.contacts):
            touched += 1
            if touched >= TOUCH_TICKS:
                return "boundary"
            yield outward
            continue
        touched = 0
        yield direction
    return "cleared"


def wander(view: ExplorerView, random: np.random.Generator, turn_sd_rad: float = WANDER_SD_RAD) -> Drive:
    """Do a random walk without end, and turn away from contacts."""
    direction = float(random.uniform(-math.pi, math.pi))
    while True:
        if any(math.cos(direction - contact) > 0.0 for contact in view.contacts):
            away = math.atan2(
                -added(math.sin(each) for each in view.contacts), -added(math.cos(each) for each in view.contacts)
            )
            direction = away + float(random.uniform(-1.2, 1.2))
        else:
            direction += float(random.normal(0.0, turn_sd_rad))
        yield direction


def roam(view: ExplorerView, random: np.random.Generator, is_new: Callable[[], bool]) -> Drive:
    """Explore without bearings and without end: go straight after a new observation, and else turn at random.

    `is_new` is true if the present observation was new to the map. The direction is kept for `NEWS_TICKS` after it.
    """
    direction = float(random.uniform(-math.pi, math.pi))
    until = view.tick
    while True:
        if is_new():
            until = view.tick + NEWS_TICKS
        if any(math.cos(direction - contact) > 0.0 for contact in view.contacts):
            direction = float(random.uniform(-math.pi, math.pi))
        elif view.tick >= until:
            direction += float(random.normal(0.0, ROAM_SD_RAD))
        yield direction
