"""What closes the directions beyond the point of a wall where two ways along it begin, one with each hand."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.planner_parameters import PlannerParameters
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.strips.way_begins import begin_width, between_begins, certain_arcs, end_width
from zwerm.agents.sensor_coverage.frontier.wall_plans import WallPlans
from zwerm.agents.sensor_coverage.frontier.wall_proof import ANYONE, Arc, NearArc
from zwerm.agents.sensor_coverage.motion.walls.near_arcs import NearPoint, NearWay

BEYOND_DEG = 9
RADIUS_M = 0.07


def way(begin_deg: int, hand: int, robot: int = 3) -> NearArc:
    """Return the arc of a way of 50 degrees that begins at a touched point: with the right hand it leads to the left."""
    start = begin_deg - 50 if hand > 0 else begin_deg - BEYOND_DEG
    return NearArc(
        Arc(math.radians(start), math.radians(50 + BEYOND_DEG)), hand, robot, begin_rad=math.radians(BEYOND_DEG)
    )


@pytest.mark.parametrize(
    ("near", "begins"),
    [
        pytest.param([way(0, -1)], [-9], id="one hand"),
        pytest.param([way(0, -1), way(0, 1)], [0, 0], id="one point"),
        pytest.param([way(0, -1), way(13, 1)], [0, 13], id="the ways overlap"),
        pytest.param([way(0, -1), way(-4, 1)], [-4, 0], id="between the points is the same wall"),
        pytest.param([way(0, -1), way(-15, 1)], [-9, -6], id="the points are farther apart than one of them may be"),
        pytest.param([way(0, -1), way(40, 1)], [-9, 49], id="another point"),
        pytest.param([way(0, -1), way(46, 1)], [-4, 50], id="each ends beyond the point of the other"),
        pytest.param([way(0, -1), way(46, 1, robot=4)], [-9, 55], id="the way of another robot ends there"),
        pytest.param([way(0, -1), way(46, 1)._replace(is_past_end=True)], [-9, 50], id="past the end of the other way"),
        pytest.param([way(0, -1), way(55, 1)], [-9, 64], id="the other way ends before the point"),
        pytest.param([way(0, -1), way(13, 1, robot=4)], [-9, 22], id="another robot"),
        pytest.param([way(0, -1), way(13, -1)], [-9, 4], id="the same hand"),
        pytest.param([way(0, -1, ANYONE), way(13, 1, ANYONE)], [-9, 22], id="for any robot"),
        pytest.param([way(0, -1), way(13, 1)._replace(begin_rad=0.0)], [-9, 22], id="a robot was in touch there"),
    ],
)
def test_only_what_is_between_the_begins_of_two_ways_counts_beyond_them(near: list[NearArc], begins: list[int]) -> None:
    found = between_begins(near)
    edges = [each.arc.start_rad + (each.arc.width_rad if each.hand > 0 else 0.0) for each in found]
    assert [round(math.degrees(each)) for each in edges] == begins
    others = [each.arc.start_rad + (0.0 if each.hand > 0 else each.arc.width_rad) for each in found]
    assert others == pytest.approx(
        [each.arc.start_rad + (0.0 if each.hand > 0 else each.arc.width_rad) for each in near]
    )


@pytest.mark.parametrize(
    ("near", "certain"),
    [
        pytest.param([way(0, -1)], [(9, 45)], id="one hand: it may have touched the wall up to 9 degrees further on"),
        pytest.param([way(0, -1), way(13, 1)], [(0, 45), (-32, 13), (-32, 45)], id="both hands, from one point"),
        pytest.param([way(0, -1), way(30, 1)], [(9, 45), (-15, 21)], id="both hands, from two points"),
        pytest.param(
            [way(0, -1)._replace(end_rad=math.radians(8.0))], [(9, 42)], id="the wall may end 8 degrees before"
        ),
        pytest.param([way(0, -1)._replace(is_past_end=True)], [], id="past an end"),
    ],
)
def test_a_wall_certainly_goes_on_from_where_it_was_touched_to_where_it_was_left(
    near: list[NearArc], certain: list[tuple[int, int]]
) -> None:
    found = certain_arcs(near)
    assert [
        (round(math.degrees(math.remainder(start, math.tau))), round(math.degrees(start + width)))
        for start, width in found
    ] == certain


def test_the_part_beyond_the_begin_is_known_by_the_edge_of_an_arc() -> None:
    beyond = [Arc(math.radians(-9.0), math.radians(9.0))]
    assert begin_width(Arc(math.radians(351.0), 1.0), -1, beyond) == math.radians(9.0)
    assert begin_width(Arc(math.radians(-9.0), 1.0), 1, beyond) == 0.0
    assert begin_width(Arc(math.radians(-20.0), math.radians(20.0)), 1, beyond) == math.radians(9.0)


def test_the_part_past_the_end_of_a_way_follows_its_arc() -> None:
    past = [Arc(math.radians(-9.0), math.radians(9.0))]
    assert end_width(Arc(0.0, 1.0), 1, past) == math.radians(9.0)
    assert end_width(Arc(0.0, 1.0), -1, past) == 0.0
    assert end_width(Arc(math.radians(-69.0), math.radians(60.0)), -1, past) == math.radians(9.0)


def test_the_ways_round_both_sides_of_a_jamb_close_nothing_before_it() -> None:
    """A robot in front of the jamb of a door follows its faces, one after the other, and touches its edge first."""
    slots = Slots()
    slots.occupant[0] = 3
    plans = WallPlans(PlannerParameters(), slots, SwarmProof())
    edge_x, edge_y = 0.1, 0.024
    round_it = [math.radians(each) for each in range(20, 100, 10)]
    along = {
        -1: [NearPoint((0.03, 0.0), (math.radians(5.0),)), *(NearPoint((0.03, 0.02 * n), (0.0,)) for n in range(1, 9))],
        1: [
            *(
                NearPoint((edge_x - RADIUS_M * math.cos(each), edge_y - RADIUS_M * math.sin(each)), (each,))
                for each in round_it
            ),
            *(NearPoint((edge_x + 0.02 * n, edge_y - RADIUS_M), (math.pi / 2.0,)) for n in range(1, 9)),
        ],
    }
    for hand, points in along.items():
        drawn = NearWay((0.0, 0.0), hand, RADIUS_M, swept_only=True)
        for each in points:
            drawn.take(each)
        plans.note_near(0, drawn.walls(), hand, 3)
    arcs = [each for each in slots.near[0] if each.begin_rad > 0.0]
    assert [each.hand for each in arcs] == [-1, 1]
    assert [each.arc.width_rad + raw.begin_rad for each, raw in zip(between_begins(arcs), arcs, strict=True)] == (
        pytest.approx([each.arc.width_rad for each in arcs])
    )
