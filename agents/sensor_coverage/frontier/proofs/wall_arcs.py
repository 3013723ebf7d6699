"""The arcs of a slot that end at followed walls or at contacts, by what the slot saw of walks and touches itself."""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from zwerm.agents.sensor_coverage.frontier.proofs.passed_points import Passed
from zwerm.agents.sensor_coverage.frontier.proofs.reliance import Answered
from zwerm.agents.sensor_coverage.frontier.strips.crossings import (
    arcs_beside_pocket,
    crossings_of_pocket,
    crossings_of_step,
)
from zwerm.agents.sensor_coverage.frontier.strips.loose_ends import Pocket
from zwerm.agents.sensor_coverage.frontier.strips.robots_in_touch import BODY_RAD
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import SightEnd, beside_edge, edged_arcs
from zwerm.agents.sensor_coverage.frontier.strips.way_begins import between_begins, certain_arcs
from zwerm.agents.sensor_coverage.frontier.wall_proof import (
    CONTACT_RAD,
    Arc,
    Crossing,
    NearArc,
    arcs_into,
    arcs_of_walls,
    complement,
    contains,
    overlap,
    united,
)

# A stretch of wall goes on at a point if it closes the directions this close [rad] to that of the point.
SEEN_RAD: Final = math.radians(0.2)


class ArcBasis(NamedTuple):
    """What was known around a slot when its arcs were found."""

    passed: int
    view: Mapping[int, float]
    touched: Sequence[float]
    near: Sequence[NearArc]
    in_touch: Sequence[int]
    stay: int | None


class WallArcs(NamedTuple):
    """Disjoint arcs of a slot that end at followed walls or at contacts; the same without edges of sight, and by stretch.

    `strict` are those without edges for which slots answer that saw them from the side, and `answered` has these.
    """

    followed: list[Arc]
    edged: list[Arc]
    by_stretch: dict[int, list[Arc]]
    strict: list[Arc]
    answered: list[Answered]

    def lies_at(self, there: float, stretch: int, near: Iterable[Arc]) -> bool:
        """Return whether a direction [rad] is closed, and a `stretch` of wall or one of walls `near` goes on there."""
        beside = Arc(there - SEEN_RAD, 2.0 * SEEN_RAD)
        return contains(self.strict, Arc(there, 0.0)) and (
            contains(united(self.by_stretch.get(stretch, ())), beside) or contains(near, beside)
        )

    def close_beyond(self, to_slot: float, to_point: float) -> bool:
        """Return whether walls close all directions beyond a triangle with another slot and a point, in these directions [rad].

        The robot stands beside the point. Where it was pushed meanwhile, it sees the point in another direction.
        """
        turn = math.remainder(to_point - to_slot, math.tau)
        width = math.pi - abs(turn) + BODY_RAD
        beyond = Arc(to_point - BODY_RAD if turn > 0.0 else to_point + BODY_RAD - width, width)
        return not any(overlap(each, beyond) > 0.0 for each in complement(self.strict))


class StepCrossings:
    """The directions of a slot that cross the steps of walks that it saw. They are found once for the ends that are loose."""

    def __init__(self, slot: int) -> None:
        self._slot = slot
        self._known: dict[tuple[int, ...], list[Crossing]] = {}  # by the number of a point, and those of its loose ends

    def __call__(self, passed: Passed, standing: Collection[int]) -> list[Crossing]:
        """Return the crossings of the step to a point, if the slots `standing` may tie its ends."""
        before, ends = passed.before, passed.ends
        if before is None:
            return []
        loose = tuple(number for number, each in enumerate(ends) if not each.is_tied(standing))
        key = passed.number, *loose
        known = self._known.get(key)
        if known is None:
            left = [ends[number] for number in loose]
            known = self._known[key] = list(crossings_of_step(self._slot, before, passed.point, passed.hand, left))
        return known


def find_wall_arcs(
    points: Iterable[Passed],
    basis: ArcBasis,
    standing: Collection[int],
    touched_by: Callable[[int], Sequence[float]],
    crossings_of: "StepCrossings",
) -> WallArcs:
    """Find the arcs of a slot that end at walls.

    `points` are points of walks that count, and `crossings_of` finds what the slot sees of their steps. It relies on slots that
    are `standing`, and on no others: they saw of walks what this one did not, and tie ends of walls. `touched_by` returns the
    directions [rad] of walls that a robot at the slot touched.
    """
    contacts = arcs_of_walls(basis.touched, CONTACT_RAD)
    crossings: dict[int, list[Crossing]] = {}
    beside: dict[tuple[int, bool], tuple[int, Pocket]] = {}  # by stretch and end, with the hand
    edges: dict[int, list[SightEnd]] = {}
    dark: dict[int, list[SightEnd]] = {}
    aside: dict[int, list[SightEnd]] = {}
    for passed in points:
        hand, stretch = passed.hand, passed.stretch
        if all(any(each in standing for each in witnesses) for witnesses in passed.between):
            crossings.setdefault(stretch, []).extend(crossings_of(passed, standing))
        edges.setdefault(stretch, []).extend(each for each in passed.sight_ends if each.is_loose(standing))
        for each in passed.dark_ends:
            if not each.is_seen(standing):
                (dark if each.is_loose(standing) else aside).setdefault(stretch, []).append(each)
        for first_number, pocket in passed.pockets:
            contacts += arcs_beside_pocket(hand, pocket, touched_by(pocket.stay))
            if pocket.in_touch or (first_number, pocket.is_last) not in beside:
                beside[first_number, pocket.is_last] = hand, pocket
    for (first_number, _), (hand, pocket) in beside.items():
        is_loose = not pocket.other.is_tied(standing)
        crossings.setdefault(first_number, []).extend(crossings_of_pocket(hand, pocket, is_loose))
    near = between_begins(basis.near)
    by_stretch = {number: arcs_into(each) for number, each in crossings.items()}
    certain = certain_arcs(basis.near)
    edged = strict = edged_arcs(by_stretch, edges, contacts, certain, dark)
    if aside:
        loose = {each: [*dark.get(each, ()), *aside.get(each, ())] for each in (*dark, *aside)}
        strict = edged_arcs(by_stretch, edges, contacts, certain, loose)
    found = (*contacts, *(each.arc for each in near), *(arc for each in by_stretch.values() for arc in each))
    return WallArcs(united(found), edged, by_stretch, strict, list(_answered(by_stretch, aside, standing)))


def _answered(
    by_stretch: Mapping[int, Sequence[Arc]], aside: Mapping[int, Sequence[SightEnd]], standing: Collection[int]
) -> Iterator[Answered]:
    """Yield the directions beside edges of sight for which other slots answer."""
    for stretch, ends in aside.items():
        whole = united(by_stretch.get(stretch, ()))
        for each in ends:
            yield Answered(beside_edge(each, whole), [other for other in each.aside if other[0] in standing])
