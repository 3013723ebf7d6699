"""Exploitation: a robot navigates to sets of landmarks by a map that other robots made (section V-B of the paper).

The robot has a map, bearings, contact and its compass, and needs no radio. A goal is a set of landmarks. The robot has
reached it when it sees all of them. The map comes from a file (see `map_file`), whose text is a parameter.
"""

from functools import partial
from typing import Annotated, ClassVar, Final

from msgspec import Meta, Struct

from zwerm.agents.landmark_exploration.mapping.map_file import read_map
from zwerm.agents.landmark_exploration.mapping.map_reports import GoalReport, write_report
from zwerm.agents.landmark_exploration.motion import Drive, travel
from zwerm.agents.landmark_exploration.presence import PresenceTracker, seek
from zwerm.agents.landmark_exploration.view import ExplorerView, Slide
from zwerm.agents.landmark_exploration.wayfinding import Follow, navigate
from zwerm.agents.runtime.contract import Controller, Setup
from zwerm.errors import ControllerError
from zwerm.wire.messages import Command, Observation

PARAMETERS: Final = "robots.parameters"

Goal = Annotated[tuple[int, ...], Meta(min_length=1)]


class NavigatorParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """The text of the map's file, and the goals: sets of landmarks, one after the other.

    Every landmark of a goal is in the map. Without goals each robot draws `random_goals` of them, free simplices of the map.
    With `presence_only` no bearing is used, neither of the map nor of the sensor. The robot then has to know the sensor's
    range, `range_m`.
    """

    map_file: str
    goals: tuple[Goal, ...] = ()
    random_goals: Annotated[int, Meta(ge=1, le=10_000)] = 10
    presence_only: bool = False
    range_m: Annotated[float, Meta(gt=0.0)] = 1.0


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
            raise ControllerError(f"{PARAMETERS}.map_file: {error}") from None
        known = {landmark for simplex in self.map.complex.simplices.values() for landmark in simplex}
        if not known:
            raise ControllerError(f"{PARAMETERS}.map_file: expected a map with an observation, got none")
        if not rules.presence_only and not any(len(set(each)) > 1 for each in self.map.complex.table.values()):
            raise ControllerError(f"{PARAMETERS}.map_file: expected bearings, or presence_only=true, got a map without")
        for goal in rules.goals:
            strange = sorted(set(goal) - known)
            if strange:
                text = f"expected landmarks of the map, got {list(goal)}: {strange} are not in it"
                raise ControllerError(f"{PARAMETERS}.goals: {text}")
        assert setup.body is not None
        self._speed_m_s = setup.body.max_speed_m_s
        self._goals = rules.goals or self._draw(rules.random_goals)
        self.view = ExplorerView()
        self._slide = Slide(self.random)
        self._tracker: PresenceTracker | None = None
        self._follow: Follow = travel
        if rules.presence_only:
            self._tracker = PresenceTracker(rules.range_m / (self._speed_m_s * setup.dt_s))
            self._follow = partial(seek, self._tracker)
        self._moved: float | None = None
        self._report = b""
        self._drive = self._visit_goals()
        self._done = False

    def _draw(self, count: int) -> tuple[tuple[int, ...], ...]:
        simplices = sorted(self.map.complex.simplices.values())
        return tuple(simplices[each] for each in self.random.integers(len(simplices), size=count))

    def step(self, observation: Observation) -> Command:
        """Update the view, and drive on towards the goal."""
        self.view.take(observation)
        if self._tracker is not None:
            self._tracker.update(self.view, self._moved)
        direction = self._moved = self._slide.along(next(self._drive), self.view)
        report, self._report = self._report, b""
        return Command(drive=self.view.drive(direction, self._speed_m_s), done=self._done, snapshot=report)

    def _visit_goals(self) -> Drive:
        for goal in self._goals:
            began = self.view.tick
            outcome = yield from navigate(self.view, self.map, goal, self.random, self._follow)
            self._report = write_report(GoalReport(tuple(goal), outcome == "arrived", self.view.tick - began))
            yield None
        self._done = True
        while True:
            yield None
