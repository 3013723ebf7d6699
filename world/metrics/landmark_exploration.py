"""How complete a landmark complex is, and whether its topology is that of the arena.

A place is covered if the set of all landmarks that are visible there is a face of the complex. The completion is the covered
fraction of a grid of places in free space (the union of the simplices' hulls would do for a picture, but saturates below 1:
hulls do not reach the walls). Truth is used here, and only here: robots know no place.
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.spatial import cKDTree

from zwerm.maths.strong_collapse import betti
from zwerm.world.arena.arena import Arena
from zwerm.world.metrics.sight import obstacles
from zwerm.world.scene import Floats

if TYPE_CHECKING:
    from zwerm.world.world import World

# Places a range: the grid is this many times finer than the sensor's range.
PLACES_PER_RANGE: Final = 10
# Lines of sight judged at a time.
_LINES_AT_ONCE: Final = 20_000
# The fractions of completion whose first time is a metric, in per cent.
MILESTONES: Final = (90.0, 91.5, 95.0)


class Completion:
    """The places that the complex does not cover yet; simplices only ever cover more."""

    def __init__(self, arena: Arena, landmarks: Floats, range_m: float) -> None:
        places = _places(arena, range_m / PLACES_PER_RANGE)
        self.places = len(places)
        counts: dict[int, int] = {}
        for seen in visible(arena, landmarks, range_m, places):
            bits = sum(1 << landmark for landmark in seen)
            counts[bits] = counts.get(bits, 0) + 1
        counts.pop(0, None)  # where nothing is visible nothing can be covered
        self._covered = 0
        self._left: dict[int, dict[int, int]] = {}  # by smallest landmark: set of landmarks as bits, number of places
        for bits, count in counts.items():
            first = (bits & -bits).bit_length() - 1
            self._left.setdefault(first, {})[bits] = count

    def add(self, simplices: Iterable[Iterable[int]]) -> None:
        """Cover the places of which all visible landmarks are in one of `simplices`."""
        for simplex in simplices:
            members = list(simplex)
            outside = ~sum(1 << landmark for landmark in members)
            for landmark in members:
                left = self._left.get(landmark)
                if left:
                    covered = [bits for bits in left if not bits & outside]
                    self._covered += sum(left.pop(bits) for bits in covered)

    @property
    def fraction(self) -> float:
        """The fraction of places that are covered."""
        return self._covered / self.places if self.places else 0.0


def _places(arena: Arena, spacing_m: float) -> Floats:
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
    near = cKDTree(landmarks).query_ball_point(places, range_m, return_sorted=True)
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


def told_simplices(record: dict[str, Any]) -> list[list[int]]:
    """Return the simplices that a node's telemetry adds to the map."""
    part = record.get("landmark_map") or record.get("landmark_robot") or {}
    found: list[list[int]] = part.get("simplices", [])
    return found


def landmark_metrics(world: "World") -> dict[str, float]:
    """Return the metrics of landmark-based exploration of a run; nothing where no robot senses landmarks in a range."""
    range_m, records = landmark_range_m(world), world.audience.told
    simplices = [simplex for each in records for simplex in told_simplices(each.told)]
    if range_m is None or not simplices:
        return navigation_metrics(world)
    landmarks = np.array(world.scenario.landmarks, dtype=np.float64).reshape(-1, 2)
    completion = Completion(world.arena, landmarks, range_m)
    reached: dict[str, float] = {}
    for each in records:
        completion.add(told_simplices(each.told))
        for percent in MILESTONES:
            if completion.fraction >= percent / 100.0:
                reached.setdefault(f"iterations_to_{percent:g}_percent_completion", float(each.tick))
    complex_ = maximal(simplices)
    pieces, holes = betti(complex_)
    return {
        "completion_fraction": completion.fraction,
        "iterations": float(world.tick),
        **reached,
        "landmarks": float(len(landmarks)),
        "free_simplices": float(len(complex_)),
        "landmark_complex_pieces": float(pieces),
        "landmark_complex_holes": float(holes),
        "obstacles": float(obstacles(world.arena)),
        **_left_open(world),
    }


def navigation_metrics(world: "World") -> dict[str, float]:
    """Return the fraction of goals that robots reached, and the iterations it took; nothing where nobody navigates.

    A goal counts as reached where the robot said so, and all landmarks of the goal were indeed visible.
    """
    ends = [(each, each.told["navigation"]) for each in world.audience.told if "navigation" in each.told]
    range_m = landmark_range_m(world)
    if not ends or range_m is None:
        return {}
    landmarks = np.array(world.scenario.landmarks, dtype=np.float64).reshape(-1, 2)
    places = np.array([each.position[each.node] for each, _ in ends])
    seen = visible(world.arena, landmarks, range_m, places)
    reached = [
        end for (_, end), there in zip(ends, seen, strict=True) if end["arrived"] and set(end["goal"]) <= set(there)
    ]
    return {
        "navigation_goals": float(len(ends)),
        "navigation_success_fraction": len(reached) / len(ends),
        "navigation_iterations_mean": float(np.mean([end["iterations"] for end in reached]))
        if reached
        else float("nan"),
    }


def landmark_range_m(world: "World") -> float | None:
    """Return the range of the robots' landmark sensor [m], or None where it has none."""
    tables = [each for each in world.scenario.robots.sensors if each.kind == "landmarks"]
    found = tables[0].parameters.get("range_m") if tables else None
    return None if found is None else float(found)


def _left_open(world: "World") -> dict[str, float]:
    """Return the frontiers left open, and 1 where a robot concluded while a living one knew an open frontier, else 0."""
    newest: dict[int, int] = {}
    early = 0.0
    for each in world.audience.told:
        if "landmark_robot" in each.told:
            newest[each.node] = each.told["landmark_robot"]["open"]
            if each.told["landmark_robot"]["done"] and any(
                count for node, count in newest.items() if node not in world.dead
            ):
                early = 1.0
    if not newest:
        return {}
    living = [count for node, count in newest.items() if node not in world.dead]
    return {"open_frontiers": float(max(living, default=0)), "concluded_early": early}
