"""Triangles of the points of walks: a search through all points finds the same, and they are kept while nothing changes."""

import math
import random
from itertools import pairwise

import pytest

from zwerm.agents.sensor_coverage.frontier.fans import Pair, fan_of
from zwerm.agents.sensor_coverage.frontier.proofs.point_triangles import HIDDEN_MIN_RAD, PointTriangles
from zwerm.agents.sensor_coverage.frontier.wall_proof import WalkPoint, arc_between

POINTS = 40
Views = dict[int, dict[int, float]]


def drawn(seed: int) -> tuple[list[WalkPoint], Views, dict[int, set[int]]]:
    """Draw slots that see each other, and a walk around them of which each slot sees a part."""
    draw = random.Random(seed)
    at = {slot: (draw.uniform(-1.0, 1.0), draw.uniform(-1.0, 1.0)) for slot in range(5)}
    way = [(1.3 * math.cos(each), 1.3 * math.sin(each)) for each in (0.15 * number for number in range(POINTS))]

    def direction(a: tuple[float, float], b: tuple[float, float]) -> float:
        return math.atan2(b[1] - a[1], b[0] - a[0])

    views = {a: {b: direction(at[a], at[b]) for b in at if b != a} for a in at}
    points = [
        WalkPoint({slot: direction(here, each) for slot, here in at.items() if draw.random() < 0.35}, (0.0,), ())
        for each in way
    ]
    return points, views, {slot: set(seen) for slot, seen in views.items()}


def is_beyond(there: float, third: float, slot: float) -> bool:
    """Return whether a direction is on the side of a third slot, and farther from the slot than that, or nearly so."""
    return off(there, slot, third) >= off(third, slot, third) - HIDDEN_MIN_RAD


def off(there: float, slot: float, side: float) -> float:
    """Return the angle between a direction and that of a slot, positive on the side of a third one."""
    return math.copysign(1.0, math.remainder(side - slot, math.tau)) * math.remainder(there - slot, math.tau)


def searched(point: WalkPoint, points: list[WalkPoint], views: Views, neighbours: dict[int, set[int]]) -> set[Pair]:
    """Return (slot, other slot) of the triangles with a point by a search through all points."""
    at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
    hidden: set[Pair] = set()
    while True:
        pairs = fan_of(point, views, neighbours, at_walls, hidden)
        more = set()
        for slot, other in pairs:
            start, width = arc_between(views[slot][other], point.seen[slot])
            angles = [
                (each.seen[slot] - start) % math.tau
                for each in points
                if slot in each.seen
                and other not in each.seen
                and not any(one in neighbours for one in each.seen if one != slot)
            ]
            if any(HIDDEN_MIN_RAD < each < width - HIDDEN_MIN_RAD for each in angles) or any(
                off(views[slot][third], views[slot][other], point.seen[slot]) > -HIDDEN_MIN_RAD
                and not is_beyond(views[slot][third], point.seen[slot], views[slot][other])
                and not is_beyond(point.seen[other], views[other][third], views[other][slot])
                for third in neighbours[slot] & neighbours[other]
            ):
                more.add((slot, other))
        if not more:
            return set(pairs)
        hidden |= more


def added(points: list[WalkPoint]) -> PointTriangles:
    """Return the triangles of the points of one stretch. The space around each slot is proved without any other one."""
    found = PointTriangles(lambda *asked: True, lambda *asked: True)
    for number, point in enumerate(points):
        for slot in point.seen:
            found.add(slot, number, 0, 0, point)
    return found


def test_the_pairs_are_those_of_a_search_through_all_points() -> None:
    counts = []
    for seed in range(8):
        points, views, neighbours = drawn(seed)
        triangles = added(points)
        for number, point in enumerate(points):
            at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
            found = triangles.find(number, point, views, neighbours, dict.fromkeys(views, 1), at_walls)
            assert set(found) == searched(point, points, views, neighbours)
            counts.append(len(found))
    assert any(a != b for a, b in pairwise(counts))  # some triangles are hidden, and some are not


def test_a_point_keeps_its_pairs_until_a_view_or_a_wall_changes() -> None:
    points, views, neighbours = drawn(1)
    number, point = next((n, each) for n, each in enumerate(points) if searched(each, points, views, neighbours))
    triangles, versions = added(points), dict.fromkeys(views, 1)
    at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
    before = triangles.find(number, point, views, neighbours, versions, at_walls)
    alone: dict[int, set[int]] = {slot: set() for slot in neighbours}
    assert (
        triangles.find(number, point, views, alone, versions, at_walls) == before
    )  # the same versions: nothing changed
    assert triangles.find(number, point, views, alone, dict.fromkeys(views, 2), at_walls) == ()
    no_walls = dict.fromkeys(at_walls, False)
    again = triangles.find(number, point, views, neighbours, dict.fromkeys(views, 3), no_walls)
    assert again == triangles.pairs(number) != before
    triangles.drop(number)
    assert triangles.pairs(number) == ()


def test_points_that_are_added_again_have_the_pairs_of_a_search() -> None:
    """A slot is displaced: it has seen no point of the second half. The other points keep their pairs."""
    points, views, neighbours = drawn(1)
    versions, half = dict.fromkeys(views, 1), POINTS // 2
    triangles = added(points)

    def find(number: int, point: WalkPoint) -> tuple[Pair, ...]:
        at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
        return triangles.find(number, point, views, neighbours, versions, at_walls)

    before = [find(*each) for each in enumerate(points)]
    others = [*points[:half], *(each.unseen_by((0,)) for each in points[half:])]
    same = [number for number, (a, b) in enumerate(zip(points, others, strict=True)) if a is b]
    assert half < len(same) < POINTS
    triangles.begin_again(same)
    assert [triangles.pairs(number) for number in same] == [before[number] for number in same]
    assert not any(triangles.pairs(number) for number in range(POINTS) if number not in same)
    for number, point in enumerate(others):
        for slot in point.seen:
            triangles.add(slot, number, 0, 0, point)
    after = [find(*each) for each in enumerate(others)]
    assert [set(each) for each in after] == [searched(each, others, views, neighbours) for each in others]
    assert after != before


def test_a_later_point_of_the_same_stretch_counts() -> None:
    points, views, neighbours = drawn(2)
    versions, half = dict.fromkeys(views, 1), POINTS // 2
    triangles = added(points[:half])
    changed = 0
    for known in (half, POINTS):
        for number, point in enumerate(points[half:known], half):
            for slot in point.seen:
                triangles.add(slot, number, 0, 0, point)
        for number, point in enumerate(points[:half]):
            before = triangles.pairs(number)
            at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
            found = triangles.find(number, point, views, neighbours, versions, at_walls)
            assert set(found) == searched(point, points[:known], views, neighbours)
            changed += known == POINTS and found != before
    assert changed > 0


@pytest.mark.parametrize(
    ("walk", "seen_by_third", "third_knows", "counts"),
    [
        pytest.param(1, False, True, False, id="the other slot lost sight of the walk"),
        pytest.param(2, False, True, False, id="the other slot saw an earlier walk"),
        pytest.param(0, False, True, True, id="the other slot may have been empty during the walk"),
        pytest.param(1, True, True, True, id="a third slot is responsible"),
        pytest.param(1, True, False, False, id="the third slot is gone, or relies on the other one"),
    ],
)
def test_a_point_behind_a_triangle(walk: int, seen_by_third: bool, third_knows: bool, counts: bool) -> None:
    """Slot 0 saw a point of this walk within the angle of its triangle. Slot 1 saw walk 1."""
    views: Views = {0: {1: 0.0}, 1: {0: math.pi}}
    point = WalkPoint({0: math.radians(60.0), 1: math.radians(120.0)}, (math.pi / 2.0,), ())
    behind = WalkPoint({0: math.radians(40.0)} | ({2: 0.5} if seen_by_third else {}), (math.pi / 2.0,), ())
    triangles = PointTriangles(lambda *asked: third_knows and asked == (2, 0.5, 1), lambda *asked: False)
    triangles.add(0, 0, 0, 1, point)
    triangles.add(1, 0, 0, 1, point)
    at_walls = {(slot, side): True for slot in views for side in (1, -1)}
    neighbours: dict[int, set[int]] = {0: {1}, 1: {0}}
    assert triangles.find(0, point, views, neighbours, dict.fromkeys(views, 1), at_walls) == ((0, 1), (1, 0))
    triangles.add(0, 1, 1, walk, behind)
    found = triangles.find(0, point, views, neighbours, dict.fromkeys(views, 1), at_walls)
    assert found == (((0, 1), (1, 0)) if counts else ((1, 0),)), "the other slot may rely on the first one"


def test_a_third_slot_is_asked_again_once_its_proof_has_changed() -> None:
    views: Views = {0: {1: 0.0}, 1: {0: math.pi}}
    point = WalkPoint({0: math.radians(60.0), 1: math.radians(120.0)}, (math.pi / 2.0,), ())
    behind = WalkPoint({0: math.radians(40.0), 2: 0.5}, (math.pi / 2.0,), ())
    proved: set[int] = set()
    triangles = PointTriangles(lambda slot, *_: slot in proved, lambda *asked: False)
    for number, each in enumerate((point, behind)):
        for slot in each.seen:
            triangles.add(slot, number, 0, 0, each)
    at_walls = {(slot, side): True for slot in views for side in (1, -1)}
    neighbours: dict[int, set[int]] = {0: {1}, 1: {0}}
    found = []
    for version in range(3):
        found.append(triangles.find(0, point, views, neighbours, dict.fromkeys(views, version), at_walls))
        if version == 1:
            triangles.forget_proved()
        proved.add(2)
    assert found == [((1, 0),), ((1, 0),), ((0, 1), (1, 0))]


@pytest.mark.parametrize(("angle_rad", "counting"), [(0.2, {(0, 1), (1, 0)}), (0.01, {(1, 0)}), (-0.02, {(1, 0)})])
def test_a_flat_triangle_does_not_count_at_its_middle(angle_rad: float, counting: set[Pair]) -> None:
    """Slot 0 stands between slot 1 and the point, a little to the left of their line as seen from slot 1."""
    point = WalkPoint({0: math.pi + angle_rad, 1: math.pi + 0.0056}, (0.0,), ())
    views = {0: {1: 0.0}, 1: {0: math.pi}}
    at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
    assert set(fan_of(point, views, {0: {1}, 1: {0}}, at_walls)) == counting


@pytest.mark.parametrize(("closed", "counts"), [((1,), False), ((-1,), False), ((1, -1), True)])
def test_a_triangle_that_noise_turns_over_counts_if_the_space_is_proved_on_both_sides(
    closed: tuple[int, ...], counts: bool
) -> None:
    """The point is close to slot 0. Slot 1 sees both in nearly the same direction, and by noise in the wrong order."""
    point = WalkPoint({0: math.pi / 2.0, 1: math.pi + 0.01}, (0.0,), ())
    views = {0: {1: 0.0}, 1: {0: math.pi}}
    at_walls = {(0, 1): True, (0, -1): True} | {(1, side): True for side in closed}
    exact = point._replace(seen={0: math.pi / 2.0, 1: math.pi - 0.01})
    assert bool(fan_of(exact, views, {0: {1}, 1: {0}}, at_walls)) is (-1 in closed), "the side beyond the point"
    assert bool(fan_of(point, views, {0: {1}, 1: {0}}, at_walls)) is counts


@pytest.mark.parametrize(("inside_rad", "counts"), [(0.02, False), (0.2, True)])
def test_a_point_on_a_side_of_a_triangle_of_robots_is_not_inside_it(inside_rad: float, counts: bool) -> None:
    """Slots 0, 1 and 2 see each other, slots 0 and 1 see the point. Beyond it nothing is proved."""
    point = WalkPoint({0: inside_rad, 1: math.pi - inside_rad}, (), ())
    views = {0: {1: 0.0, 2: 1.0}, 1: {0: math.pi, 2: 2.1}, 2: {0: -2.1, 1: -1.0}}
    neighbours = {a: set(seen) for a, seen in views.items()}
    assert bool(fan_of(point, views, neighbours, {})) is counts


@pytest.mark.parametrize("with_third", [False, True])
def test_a_triangle_across_a_side_of_one_of_robots_does_not_count_where_that_side_begins(with_third: bool) -> None:
    """From slot 1 the point is behind the side between slots 0 and 2. There slot 1 relies on slot 0, which so must not on 1."""
    at = {0: (1.52, 1.14), 1: (0.96, 0.81)} | ({2: (1.67, 0.2)} if with_third else {})
    place = 1.75, 1.17
    views = {a: {b: math.atan2(y - at[a][1], x - at[a][0]) for b, (x, y) in at.items() if b != a} for a in at}
    point = WalkPoint({each: math.atan2(place[1] - at[each][1], place[0] - at[each][0]) for each in (0, 1)}, (0.0,), ())
    triangles = added([point])
    at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
    neighbours = {slot: set(seen) for slot, seen in views.items()}
    found = triangles.find(0, point, views, neighbours, dict.fromkeys(views, 1), at_walls)
    assert set(found) == {(1, 0)} | (set() if with_third else {(0, 1)})


@pytest.mark.parametrize("there_deg", [28.3, 33.0])
@pytest.mark.parametrize(("third", "counts"), [((), True), ((2,), False)])
def test_a_triangle_over_a_triangle_of_robots_does_not_count_at_its_middle(
    third: tuple[int, ...], counts: bool, there_deg: float
) -> None:
    """The line from slot 1 to the point passes slot 0 at 1.8 degrees, on the side of slot 2, or by noise on the other side."""
    directions = {0: {1: -149.8, 2: -82.2}, 1: {0: 30.1, 2: -40.5}, 2: {0: 97.7, 1: 139.4}}
    point = WalkPoint({0: math.radians(20.7), 1: math.radians(there_deg)}, (0.0,), ())
    standing = {0, 1, *third}
    views = {
        slot: {other: math.radians(each) for other, each in seen.items() if other in standing}
        for slot, seen in directions.items()
        if slot in standing
    }
    assert ((0, 1) in pairs_of(point, views)) is counts


@pytest.mark.parametrize(("third_deg", "counts"), [(-71.7, False), (-80.0, True)])
def test_a_slot_does_not_rely_on_another_one_in_front_of_a_third(third_deg: float, counts: bool) -> None:
    """Slot 2 is straight behind slot 4 from slot 1, as drawn building 776 showed: slot 4 relies on the side from 1 to 2."""
    degrees = {1: {4: -73.0, 2: third_deg}, 4: {1: 107.0, 2: -71.1}, 2: {1: 108.3, 4: 109.0}}
    views = {slot: {other: math.radians(each) for other, each in seen.items()} for slot, seen in degrees.items()}
    point = WalkPoint({1: math.radians(92.7), 4: math.radians(98.6)}, (0.0,), ())
    assert ((1, 4) in pairs_of(point, views)) is counts


@pytest.mark.parametrize(
    ("ties", "end_deg", "counts"),
    [
        pytest.param((2,), -8.0, False, id="slot 4 relies on slot 2 past the end"),
        pytest.param((2, 0), -8.0, True, id="another slot ties the end, too"),
        pytest.param((2, 9), -8.0, False, id="the other slot is gone"),
        pytest.param((2,), -28.0, True, id="the end is on this side of the line"),
        pytest.param((), -8.0, True, id="no slot ties the end"),
    ],
)
def test_a_slot_that_ties_an_end_does_not_rely_on_a_slot_that_looks_past_it(
    ties: tuple[int, ...], end_deg: float, counts: bool
) -> None:
    """A walk ends at the robot of slot 2, beyond the line from slot 4 to the point, as drawn building 734 showed."""
    degrees = {0: {2: 25.0, 4: 37.0}, 2: {0: -155.0, 4: 146.0}, 4: {0: -143.0, 2: -34.0}}
    views = {slot: {other: math.radians(each) for other, each in seen.items()} for slot, seen in degrees.items()}
    point = WalkPoint({2: math.radians(12.0), 4: math.radians(-20.0)}, (0.0,), ())
    end = WalkPoint({2: math.radians(91.0), 4: math.radians(end_deg)}, (0.0,), (2,))
    assert ((2, 4) in pairs_of(point, views, end, ties)) is counts


@pytest.mark.parametrize(("wall_deg", "counts"), [(-2.0, False), (178.0, True)])
def test_a_slot_that_looks_along_a_wall_looks_past_its_end_as_far_as_the_touched_point(
    wall_deg: float, counts: bool
) -> None:
    """Slot 3 stands in a mouth, at which the wall ends along which slot 2 looks, as drawn building 769 showed."""
    degrees = {2: {3: 94.2}, 3: {2: -85.6}}
    views = {slot: {other: math.radians(each) for other, each in seen.items()} for slot, seen in degrees.items()}
    point = WalkPoint({2: math.radians(88.1), 3: math.radians(82.1)}, (0.0,), ())
    end = WalkPoint({2: math.radians(90.0), 3: math.radians(-69.5)}, (math.radians(wall_deg),), (3,))
    assert ((3, 2) in pairs_of(point, views, end, (3,))) is counts


def pairs_of(
    point: WalkPoint, views: Views, end: WalkPoint | None = None, ties: tuple[int, ...] = ()
) -> tuple[Pair, ...]:
    """Return the triangles with a point beyond which all is proved. The slots `ties` tie an end of a stretch."""
    triangles = PointTriangles(lambda *asked: False, lambda *asked: False)
    for slot in point.seen:
        triangles.add(slot, 0, 0, 0, point)
    for slot in () if end is None else end.seen:
        triangles.add_tied(slot, end or point, ties)
    at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
    neighbours = {slot: set(seen) for slot, seen in views.items()}
    return triangles.find(0, point, views, neighbours, dict.fromkeys(views, 1), at_walls)
