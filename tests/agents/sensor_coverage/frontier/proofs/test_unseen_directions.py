"""Where only one slot saw walks, it does not rely on a neighbour that stood there and saw nothing of them."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.slot_proof import SlotProof
from zwerm.agents.sensor_coverage.frontier.proofs.unseen_directions import UnseenDirections
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, WalkPoint, WallStep
from zwerm.agents.sensor_coverage.messages.pushes import ProvedArc, WalkTriangle
from zwerm.maths.simplicial import FlagComplex

PAIR = {0: {1: 0.0}, 1: {0: math.pi}}
# Closes 45 degrees at slot 0, up to slot 1.
TRIANGLE = WalkTriangle(1, 1, math.radians(45.0), 0, 0, 1, -1)
PROVED = ProvedArc((1,), (1,), math.radians(-45.0), math.radians(45.0), TRIANGLE)


@pytest.mark.parametrize(
    ("direction_deg", "start_deg", "width_deg", "is_within"),
    [
        (10.5, 0.0, 45.0, True),
        (10.5, 9.9, 45.0, False),
        (43.5, 0.0, 45.0, False),
        (-10.5, -45.0, 45.0, True),
        (1.5, -45.0, 60.0, True),
        (-90.5, -45.0, 60.0, False),
        (0.5, 0.0, 3.0, False),
    ],
)
def test_a_direction_is_within_an_arc_two_degrees_or_more_from_its_sides(
    direction_deg: float, start_deg: float, width_deg: float, is_within: bool
) -> None:
    unseen, arc = UnseenDirections(), Arc(math.radians(start_deg), math.radians(width_deg))
    unseen.note(1, math.radians(direction_deg))
    assert unseen.within(1, arc) is is_within
    assert not unseen.within(2, arc)


@pytest.mark.parametrize(
    ("seen", "unplaced", "counts"),
    [
        pytest.param({0: -20.0}, (), False, id="only slot 0 saw the walk"),
        pytest.param({0: -20.0, 1: 170.0}, (), True, id="slot 1 saw it, too"),
        pytest.param({0: -20.0, 2: 170.0}, (), True, id="another slot saw it"),
        pytest.param({0: -20.0}, (-7,), True, id="a robot without a known slot saw it"),
        pytest.param({0: 20.0}, (), True, id="the walk was on the other side"),
    ],
)
def test_a_triangle_counts_unless_only_this_slot_saw_a_walk_in_its_angle(
    seen: dict[int, float], unplaced: tuple[int, ...], counts: bool
) -> None:
    proof, scan = SlotProof(), ScanResult(PAIR, FlagComplex(PAIR), ())
    proof.inherit([PROVED])
    proof.update(0, scan, ())
    assert sum(each.width_rad for each in proof.open_arcs()) == pytest.approx(math.radians(315.0))
    point = WalkPoint({slot: math.radians(each) for slot, each in seen.items()}, (0.0,), (), unplaced=unplaced)
    proof.pass_step(5, None, WallStep(None, point, -1, (), 1), None)
    assert sum(each.width_rad for each in proof.open_arcs()) == pytest.approx(math.radians(315.0 if counts else 360.0))
    assert (PROVED in proof.memory()) is counts, "the slot's next occupant does not know why"


def test_a_walk_from_before_a_neighbour_stood_there_says_nothing() -> None:
    proof = SlotProof()
    proof.update(0, ScanResult({0: {}}, FlagComplex({0: {}}), ()), ())
    point = WalkPoint({0: math.radians(-20.0)}, (0.0,), ())
    proof.pass_step(5, None, WallStep(None, point, -1, (), 1), None)
    memory = (*proof.memory(), PROVED)
    heir = SlotProof()
    heir.inherit(memory)
    heir.update(0, ScanResult(PAIR, FlagComplex(PAIR), ()), ())
    assert PROVED in heir.memory()
