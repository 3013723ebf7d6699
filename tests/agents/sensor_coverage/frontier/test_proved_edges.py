"""Where walls were followed, no robot is pushed to a side of an edge that is proved to be closed."""

import math
from typing import Literal

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.planner import WHOLE_HOP, Planner
from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc, Walk
from zwerm.maths.simplicial import Edge, FlagComplex

PLACES = {0: (0.0, 0.0), 1: (1.0, 0.0), 2: (0.5, 0.87)}
SOUTH: Edge = (0, 1)


VIEWS = {i: {j: math.atan2(b[1] - a[1], b[0] - a[0]) for j, b in PLACES.items() if j != i} for i, a in PLACES.items()}
SCAN = ScanResult(VIEWS, FlagComplex({i: set(seen) for i, seen in VIEWS.items()}), ())


def slots_of_triangle() -> Slots:
    slots = Slots()
    for robot in PLACES:
        slots.add(robot)
    return slots


def frontier(closed: tuple[int, ...], walks: int) -> tuple[set[Edge], set[Edge]]:
    """Return frontier and obstacle edges of a triangle, with the south closed around some slots, after some walks."""
    slots = slots_of_triangle()
    for slot in closed:
        slots.near[slot] = [NearArc(Arc(-math.pi - 0.1, math.pi + 0.2), 1)]
    slots.walks += [Walk(0, 1, ())] * walks
    planner = Planner(PlannerParameters(walls="followed"), slots, SwarmProof())
    planner.update(SCAN)
    return set(planner.frontier), set(planner.obstacle)


def test_an_edge_is_frontier_until_both_of_its_ends_are_proved_to_be_closed() -> None:
    for closed in ((), (0,), (1,)):
        assert frontier(closed, walks=1) == ({(0, 1), (0, 2), (1, 2)}, set())
    assert frontier((0, 1), walks=1) == ({(0, 2), (1, 2)}, {SOUTH})


def test_before_the_first_walk_every_edge_counts() -> None:
    assert SOUTH in frontier((0, 1), walks=0)[0]


@pytest.mark.parametrize("walls", ["paper", "followed"])
@pytest.mark.parametrize("edges", [None, (SOUTH,)], ids=["with a coordinator", "by a robot at the edge"])
def test_a_robot_beside_an_edge_stays_only_after_its_whole_hop_where_walls_are_followed(
    walls: Literal["paper", "followed"], edges: tuple[Edge, ...] | None
) -> None:
    parameters = PlannerParameters(walls=walls)
    planner = Planner(parameters, slots_of_triangle(), SwarmProof() if edges is None else None)
    planner.update(SCAN, edges)
    plans = next(planner.plans())
    assert plans
    assert {each.clear_m for each in plans} == {WHOLE_HOP * parameters.hop_m if walls == "followed" else 0.8}


def test_the_space_around_a_slot_is_proved_without_another_one_by_walls_or_triangles_of_the_others() -> None:
    """Slot 0 followed a wall in the north west. The triangle of robots is in the north east of it."""
    proof = SwarmProof()
    proof.update(SCAN, [], {}, {0: [NearArc(Arc(2.0, 1.0), 1)]}, {})
    north_east, north_west, south = 0.5, 2.5, -1.5
    for there, other, is_proved in (
        (north_west, 1, True),
        (north_east, 7, True),
        (north_east, 1, False),
        (north_east, 2, False),
        (south, 7, False),
    ):
        assert proof._is_proved(0, there, other) is is_proved
    assert not proof._is_proved(9, north_west, 1), "slot 9 is empty"
