"""What standing robots close around a slot: triangles of three robots, and robots in touch."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.proofs.robot_arcs import RobotArcs
from zwerm.agents.sensor_coverage.frontier.proofs.wall_arcs import ArcBasis
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc

# Slot 0 sees slots 1 and 2 beside the mouth of a passage, and slot 3 in it.
PLACES = {0: (0.0, 0.0), 1: (0.5, 0.5), 2: (0.5, -0.5), 3: (1.0, 0.0)}


def robots(edges: list[tuple[int, int]], in_touch: tuple[int, ...] = ()) -> RobotArcs:
    """Return the arcs of slots with these edges, and of robots that slot 0 touches."""
    pairs = [*edges, *((b, a) for a, b in edges)]
    neighbours = {slot: frozenset(b for a, b in pairs if a == slot) for slot in PLACES}
    views = {
        slot: {
            each: math.atan2(PLACES[each][1] - PLACES[slot][1], PLACES[each][0] - PLACES[slot][0])
            for each in neighbours[slot]
        }
        for slot in PLACES
    }
    around = {slot: ArcBasis(0, views[slot], (), (), in_touch if slot == 0 else (), None) for slot in PLACES}
    return RobotArcs(neighbours, views, around, {})


def degrees(arcs: list[Arc]) -> list[tuple[int, int]]:
    """Return the starts and ends of arcs [deg]."""
    return sorted((round(math.degrees(start)), round(math.degrees(start + width))) for start, width in arcs)


MOUTH = [(0, 1), (0, 2), (0, 3), (1, 2)]


@pytest.mark.parametrize(
    ("edges", "kept"),
    [
        pytest.param(MOUTH, [], id="slot 3 sees slot 0 alone"),
        pytest.param([*MOUTH, (1, 3)], [(0, 45)], id="slot 3 sees one of the two robots"),
        pytest.param([*MOUTH, (1, 3), (2, 3)], None, id="slot 3 sees both, and knows what is behind their edge"),
        pytest.param([(0, 1), (0, 2), (0, 3)], None, id="the two robots do not see each other"),
    ],
)
def test_a_triangle_of_robots_does_not_count_for_a_slot_that_is_behind_it(
    edges: list[tuple[int, int]], kept: list[tuple[int, int]] | None
) -> None:
    found = robots(edges).not_before(3, 0)
    assert (None if found is None else degrees(found)) == kept


def test_a_robot_in_touch_closes_what_is_behind_its_body_for_all() -> None:
    both = robots(MOUTH, in_touch=(1,))
    assert degrees(both.all(0)) == [(-45, 45), (20, 70)]
    assert degrees(both.not_before(3, 0) or []) == [(20, 70)]
