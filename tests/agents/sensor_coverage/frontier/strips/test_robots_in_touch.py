"""A robot in touch with a wall and with another robot: whether the other one's walls close what is between them."""

import math
from collections.abc import Mapping

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.slots import Slots
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc, Walk, WalkPoint
from zwerm.agents.sensor_coverage.messages.commands import Sighting
from zwerm.maths.simplicial import FlagComplex

# Slot 1 is at the right of slot 0, in touch with it.
VIEWS: Mapping[int, Mapping[int, float]] = {0: {1: 0.0}, 1: {0: math.pi}}
SCAN = ScanResult(VIEWS, FlagComplex(VIEWS), ())
# Behind the body, and beside the wall in touch at 150 degrees.
APART_DEG = 360 - 50 - 90


@pytest.mark.parametrize("named", [8, 7])
def test_robots_are_in_touch_if_each_of_them_touches_one_in_the_direction_of_the_other(named: int) -> None:
    """Robot 7 touches one without a slot, and names robot 8 behind it. Robot 9 touches robot 8, and names one in line."""
    slots, line = Slots(), (7, 20, 8, 9)
    for robot, touched in ((7, 8), (8, 9), (9, named)):
        slots.touch(slots.add(robot), (), (touched,))
        others = (each for each in line if each != robot)
        slots.take(robot, (Sighting(each, 0.0 if line.index(each) > line.index(robot) else math.pi) for each in others))
    assert slots.slots_in_touch()[0] == ()
    assert slots.slots_in_touch()[1] == (2,)


def update(proof: SwarmProof, wall_deg: int, *near_deg: tuple[int, int]) -> None:
    """Take in that slot 0 touches a wall in a direction, and the arcs (start, width) of walls close to slot 1."""
    hand = 1 if wall_deg > 0 else -1
    near = [NearArc(Arc(math.radians(start), math.radians(width)), hand) for start, width in near_deg]
    proof.update(SCAN, (), {0: [math.radians(wall_deg)]}, {1: near}, {0: (1,), 1: (0,)})


def open_deg(proof: SwarmProof) -> int:
    """Return the sum of the open arcs of slot 0 in whole degrees."""
    return round(sum(math.degrees(each.width_rad) for each in proof.open_arcs()[0]))


@pytest.mark.parametrize(
    ("wall_deg", "near_deg", "expected_deg"),
    [
        pytest.param(150, (150, 28), 360 - 25 - 195, id="slot 1 knows the wall at the contact"),
        pytest.param(-150, (182, 28), 360 - 25 - 195, id="the same on the other side"),
        pytest.param(150, (150, 20), APART_DEG, id="the wall that slot 1 knows ends before the contact"),
        pytest.param(150, (168, 10), APART_DEG, id="the wall that slot 1 knows begins behind the contact"),
        pytest.param(150, (182, 28), APART_DEG, id="slot 1 knows a wall on the other side"),
    ],
)
def test_the_walls_of_the_other_robot_close_the_mouth_that_the_two_fill(
    wall_deg: int, near_deg: tuple[int, int], expected_deg: int
) -> None:
    proof = SwarmProof()
    update(proof, wall_deg, near_deg)
    assert open_deg(proof) == expected_deg


def test_the_mouth_is_open_again_when_the_other_robot_knows_its_walls_no_more() -> None:
    proof = SwarmProof()
    for near_deg, expected_deg in (([], APART_DEG), ([(150, 28)], 360 - 25 - 195), ([], APART_DEG)):
        update(proof, 150, *near_deg)
        assert open_deg(proof) == expected_deg


@pytest.mark.parametrize(
    ("wall_deg", "counts"),
    [
        pytest.param(-150, False, id="slot 1 sees the point between the robot in touch and a wall"),
        pytest.param(150, True, id="the wall in touch is on the other side"),
    ],
)
def test_a_slot_does_not_rely_on_one_that_relies_on_its_body_beside_a_wall(wall_deg: int, counts: bool) -> None:
    """As drawn building 826 showed: slot 1 touches a wall on one side, and on the other one a walk leads past it."""
    degrees = ({0: -70, 1: -160}, {0: -45, 1: -135}, {0: -30, 1: -110})
    points = [WalkPoint({slot: math.radians(d) for slot, d in each.items()}, (-math.pi / 2.0,), ()) for each in degrees]
    proof = SwarmProof()
    proof.update(SCAN, (Walk(0, -1, tuple(points)),), {1: [math.radians(wall_deg + 20)]}, {}, {1: (0,)})
    triangles = {pair for number in range(len(points)) for pair in proof._triangles.pairs(number)}
    assert ((0, 1) in triangles) is counts
