"""Ends of followed walls without a coordinator: a slot does not look past an end, unless a robot stands there."""

import math
from collections.abc import Sequence

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.slot_proof import SlotProof
from zwerm.agents.sensor_coverage.frontier.strips.stretches import StretchTracker
from zwerm.agents.sensor_coverage.frontier.wall_proof import WalkPoint, WallStep
from zwerm.maths.simplicial import FlagComplex

RADIUS_M = 0.07
SOUTH = -math.pi / 2.0
PLACE = 0.0, 0.2
# A way to the east along a wall in the south. Slot 0 sees its ends at -23.4 and -8.2 degrees, and the last touched point at
# -12.5 degrees.
EAST = tuple((0.1 * each, RADIUS_M) for each in range(3, 10))
WALK = 5


def point(at: tuple[float, float], robots: tuple[int, ...] = (), sees: bool = True) -> WalkPoint:
    there = math.atan2(at[1] - PLACE[1], at[0] - PLACE[0])
    return WalkPoint({0: there} if sees else {1: 0.0}, (SOUTH,), robots, at=at)


def view(proof: SlotProof, *standing: int) -> None:
    """Let the proof of slot 0 see robots at these slots in the north."""
    views = {0: dict.fromkeys(standing, math.pi / 2.0)} | {each: {0: -math.pi / 2.0} for each in standing}
    proof.update(0, ScanResult(views, FlagComplex(views), ()), ())


def walk(points: Sequence[WalkPoint], *standing: int) -> tuple[SlotProof, StretchTracker]:
    """Return the proof of slot 0 after a walk, and the walking robot's stretches."""
    proof, tracker = SlotProof(), StretchTracker(-1, RADIUS_M)
    view(proof, *standing)
    last: WallStep | None = None
    for number, each in enumerate(points):
        tracker.take(number, each.at, each.walls, each.robots, each.seen)
        if tracker.latest is not None:
            proof.extend(WALK, tracker.latest)
        if 0 in each.seen:
            step = WallStep(None if last is None else last.point, each, -1, (), number)
            proof.pass_step(WALK, last, step, tracker.latest)
            last = step
    return proof, tracker


def closed_deg(proof: SlotProof) -> list[tuple[int, int]]:
    """Return the first and the last closed direction [degrees]."""
    return [
        (
            round(math.degrees(math.remainder(each.start_rad + each.width_rad, math.tau))),
            round(math.degrees(math.remainder(each.start_rad, math.tau))),
        )
        for each in proof.open_arcs()
        if each.width_rad < math.tau
    ]


def test_a_slot_does_not_look_past_the_end_of_a_wall() -> None:
    proof, _ = walk([point(each) for each in EAST])
    assert closed_deg(proof) == [(-23, -13)]
    proof.end_walk(WALK)
    assert closed_deg(proof) == [(-23, -13)], "the walk is over, and its arcs are kept"


def test_an_end_is_tied_while_a_robot_stands_there() -> None:
    proof, _ = walk([*(point(each) for each in EAST[:-1]), point(EAST[-1], (1,))], 1)
    assert closed_deg(proof) == [(-23, -8)]
    proof.end_walk(WALK)
    assert closed_deg(proof) == [(-23, -8)]
    heir = SlotProof()
    heir.inherit(proof.memory())
    for each, last_deg in ((heir, -8), (proof, -8)):
        view(each, 1)
        assert closed_deg(each) == [(-23, last_deg)]
    for each in (heir, proof):
        view(each)
        assert closed_deg(each) == [(-23, -13)], "the robot at the end is gone"


def test_a_walking_robot_that_stays_at_the_end_ties_it() -> None:
    proof, tracker = walk([point(each) for each in EAST], 3)
    assert tracker.latest is not None
    assert proof.extend(WALK, tracker.latest.tied_at_end(3))
    assert closed_deg(proof) == [(-23, -8)]
    assert not proof.extend(WALK, tracker.latest), "nothing is new"
    assert not proof.extend(WALK + 1, tracker.latest), "this slot saw no part of that walk"


def test_where_a_slot_loses_sight_of_the_walking_robot_others_see_the_end() -> None:
    proof, _ = walk([*(point(each) for each in EAST[:4]), *(point(each, sees=False) for each in EAST[4:])], 1)
    assert closed_deg(proof) == [(-23, -12)], "the last point in sight is at -12.2 degrees"


@pytest.mark.parametrize("handed_on", [False, True])
def test_what_a_lost_robot_saw_closes_nothing(handed_on: bool) -> None:
    points = [point(each)._replace(seen={**point(each).seen, 2: 1.0}) for each in EAST]
    proof, _ = walk(points, 2)
    if handed_on:
        memory, proof = proof.memory(), SlotProof()
        proof.inherit(memory)
        view(proof, 2)
    assert closed_deg(proof) == [(-23, -13)]
    proof.lose(2)
    assert closed_deg(proof) == []
