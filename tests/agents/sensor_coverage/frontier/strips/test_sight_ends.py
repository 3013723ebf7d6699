"""Edges of sight: where one wall ends before another one, and nobody stands for the space behind the corner."""

import math

import pytest

from zwerm.agents.sensor_coverage.frontier.plan import ScanResult
from zwerm.agents.sensor_coverage.frontier.proofs.passed_points import LeftWall, left_at_bodies, passes, still_counting
from zwerm.agents.sensor_coverage.frontier.proofs.swarm_proof import SwarmProof
from zwerm.agents.sensor_coverage.frontier.strips.sight_ends import (
    SightEnd,
    beside_edge,
    dark_ends_at,
    sight_ends_at,
    united_round,
    with_islands,
    without_edges,
)
from zwerm.agents.sensor_coverage.frontier.strips.stretches import stretches_of
from zwerm.agents.sensor_coverage.frontier.strips.way_begins import certain_arcs
from zwerm.agents.sensor_coverage.frontier.wall_proof import Arc, NearArc, Walk, WalkPoint
from zwerm.maths.simplicial import FlagComplex

SOUTH = (-math.pi / 2.0,)
VIEWS = {0: {1: 0.0}, 1: {0: math.pi}}
SCAN = ScanResult(VIEWS, FlagComplex({slot: set(seen) for slot, seen in VIEWS.items()}), ())


def degrees(arcs: list[Arc]) -> list[tuple[int, int]]:
    """Return the starts and ends of arcs [deg]."""
    return [(round(math.degrees(start)) % 360, round(math.degrees(start + width)) % 360) for start, width in arcs]


def arc(start: int, end: int) -> Arc:
    return Arc(math.radians(start), math.radians(end - start))


def point(**seen: int) -> WalkPoint:
    """Return a point in touch with a wall, in the directions [deg] from some slots."""
    return WalkPoint({int(slot[1:]): math.radians(each) for slot, each in seen.items()}, SOUTH, ())


def open_at_0(*walks: tuple[WalkPoint, ...], near: tuple[NearArc, ...] = ()) -> list[tuple[int, int]]:
    """Return the open arcs of slot 0 [deg] after some walks with the wall at the right hand."""
    proof = SwarmProof()
    proof.update(SCAN, [Walk(0, -1, each) for each in walks], {}, {0: near}, {})
    return degrees(proof.open_arcs()[0])


BEFORE = point(_0=150), point(_0=200), point(_0=250)
BEYOND = point(_0=250), point(_0=290), point(_0=330)
AT_ROBOT = WalkPoint({0: math.radians(250)}, (), (7,))
AT_BODY = WalkPoint({0: math.radians(250)}, (), (), at_body=True)
BODY = LeftWall(())
TWO_ROBOTS = LeftWall((7,)), LeftWall((8,))


@pytest.mark.parametrize(
    ("behind", "opened"),
    [
        pytest.param(point(_1=200), [(330, 150)], id="slot 1 saw the wall behind the corner"),
        pytest.param(point(_2=200), [(245, 255), (330, 150)], id="the slot that saw it is empty"),
        pytest.param(point(), [(245, 255), (330, 150)], id="nobody saw it"),
    ],
)
def test_an_edge_of_sight_is_open_if_nobody_stands_for_what_is_behind_it(
    behind: WalkPoint, opened: list[tuple[int, int]]
) -> None:
    assert sorted(open_at_0((*BEFORE, behind), (behind, *BEYOND))) == opened


@pytest.mark.parametrize(("behind", "proved"), [(point(_1=200), True), (point(), False)])
def test_no_slot_answers_for_the_space_behind_an_edge_of_sight_that_nobody_saw(behind: WalkPoint, proved: bool) -> None:
    """Two slots that ask a third one, and of which one relies on the other, would rely on each other."""
    proof = SwarmProof()
    proof.update(SCAN, [Walk(0, -1, each) for each in ((*BEFORE, behind), (behind, *BEYOND))], {}, {}, {})
    assert proof._is_proved(0, math.radians(248.0), 1) is proved
    assert proof._is_proved(0, math.radians(220.0), 1)


def test_a_slot_answers_for_a_point_by_the_stretch_of_wall_on_which_it_lies_or_by_walls_close_to_it() -> None:
    proof = SwarmProof()
    walks = [Walk(0, -1, each) for each in (BEFORE, BEYOND)]
    proof.update(SCAN, walks, {}, {0: [NearArc(arc(20, 80), 1)]}, {})
    first, second = 0, len(BEFORE)
    for there, stretch, answers in ((220, first, True), (220, second, False), (50, first, True), (50, second, True)):
        assert proof._is_witness(0, math.radians(there), (1, 2), stretch) is answers
    assert not proof._is_witness(2, math.radians(220.0), (0, 1), first), "the slot is empty"


@pytest.mark.parametrize(
    ("neighbours", "answers"),
    [
        pytest.param({0: {1, 2}, 1: {2}}, True, id="in the triangle with slots 1 and 2"),
        pytest.param({0: {1, 2}, 1: {2, 3}, 2: {3}}, False, id="slot 3 is beyond that triangle"),
        pytest.param({0: {1, 2}, 1: {2, 3}}, True, id="slot 3 is beside it"),
    ],
)
def test_a_triangle_of_robots_answers_for_a_point_if_no_slot_that_asks_is_beyond_it(
    neighbours: dict[int, set[int]], answers: bool
) -> None:
    at = {0: (0.0, 0.0), 1: (1.0, -0.5), 2: (1.0, 0.5), 3: (2.0, 0.0), 4: (3.0, 0.0)}
    pairs = [(a, b) for a, others in neighbours.items() for b in others]
    views: dict[int, dict[int, float]] = {slot: {} for slot in at}
    for a, b in [*pairs, *((b, a) for a, b in pairs)]:
        views[a][b] = math.atan2(at[b][1] - at[a][1], at[b][0] - at[a][0])
    proof = SwarmProof()
    proof.update(ScanResult(views, FlagComplex({slot: set(seen) for slot, seen in views.items()}), ()), (), {}, {}, {})
    assert proof._is_witness(0, 0.0, (3, 4), 0) is answers


def test_an_edge_of_sight_beside_an_open_arc_opens_nothing() -> None:
    assert open_at_0((*BEFORE, point())) == [(250, 150)]


def test_another_wall_closes_an_edge_of_sight() -> None:
    across = point(_0=230), point(_0=250), point(_0=270)
    assert open_at_0((*BEFORE, point()), (point(), *BEYOND), across) == [(330, 150)]


@pytest.mark.parametrize(
    ("behind", "opened"),
    [
        pytest.param(point(_1=200), [(330, 150)], id="slot 1 saw what is behind it"),
        pytest.param(point(_2=200), [(245, 255), (330, 150)], id="the slot that saw it is empty"),
        pytest.param(point(), [(245, 255), (330, 150)], id="nobody saw it"),
    ],
)
def test_two_other_walls_that_meet_there_do_not_close_a_dark_edge(
    behind: WalkPoint, opened: list[tuple[int, int]]
) -> None:
    """The noise of bearings may make walls on both sides of a passage meet."""
    sides = (point(_0=220), point(_0=235), point(_0=251)), (point(_0=249), point(_0=265), point(_0=280))
    assert sorted(open_at_0((*BEFORE, behind), (behind, *BEYOND), *sides)) == opened


@pytest.mark.parametrize(("seen_by_2", "opened"), [(True, [(245, 255), (280, 150)]), (False, [(290, 150)])])
def test_an_edge_of_sight_is_where_a_walk_counts_no_more_because_a_slot_that_saw_it_is_gone(
    seen_by_2: bool, opened: list[tuple[int, int]]
) -> None:
    """What is beyond was the part of slot 2. Two other walls, which it did not see, do not close it."""
    by_2 = {"_2": 90} if seen_by_2 else {}
    walk = (*BEFORE, point(_0=260, **by_2), point(_0=275, **by_2), point(_0=290, **by_2))
    sides = (point(_0=220), point(_0=235), point(_0=251)), (point(_0=249), point(_0=265), point(_0=280))
    walks, proof = [Walk(0, -1, each) for each in (walk, *sides)], SwarmProof()
    views = {**VIEWS, 2: {0: 1.0}}
    proof.update(
        SCAN._replace(views=views, complex_=FlagComplex({**SCAN.complex_.neighbours, 2: set()})), walks, {}, {}, {}
    )
    proof.update(SCAN, walks, {}, {}, {})
    assert sorted(degrees(proof.open_arcs()[0])) == opened


@pytest.mark.parametrize(
    ("gone", "edges"),
    [
        pytest.param(set(), {}, id="all stand"),
        pytest.param({2}, {2: 30, 6: 60}, id="they begin and end where all stand again"),
        pytest.param({1}, {}, id="nothing counts"),
    ],
)
def test_points_count_no_more_if_a_slot_that_saw_them_is_gone(gone: set[int], edges: dict[int, int]) -> None:
    seen_by_2 = (False, False, False, True, True, False, False, False)
    points = [point(_0=10 * (n + 1), _1=0, **({"_2": 0} if seen else {})) for n, seen in enumerate(seen_by_2)]
    of_0 = [each for slot, each in passes(Walk(0, -1, tuple(points)), 0) if slot == 0]
    counting = still_counting(0, of_0, gone, (0, 1))
    assert [each.number for each in counting] == {0: [*range(8)], 2: [0, 1, 2, 6, 7], 1: []}[sum(gone)]
    ends = {each.number: round(math.degrees(end.direction_rad)) for each in counting for end in each.dark_ends}
    assert ends == edges
    assert all(each.sight_ends == each.dark_ends for each in counting)


@pytest.mark.parametrize(
    ("standing", "direction_deg", "edges"), [((0, 3), 33, [60]), ((0, 3), 45, [30, 60]), ((0,), 33, [30, 60])]
)
def test_a_later_walk_that_goes_on_in_sight_of_a_slot_closes_the_edge_where_an_earlier_one_counts_no_more(
    standing: tuple[int, ...], direction_deg: int, edges: list[int]
) -> None:
    seen_by_2 = (False, False, False, True, True, False, False, False)
    earlier = [point(_0=10 * (n + 1), **({"_2": 0} if seen else {})) for n, seen in enumerate(seen_by_2)]
    later = [point(_0=direction_deg - 20), point(_0=direction_deg), point(_3=0)]
    walks = [each for first, points in ((0, earlier), (8, later)) for each in passes(Walk(0, -1, tuple(points)), first)]
    counting = still_counting(0, [each for slot, each in walks if slot == 0], {2}, standing)
    found = [end for each in counting if each.number < 8 for end in each.dark_ends]
    assert [round(math.degrees(each.direction_rad)) for each in found] == edges


@pytest.mark.parametrize(("last", "passes_edge"), [(290, True), (270, False)])
def test_a_wall_that_nobody_saw_go_on_passes_no_other_edge_close_to_its_end(last: int, passes_edge: bool) -> None:
    """Seen by a robot in touch, it ends up to 30 degrees beside the direction of the robot."""
    across = point(_0=215), point(_0=235), point(_0=255), point(_0=last), point()
    opened = open_at_0((*BEFORE, point()), (point(), *BEYOND), across)
    assert ((245, 255) not in opened) is passes_edge


@pytest.mark.parametrize(("hand", "opened"), [(1, [(330, 150)]), (-1, [(245, 250), (330, 150)])])
def test_a_wall_close_to_a_slot_ends_where_its_robot_turned_back(hand: int, opened: list[tuple[int, int]]) -> None:
    """With the wall at its right hand the robot moved to the left, and nobody saw how the wall goes on there."""
    near = NearArc(arc(150, 250), hand)
    assert sorted(open_at_0(BEYOND, near=(near, NearArc(arc(150, 160), -hand)))) == opened


@pytest.mark.parametrize(
    ("near", "opened"),
    [
        pytest.param((arc(235, 265),), [(330, 150)], id="one walk passes the edge"),
        pytest.param((arc(220, 257), arc(248, 280)), [(245, 255), (330, 150)], id="two walks meet there"),
    ],
)
def test_a_robot_that_follows_the_wall_close_to_its_slot_past_an_edge_closes_it(
    near: tuple[Arc, ...], opened: list[tuple[int, int]]
) -> None:
    """The walking robot stood in front of this wall when its walk ended, and has left."""
    both = tuple(NearArc(each, -1) for each in near)
    assert sorted(open_at_0((*BEFORE, point()), (point(), *BEYOND), near=both)) == opened


def test_the_ends_of_what_a_slot_saw_are_found_past_points_without_a_contact() -> None:
    blind = WalkPoint({0: 0.5}, (), ())
    points = [point(_0=10), blind, point(_1=20, _2=30)]
    assert list(sight_ends_at(0, 0, points)) == [SightEnd(math.radians(10), (1, 2))]
    assert list(sight_ends_at(0, 0, points[:2])) == [], "the walk ends in sight"
    assert list(sight_ends_at(0, 1, points[:2], 7)) == [SightEnd(points[1].seen[0], (7,))], "robot 7 stands there"
    assert list(sight_ends_at(1, 2, points)) == [SightEnd(math.radians(20), (0,))]


def test_a_slot_that_saw_the_next_point_counts_for_a_dark_edge_also_if_the_walk_began_there() -> None:
    hidden = point(_2=20)
    before, after = point(_0=10), point(_0=30)
    assert list(dark_ends_at(0, 0, [before, point(), after])) == [SightEnd(math.radians(10), ())]
    assert list(dark_ends_at(0, 0, [before, hidden, after])) == [SightEnd(math.radians(10), (2,))]
    assert not list(dark_ends_at(0, 0, [before, hidden.unseen_by((2,)), after])), "the robot of slot 2 has moved"
    assert not list(dark_ends_at(0, 0, [before])), "the walk ends in sight"


@pytest.mark.parametrize(
    ("between", "left"),
    [
        pytest.param((), {}, id="the same wall"),
        pytest.param((AT_BODY,), {1: (BODY,), 3: (BODY,)}, id="a body, then another wall"),
        pytest.param((AT_BODY, AT_BODY, AT_BODY, AT_BODY), {1: (BODY,), 6: (BODY,)}, id="a long way round a body"),
        pytest.param((point()._replace(walls=()),), {}, id="a corner"),
        pytest.param(
            (AT_ROBOT,),
            {1: (LeftWall((7,)),), 3: (LeftWall((7,)),)},
            id="a robot at a slot, which answers for what is behind it",
        ),
        pytest.param((AT_ROBOT, AT_ROBOT._replace(robots=(8,))), {1: TWO_ROBOTS, 4: TWO_ROBOTS}, id="two robots"),
    ],
)
def test_a_robot_that_leaves_a_wall_at_a_body_may_have_passed_an_opening(
    between: tuple[WalkPoint, ...], left: dict[int, tuple[LeftWall, ...]]
) -> None:
    other = point(_0=30)._replace(walls=(math.pi,) if between else SOUTH)
    walk = Walk(0, -1, (point(_0=10), point(_0=20), *between, other, point(_0=50)))
    assert left_at_bodies(walk.points, stretches_of(walk), 0.07) == left


@pytest.mark.parametrize(("beyond_deg", "aside"), [(80, ()), (60, ((1, arc(60, 90)),))])
def test_a_slot_that_saw_both_walls_beside_each_other_has_no_edge_of_sight_there(
    beyond_deg: int, aside: tuple[tuple[int, Arc], ...]
) -> None:
    """It is open between the two, by itself, and answers for slot 0, which sees them in one direction."""
    other = point(_0=30, _1=beyond_deg)._replace(walls=(math.pi,))
    walk = Walk(0, -1, (point(_0=10, _1=100), point(_0=20, _1=90), AT_BODY, other))
    (left,) = left_at_bodies(walk.points, stretches_of(walk), 0.07)[1]
    assert degrees([each for _, each in left.aside]) == degrees([each for _, each in aside])
    assert [slot for slot in (0, 1) if any(left.end_at(slot, 0.0))] == ([0] if aside else [0, 1])


@pytest.mark.parametrize(
    ("saw", "closed", "opened"),
    [
        pytest.param((), arc(0, 360), {0: [(245, 255)]}, id="no slot saw both walls"),
        pytest.param((90, 60), arc(0, 360), {}, id="slot 1 saw them, and closes what is between them"),
        pytest.param((90, 60), arc(85, 425), {1: [(65, 85)]}, id="it does not"),
    ],
)
def test_a_slot_answers_for_what_is_between_two_walls_if_it_closes_that(
    saw: tuple[int, ...], closed: Arc, opened: dict[int, list[tuple[int, int]]]
) -> None:
    """Nothing else is open. Slot 1 sees the walls on both sides of a body beside each other, slot 0 in one direction."""
    beside = [{1: math.radians(each)} for each in saw] or [{}, {}]
    before = (*BEFORE[:-1], BEFORE[-1]._replace(seen={**BEFORE[-1].seen, **beside[0]}))
    beyond = (BEYOND[0]._replace(seen={**BEYOND[0].seen, **beside[1]}), *BEYOND[1:])
    walk = Walk(0, -1, (*before, AT_BODY, *(each._replace(walls=(math.pi,)) for each in beyond)))
    proof, near = SwarmProof(), {0: (NearArc(arc(325, 510), 1),), 1: (NearArc(closed, 1),)}
    proof.update(SCAN, [walk], {}, near, {})
    assert {slot: degrees(arcs) for slot, arcs in proof.open_arcs().items()} == opened


@pytest.mark.parametrize(("further_m", "left"), [(0.1, {}), (-0.1, {}), (0.2, {0: (BODY,), 2: (BODY,)})])
def test_no_opening_is_between_two_places_of_a_wall_that_are_closer_than_a_body(
    further_m: float, left: dict[int, tuple[LeftWall, ...]]
) -> None:
    """A robot that pushed a body along the wall left the wall beside it, and came to the same wall again."""
    before, after = point(_0=10)._replace(at=(1.0, 0.5)), point(_0=20)._replace(at=(1.0 + further_m, 0.5))
    walk = Walk(0, -1, (before, AT_BODY, after._replace(walls=(math.radians(-95.0),))))
    assert left_at_bodies(walk.points, stretches_of(walk), 0.07) == left
    assert left_at_bodies(walk.points, stretches_of(walk), 0.0) == {0: (BODY,), 2: (BODY,)}


@pytest.mark.parametrize(("between", "opened"), [(AT_BODY, [(245, 255), (330, 150)]), (None, [(330, 150)])])
def test_two_walls_that_meet_where_a_robot_left_one_at_a_body_leave_an_arc_open(
    between: WalkPoint | None, opened: list[tuple[int, int]]
) -> None:
    """A slot that looks along an opening sees the walls on both sides of it in one direction."""
    round_it = () if between is None else (between,)
    assert sorted(open_at_0((*BEFORE, *round_it, *(each._replace(walls=(math.pi,)) for each in BEYOND)))) == opened


def test_an_edge_is_cut_out_of_the_arcs_of_its_stretch() -> None:
    ends = [beside_edge(SightEnd(0.0, ()))]
    assert degrees(without_edges([arc(-40, 40)], ends)) == [(320, 355), (5, 40)]
    assert degrees(without_edges([arc(2, 40)], ends)) == [(5, 40)]
    assert degrees(without_edges([arc(-40, -2)], ends)) == [(320, 355)]
    assert degrees(without_edges([arc(-3, 3), arc(90, 180)], ends)) == [(90, 180)]


@pytest.mark.parametrize(
    ("stretch", "beside"),
    [
        pytest.param((), (355, 5), id="no arc"),
        pytest.param((arc(-20, 40),), (355, 5), id="in an arc"),
        pytest.param((arc(9, 40),), (355, 14), id="the robot is 9 degrees beside the end of the wall"),
        pytest.param((arc(-40, -9),), (346, 5), id="on the other side"),
        pytest.param((arc(9, 40), arc(-40, -4)), (351, 5), id="the closer end"),
        pytest.param((arc(31, 60),), (355, 5), id="too far to be in touch"),
    ],
)
def test_the_end_of_the_wall_beside_the_robot_that_followed_it_is_an_edge_of_sight_too(
    stretch: tuple[Arc, ...], beside: tuple[int, int]
) -> None:
    assert degrees([beside_edge(SightEnd(0.0, ()), stretch)]) == [beside]


def test_an_arc_close_to_a_slot_that_is_narrower_than_an_edge_is_left_out() -> None:
    near = NearArc(arc(0, 4), 1), *(NearArc(arc(0, 40), hand) for hand in (1, -1)), NearArc(arc(0, 360), 1)
    assert degrees(certain_arcs(near)) == [(5, 40), (0, 35), (0, 0)]


def test_what_is_past_the_end_of_a_wall_close_to_a_slot_closes_no_edge() -> None:
    arcs = NearArc(arc(-5, 40), 1), NearArc(arc(40, 50), 1, is_past_end=True)
    assert degrees(certain_arcs(arcs)) == [(0, 40)]
    assert open_at_0(BEYOND, near=(NearArc(arc(145, 245), 1), NearArc(arc(245, 250), 1, is_past_end=True))) == [
        (330, 145),
        (245, 250),
    ]


def test_an_island_touches_no_open_arc() -> None:
    closed = [arc(0, 90), arc(100, 180), arc(190, 300)]
    assert degrees(with_islands([arc(185, 190)], closed)) == [(185, 190), (90, 100), (300, 0)]


def test_arcs_that_meet_at_zero_are_one() -> None:
    parts = [arc(-30, 0), arc(-5, 20), arc(90, 100)]
    assert sorted(degrees(united_round(parts))) == [(90, 100), (330, 20)]
    assert degrees(united_round([arc(0, 350), arc(340, 370)]))[0] in {(340, 340), (0, 0)}, "a full turn"
