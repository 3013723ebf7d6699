"""Completeness of a landmark complex, and whether its topology is that of the arena.

A place is covered if the set of all landmarks that are visible there is a face of the complex. The completion is the
covered fraction of a grid of points in free space. The union of the simplices' hulls saturates below 1, because hulls
do not reach the walls. These metrics use true positions, to which no robot has access.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Final

import numpy as np

from zwerm.agents.landmark_exploration.mapping.map_reports import GoalReport, MapReport, read_report
from zwerm.maths.strong_collapse import betti
from zwerm.scenario.tables import Scenario
from zwerm.world.arena.arena import Arena
from zwerm.world.arena.scatter import with_landmarks
from zwerm.world.geometry.search_tree import tree_of
from zwerm.world.metrics import Metric, MetricContext, Truth
from zwerm.world.metrics.sight import obstacles
from zwerm.world.scene import Floats
from zwerm.world.tick.telemetry import TelemetryRecord

# Places a range: the grid is this many times finer than the sensor's range.
PLACES_PER_RANGE: Final = 10
# Lines of sight judged at a time.
_LINES_AT_ONCE: Final = 20_000
# The fractions of completion whose first time is a metric, in per cent.
MILESTONES: Final = (90.0, 91.5, 95.0)


def milestone(percent: float) -> str:
    """Return the name of the metric for the first time of this completion."""
    return f"iterations_to_{percent:g}_percent_completion".replace(".", "_")


class MapCompletion:
    """The places that the complex does not cover yet; a new simplex never uncovers a place."""

    def __init__(self, arena: Arena, landmarks: Floats, range_m: float) -> None:
        places = places_in(arena, range_m / PLACES_PER_RANGE)
        self.places = len(places)
        self._covered = 0
        # By the smallest landmark of a set: a bit for each landmark seen together with it, and the number of places of each set
        # as bits. So no number has more bits than landmarks are seen near one place.
        self._bits: dict[int, dict[int, int]] = {}
        self._left: dict[int, dict[int, int]] = {}
        for seen in visible(arena, landmarks, range_m, places):
            if not seen:
                continue  # where nothing is visible nothing can be covered
            bits, left = self._bits.setdefault(seen[0], {}), self._left.setdefault(seen[0], {})
            together = 0
            for landmark in seen:
                together |= bits.setdefault(landmark, 1 << len(bits))
            left[together] = left.get(together, 0) + 1

    def add(self, simplices: Iterable[Iterable[int]]) -> None:
        """Cover the places of which all visible landmarks are in one of `simplices`."""
        for simplex in simplices:
            members = list(simplex)
            for landmark in members:
                left = self._left.get(landmark)
                if left:
                    bits, inside = self._bits[landmark], 0
                    for member in members:
                        inside |= bits.get(member, 0)
                    covered = [each for each in left if not each & ~inside]
                    self._covered += sum([left.pop(each) for each in covered])

    @property
    def fraction(self) -> float:
        """The fraction of places that are covered."""
        return self._covered / self.places if self.places else 0.0


def places_in(arena: Arena, spacing_m: float) -> Floats:
    """Return the places (n, 2) of a square grid that are in free space."""
    xmin, ymin, xmax, ymax = arena.bounds
    x, y = np.meshgrid(
        np.arange(xmin + spacing_m / 2.0, xmax, spacing_m), np.arange(ymin + spacing_m / 2.0, ymax, spacing_m)
    )
    places = np.column_stack([x.ravel(), y.ravel()])
    inside: Floats = places[arena.contains(places)]
    return inside


def visible(arena: Arena, landmarks: Floats, range_m: float, places: Floats) -> list[list[int]]:
    """Return the ids of the landmarks that are visible at each of places (k, 2) [m], ascending."""
    seen: list[list[int]] = [[] for _ in places]
    if not len(landmarks) or not len(places):
        return seen
    near = tree_of(landmarks).query_ball_point(places, range_m, return_sorted=True)
    place = np.repeat(np.arange(len(places)), [len(each) for each in near])
    landmark = np.concatenate([np.array(each, dtype=np.int64) for each in near])
    for start in range(0, len(place), _LINES_AT_ONCE):
        some = slice(start, start + _LINES_AT_ONCE)
        clear = ~arena.blocked(places[place[some]], landmarks[landmark[some]])
        for i, j in zip(place[some][clear].tolist(), landmark[some][clear].tolist(), strict=True):
            seen[i].append(j)
    return seen


def maximal(simplices: Iterable[Sequence[int]]) -> list[tuple[int, ...]]:
    """Return the simplices that are no face of another one, each once."""
    holders: dict[int, set[int]] = {}
    found: dict[int, tuple[int, ...]] = {}
    for number, simplex in enumerate(sorted({tuple(sorted(each)) for each in simplices}, key=lambda s: (-len(s), s))):
        groups = [holders.get(landmark, set()) for landmark in simplex]
        if not groups or set.intersection(*groups):
            continue
        found[number] = simplex
        for landmark in simplex:
            holders.setdefault(landmark, set()).add(number)
    return list(found.values())


class Exploration(Metric):
    """Completeness of the coordinator's map, or of the robots' maps together, over time."""

    names: ClassVar[Mapping[str, str]] = {
        "completion_fraction": (
            "points at which all visible landmarks were seen together by some robot, of a grid of points in free space"
        ),
        "iterations": "ticks of the run",
        "landmarks": "number of landmarks",
        "free_simplices": "observations that are no face of another one",
        "landmark_complex_pieces": "b0 of the landmark complex",
        "landmark_complex_holes": "b1 of the landmark complex",
        "obstacles": "obstacles that stand free in the arena",
        "open_frontiers": "frontiers left open, at the robot that knows the most, or at the coordinator",
        "concluded_early": (
            "1 if a robot concluded while a living one knew an open frontier, else 0; absent with a coordinator"
        ),
        **{
            milestone(percent): f"ticks until completion was {percent:g} %; absent if it never was"
            for percent in MILESTONES
        },
    }

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        self._context = context
        self._reports: list[tuple[int, int, MapReport]] = []
        self._truth: Truth | None = None

    def report(self, record: TelemetryRecord) -> None:
        """Take the report of a node on its map."""
        report = read_report(record.snapshot) if record.snapshot else None
        if isinstance(report, MapReport):
            self._reports.append((record.tick, record.node, report))

    def sample(self, truth: Truth) -> None:
        """Take the tick and the dead robots."""
        self._truth = truth

    def metrics(self) -> dict[str, float]:
        """Return the metrics, or nothing if no node reported a map."""
        range_m, truth = landmark_range_m(self._context.scenario), self._truth
        if range_m is None or truth is None or not self._reports:
            return {}
        arena, landmarks = self._context.arena, landmarks_of(self._context.scenario, truth)
        completion = MapCompletion(arena, landmarks, range_m)
        reached: dict[str, float] = {}
        for tick, _, report in self._reports:
            completion.add(report.simplices)
            for percent in MILESTONES:
                if completion.fraction >= percent / 100.0:
                    reached.setdefault(milestone(percent), float(tick))
        complex_ = maximal(simplex for _, _, report in self._reports for simplex in report.simplices)
        pieces, holes = betti(complex_)
        return {
            "completion_fraction": completion.fraction,
            "iterations": float(truth.scene.tick),
            **reached,
            "landmarks": float(len(landmarks)),
            "free_simplices": float(len(complex_)),
            "landmark_complex_pieces": float(pieces),
            "landmark_complex_holes": float(holes),
            "obstacles": float(obstacles(arena)),
            **self._left_open(truth),
        }

    def _left_open(self, truth: Truth) -> dict[str, float]:
        """Return the frontiers left open; and 1 where a robot concluded while a living one knew an open frontier, else 0."""
        newest: dict[int, int] = {}
        early = robots = 0.0
        for _, node, report in self._reports:
            newest[node] = report.open
            robots = max(robots, float(report.of_robot))
            if (
                report.of_robot
                and report.done
                and any(count for each, count in newest.items() if each not in truth.dead)
            ):
                early = 1.0
        living = [count for node, count in newest.items() if node not in truth.dead]
        found = {"open_frontiers": float(max(living, default=0))}
        return found | {"concluded_early": early} if robots else found


class Navigation(Metric):
    """The fraction of goals that robots reached, and the iterations that took.

    A goal counts as reached if the robot reported it and all landmarks of the goal were visible.
    """

    names: ClassVar[Mapping[str, str]] = {
        "navigation_goals": "goals that robots set out for; only in `landmark-navigate`",
        "navigation_success_fraction": "goals at which all landmarks of the goal were visible, of those",
        "navigation_iterations_mean": "ticks to a goal that was reached",
    }

    def __init__(self, parameters: Any, context: MetricContext) -> None:
        self._context = context
        self._ends: list[tuple[Floats, GoalReport]] = []
        self._truth: Truth | None = None

    def report(self, record: TelemetryRecord) -> None:
        """Take the report on the end of a path."""
        report = read_report(record.snapshot) if record.snapshot else None
        if isinstance(report, GoalReport):
            self._ends.append((record.position[record.node].copy(), report))

    def sample(self, truth: Truth) -> None:
        """Take the truth at the end."""
        self._truth = truth

    def metrics(self) -> dict[str, float]:
        """Return the metrics, or none if no robot navigates."""
        range_m = landmark_range_m(self._context.scenario)
        if not self._ends or range_m is None or self._truth is None:
            return {}
        landmarks = landmarks_of(self._context.scenario, self._truth)
        seen = visible(self._context.arena, landmarks, range_m, np.array([place for place, _ in self._ends]))
        reached = [
            end for (_, end), there in zip(self._ends, seen, strict=True) if end.arrived and set(end.goal) <= set(there)
        ]
        return {
            "navigation_goals": float(len(self._ends)),
            "navigation_success_fraction": len(reached) / len(self._ends),
            "navigation_iterations_mean": float(np.mean([end.iterations for end in reached])) if reached else math.nan,
        }


def landmarks_of(scenario: Scenario, truth: Truth) -> Floats:
    """Return (l, 2) the places of the landmarks [m], scattered as for the run."""
    return np.array(with_landmarks(scenario, truth.scene.draws.seed).landmarks, dtype=np.float64).reshape(-1, 2)


def landmark_range_m(scenario: Scenario) -> float | None:
    """Return the range of the robots' landmark sensor [m], or None where it has none."""
    tables = [each for each in scenario.robots.sensors if each.kind == "landmarks"]
    found = tables[0].parameters.get("range_m") if tables else None
    return None if found is None else float(found)
