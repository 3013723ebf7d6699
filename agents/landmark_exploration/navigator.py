"""Exploitation: a robot finds its way to a set of landmarks by a map that others made (section V-B of the paper).

It has a map, bearings, contact and its compass, and needs no radio. A goal is a set of landmarks; the robot is there when it
sees all of them. The map comes from a file (see `map_file`), whose text is a parameter.
"""

from collections.abc import Sequence
from typing import Annotated, ClassVar, Final

import numpy as np
from msgspec import Meta, Struct

from zwerm.agents.landmark_exploration.mapping.cost_utility import path_to, reach
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_file import read_map
from zwerm.agents.landmark_exploration.mapping.map_reports import GoalReport, write_report
from zwerm.agents.landmark_exploration.motion import Drive, travel, wander
from zwerm.agents.landmark_exploration.view import ExplorerView, Slide
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ControllerError
from zwerm.wire.messages import Command, Observation

# Ways tried before a goal is given up.
TRIES_MAX: Final = 30
# Ticks of walking about between two tries, and where no way is known.
ASTRAY_TICKS: Final = 15


def navigate(view: ExplorerView, map_: LandmarkMap, goal: Sequence[int], random: np.random.Generator) -> Drive:
    """Go to where all landmarks of `goal` are seen, or as many as the map has ever seen together."""

    def arrived() -> bool:
        return all(landmark in view.bearing for landmark in goal)

    for _ in range(TRIES_MAX):
        if arrived():
            return "arrived"
        path = way_to(map_, view.snapshot.landmarks, goal)
        outcome = "unreached"
        if path:
            outcome = yield from travel(view, [map_.complex.snapshot_of(each) for each in path], random, arrived)
        if outcome == "arrived":
            return "arrived"
        astray = wander(view, random)
        for _ in range(ASTRAY_TICKS):
            yield next(astray)
            if arrived():
                return "arrived"
    return "unreached"


def way_to(map_: LandmarkMap, landmarks: Sequence[int], goal: Sequence[int]) -> tuple[int, ...]:
    """Return the vertices on the cheapest way to one with most landmarks of the goal, or nothing where there is no way."""
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


class NavigatorParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """The text of the map's file, and the goals: sets of landmarks, one after the other.

    Without goals each robot draws `random_goals` of them, free simplices of the map.
    """

    map_file: str
    goals: tuple[tuple[int, ...], ...] = ()
    random_goals: Annotated[int, Meta(ge=1, le=10_000)] = 10


class Navigator(Controller):
    """Goes to one goal after the other, and is done when it has tried all."""

    sensors: ClassVar[tuple[str, ...]] = ("landmarks", "compass_rad", "touch")
    Parameters: ClassVar[type[NavigatorParameters]] = NavigatorParameters

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        rules: NavigatorParameters = self.parameters
        try:
            self.map = read_map(rules.map_file)
        except ValueError as error:
            raise ControllerError(f"map_file: {error}") from None
        assert setup.body is not None
        self._speed_m_s = setup.body.max_speed_m_s
        self._goals = rules.goals or self._draw(rules.random_goals)
        self.view = ExplorerView()
        self._slide = Slide(self.random)
        self._report = b""
        self._drive = self._live()
        self._done = False

    def _draw(self, count: int) -> tuple[tuple[int, ...], ...]:
        simplices = sorted(self.map.complex.simplices.values())
        if not simplices:
            return ()
        return tuple(simplices[each] for each in self.random.integers(len(simplices), size=count))

    def step(self, observation: Observation) -> Command:
        """Perceive and go on."""
        self.view.take(observation)
        direction = self._slide.along(next(self._drive), self.view)
        report, self._report = self._report, b""
        return Command(drive=self.view.drive(direction, self._speed_m_s), done=self._done, snapshot=report)

    def _live(self) -> Drive:
        for goal in self._goals:
            began = self.view.tick
            outcome = yield from navigate(self.view, self.map, goal, self.random)
            self._report = write_report(GoalReport(tuple(goal), outcome == "arrived", self.view.tick - began))
            yield None
        self._done = True
        while True:
            yield None
