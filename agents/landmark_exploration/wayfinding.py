"""Paths through the map: to a set of landmarks, and to the meeting place of robots without an open frontier.

Generators of directions, as in `motion`. A path is the cheapest one in the navigation graph (section V-B of
Ramaithitima and Bhattacharya 2018). Robots without an open frontier exchange their last entries, and agree that
exploration is complete. With a short radio range they would seldom meet by chance. So they meet at the landmark with
the smallest id of their map, which is the same on equal maps.
"""

from collections.abc import Callable, Sequence
from typing import Final, Protocol

import numpy as np

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.cost_utility import path_to, reach
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.motion import Drive, travel, wander
from zwerm.agents.landmark_exploration.view import ExplorerView

# Paths that are tried before a goal is given up.
TRIES_MAX: Final = 30
# Ticks of random walk between two tries, and if no path is known.
WANDER_TICKS: Final = 15
# Ticks at the meeting place, and of the random walk after them: robots whose maps share no landmark have two meeting
# places, and a robot may know no path to its place. VISIT_TICKS: for a robot that has frontiers to explore.
MEETING_TICKS: Final = 1_000
VISIT_TICKS: Final = 40
PARTING_TICKS: Final = 200


class Follow(Protocol):
    """Follows a path of observations until `arrived()`; `motion.travel` is one."""

    def __call__(
        self,
        view: ExplorerView,
        path: Sequence[BearingSnapshot],
        random: np.random.Generator,
        arrived: Callable[[], bool],
        /,
    ) -> Drive:
        """Yield directions, and return the outcome."""


def navigate(
    view: ExplorerView, map_: LandmarkMap, goal: Sequence[int], random: np.random.Generator, follow: Follow = travel
) -> Drive:
    """Go to a place where all landmarks of `goal` are seen, or as many of them as any observation of the map has."""

    def arrived() -> bool:
        return all(landmark in view.bearing for landmark in goal)

    for _ in range(TRIES_MAX):
        if arrived():
            return "arrived"
        path = way_to(map_, view.snapshot.landmarks, goal)
        outcome = "unreached"
        if path:
            outcome = yield from follow(view, [map_.complex.snapshot_of(each) for each in path], random, arrived)
        if outcome == "arrived":
            return "arrived"
        astray = wander(view, random)
        for _ in range(WANDER_TICKS):
            yield next(astray)
            if arrived():
                return "arrived"
    return "unreached"


def way_to(map_: LandmarkMap, landmarks: Sequence[int], goal: Sequence[int]) -> tuple[int, ...]:
    """Return the vertices of the cheapest path to a vertex with most landmarks of the goal; () where no path exists."""
    before: dict[int, int] = {}
    best: tuple[int, int] | None = None
    wanted = set(goal)
    for _, vertex, previous in reach(map_.complex, landmarks):
        before[vertex] = previous
        shared = len(wanted.intersection(map_.complex.simplices[vertex]))
        if shared and (best is None or shared > best[0]):
            best = shared, vertex
            if shared == len(wanted):
                break
    return () if best is None else path_to(best[1], before)


def visit(view: ExplorerView, map_: LandmarkMap, random: np.random.Generator, ticks: Callable[[], int]) -> Drive:
    """Go to the meeting place, and stay there for `ticks()` while its landmark is seen."""
    place = map_.complex.smallest_landmark()
    if place is None:
        return "unreached"
    outcome = yield from navigate(view, map_, (place,), random)
    arrived = view.tick
    while outcome == "arrived" and view.tick - arrived < ticks():
        if place in view.bearing:
            yield view.bearing[place]
        else:  # another robot has pushed this one away
            outcome = yield from navigate(view, map_, (place,), random)
    return outcome


def meet(
    view: ExplorerView,
    map_: LandmarkMap,
    random: np.random.Generator,
    idle: Callable[[], float | None],
    ticks: Callable[[], int],
) -> Drive:
    """Repeat without end: go to the meeting place, stay for `ticks()`, then move as `idle` does."""
    while True:
        yield from visit(view, map_, random, ticks)
        until = view.tick + PARTING_TICKS
        while view.tick < until:
            yield idle()
