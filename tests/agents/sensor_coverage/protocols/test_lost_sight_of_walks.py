"""Edges of sight without a coordinator: a slot loses sight of a walk at a corner, and others are responsible beyond."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.slot_proof import EDGES_MAX, SlotProof
from zwerm.agents.sensor_coverage.frontier.strips.stretches import StretchTracker
from zwerm.agents.sensor_coverage.frontier.wall_proof import BLIND_MAX, WalkPoint, WallStep
from zwerm.agents.sensor_coverage.messages.beacons import NOWHERE
from zwerm.agents.sensor_coverage.messages.commands import NearArcs, NearWalls
from zwerm.maths.simplicial import FlagComplex

WALK = 5
BEFORE, BEYOND = (150, 200, 250), (250, 318, 330)
# The robots at slots 1, 2 and 3 close the directions that the walks do not.
ROBOTS = {1: 325, 2: 60, 3: 155}
EDGE = 245, 255
SEER = 9  # another slot that saw the walks


def near(*arcs_deg: tuple[int, int]) -> NearArcs:
    """Return arcs (start, width) [rad] around the slot."""
    return tuple((math.radians(start), math.radians(width)) for start, width in arcs_deg)


def look(proof: SlotProof, *absent: int) -> None:
    """Let the proof of slot 7 see the robots."""
    there = {slot: math.radians(each) for slot, each in ROBOTS.items() if slot not in absent}
    views = {7: there} | {slot: {7: 0.0} | {other: 0.0 for other in there if abs(other - slot) == 1} for slot in there}
    proof.update(7, ScanResult(views, FlagComplex(views), ()), ())


def opened(proof: SlotProof) -> list[tuple[int, int]]:
    """Return the open arcs [deg]."""
    return sorted(
        (round(math.degrees(start)) % 360, round(math.degrees(start + width)) % 360)
        for start, width in proof.open_arcs()
    )


def follow(
    proof: SlotProof,
    walk: int,
    directions_deg: tuple[int, ...],
    hidden: tuple[tuple[int, ...], ...] = (),
    tracker: StretchTracker | None = None,
    first: int = 1,
) -> bool:
    """Let a robot with the wall at its right hand pass slot 7 in these directions; it was hidden before.

    With a `tracker` of its way before the points continue from the number `first`.

    Return whether less is open after the last point.
    """
    last: WallStep | None = None
    smaller = False
    tracker = tracker or StretchTracker(-1, 0.0)
    for number, each in enumerate(directions_deg, first):
        point = WalkPoint({7: math.radians(each), SEER: 0.0}, (math.radians(each),), ())
        tracker.take(number, point.at, point.walls, (), (7, SEER))
        step = WallStep(None if last is None else last.point, point, -1, (), number)
        smaller = proof.pass_step(walk, last, step, tracker.latest, hidden if last is None else ())
        last = step
    return smaller


@pytest.mark.parametrize("witnesses", [(), (1,), (1, 2)])
def test_an_edge_of_sight_is_open_unless_a_robot_saw_what_is_behind_it(witnesses: tuple[int, ...]) -> None:
    proof = SlotProof()
    look(proof)
    follow(proof, WALK, BEFORE)
    assert proof.lose_sight(WALK, 4, witnesses) is None
    proof.lose_sight(WALK, 5, ())  # nothing is new
    assert opened(proof) == [(250, 325)], "an edge is not asked for where an arc is open"
    assert follow(proof, WALK + 1, BEYOND, (witnesses,)), "the last arc is closed, and only the edge may be open"
    assert opened(proof) == ([] if witnesses else [EDGE])
    for walk in (WALK, WALK + 1):
        proof.end_walk(walk, 9, 2)
    assert opened(proof) == ([] if witnesses else [EDGE]), "both walks are over"
    heir = SlotProof()
    heir.inherit(proof.memory(), proof.edges())
    look(heir)
    assert opened(heir) == opened(proof)
    look(heir, 2)
    assert opened(heir) == [(330, 150)], "an arc is open"


@pytest.mark.parametrize("over", [False, True])
def test_an_edge_opens_when_the_robot_that_saw_beyond_is_lost(over: bool) -> None:
    proof = SlotProof()
    look(proof)
    follow(proof, WALK, BEFORE)
    proof.lose_sight(WALK, 4, (2,))
    follow(proof, WALK + 1, BEYOND, ((2,),))
    if over:
        proof.end_walk(WALK)
        proof.end_walk(WALK + 1)
    assert opened(proof) == []
    proof.lose(2)
    assert opened(proof) == [EDGE]
    proof.lose(SEER)
    assert opened(proof) == [(155, 325)], "this one saw the walks themselves"


@pytest.mark.parametrize(
    ("last_number", "end", "is_open"),
    [
        pytest.param(3, NOWHERE, False, id="the walk ended in sight"),
        pytest.param(3 + BLIND_MAX, NOWHERE, False, id="and then touched no wall"),
        pytest.param(9, NOWHERE, True, id="nobody said who saw the rest"),
        pytest.param(9, 2, False, id="the walking robot stands there"),
    ],
)
def test_a_walk_that_ends_out_of_sight_leaves_an_edge(last_number: int, end: int, is_open: bool) -> None:
    proof = SlotProof()
    look(proof)
    follow(proof, WALK + 1, BEYOND)
    follow(proof, WALK, BEFORE)
    proof.end_walk(WALK, last_number, end)
    assert opened(proof) == ([(245, 250)] if is_open else [])


def test_another_walk_closes_an_edge() -> None:
    proof = SlotProof()
    look(proof)
    follow(proof, WALK, BEFORE)
    follow(proof, WALK + 1, BEYOND, ((),))
    assert opened(proof) == [(250, 255)]
    assert follow(proof, WALK + 2, (230, 250, 270))
    assert opened(proof) == []


@pytest.mark.parametrize(
    ("near_deg", "is_open"),
    [
        pytest.param(((235, 30),), False, id="one walk passes the edge"),
        pytest.param(((220, 38), (242, 38)), True, id="two walks meet there"),
    ],
)
def test_a_robot_that_follows_the_wall_close_to_its_slot_past_an_edge_closes_it(
    near_deg: tuple[tuple[int, int], ...], is_open: bool
) -> None:
    """Also for the next robot at the slot, and if the walking robot is lost that stood for what is beyond."""
    proof, heir = SlotProof(), SlotProof()
    look(proof)
    follow(proof, WALK, BEFORE)
    follow(proof, WALK + 1, BEYOND, ((4,),))
    for start, width in near_deg:
        proof.add_near(NearWalls(near((start, width))))
    assert opened(proof) == []
    proof.lose(4)
    heir.inherit(proof.memory(), proof.edges())
    look(heir)
    for each in (proof, heir):
        assert bool(opened(each)) is is_open


def test_a_wall_close_to_a_slot_ends_where_its_robot_turned_back() -> None:
    proof = SlotProof()
    look(proof)
    follow(proof, WALK, BEYOND)
    proof.add_near(NearWalls(near((150, 60), (200, 50)), past_ends=near((250, 15))))
    assert opened(proof) == [(245, 250)]
    proof.add_near(NearWalls(near((240, 20))))
    assert opened(proof) == []
    heir = SlotProof()
    heir.inherit(proof.memory())
    look(heir)
    heir.lose(NOWHERE)
    assert opened(heir) == []


def test_the_next_occupant_learns_the_latest_edges() -> None:
    proof = SlotProof()
    look(proof)
    for number in range(EDGES_MAX + 5):
        follow(proof, number, (100, 100 + number))
        proof.lose_sight(number, 3, range(20))
    edges = proof.edges()
    assert len(edges) == EDGES_MAX
    assert edges[-1][0] == math.radians(100 + EDGES_MAX + 4)


@pytest.mark.parametrize("over", [False, True])
@pytest.mark.parametrize("passes_in_sight", [True, False])
def test_an_edge_is_open_only_where_the_walk_did_not_pass_in_sight(over: bool, passes_in_sight: bool) -> None:
    """The robot goes round an obstacle twice, and stops in front of slot 7. Then it leaves."""
    proof = SlotProof()
    look(proof)
    tracker, number = StretchTracker(-1, 0.0), 0
    for each_round in [(150, 200, 250, 318, 330) if passes_in_sight else (250, 318, 330), (150, 200, 250)]:
        follow(proof, WALK, each_round, tracker=tracker, first=number + 1)
        number += len(each_round)
        proof.lose_sight(WALK, number + 1, (2,))
    if over:
        proof.end_walk(WALK, number, 2)
    assert opened(proof) == []
    proof.lose(2)
    assert opened(proof) == ([] if passes_in_sight else [EDGE])
