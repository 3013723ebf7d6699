"""Triangles of the points of walks: a search through all points finds the same, and they are kept while nothing changes."""

import math
import random
from itertools import pairwise

from zwerm.agents.sensor_coverage.frontier.proofs.point_triangles import HIDDEN_MIN_RAD, PointTriangles
from zwerm.agents.sensor_coverage.frontier.wall_proof import Pair, WalkPoint, arc_between, fan_of

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
        WalkPoint({slot: direction(here, each) for slot, here in at.items() if draw.random() < 0.8}, (0.0,), ())
        for each in way
    ]
    return points, views, {slot: set(seen) for slot, seen in views.items()}


def searched(point: WalkPoint, points: list[WalkPoint], views: Views, neighbours: dict[int, set[int]]) -> set[Pair]:
    """Return the pairs of a point by a search through all points of its stretch."""
    at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
    hidden: set[Pair] = set()
    while True:
        pairs = fan_of(point, views, neighbours, at_walls, hidden)
        more = set()
        for pair in pairs:
            for slot, other in (pair, pair[::-1]):
                start, width = arc_between(views[slot][other], point.seen[slot])
                offs = [
                    (each.seen[slot] - start) % math.tau
                    for each in points
                    if slot in each.seen and other not in each.seen
                ]
                if any(HIDDEN_MIN_RAD < off < width - HIDDEN_MIN_RAD for off in offs):
                    more.add(pair)
        if not more:
            return set(pairs)
        hidden |= more


def added(points: list[WalkPoint]) -> PointTriangles:
    """Return the triangles of the points of one stretch."""
    found = PointTriangles()
    for number, point in enumerate(points):
        for slot in point.seen:
            found.add(slot, number, 0, point)
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


def test_a_later_point_of_the_same_stretch_counts() -> None:
    points, views, neighbours = drawn(2)
    versions, half = dict.fromkeys(views, 1), POINTS // 2
    triangles = added(points[:half])
    changed = 0
    for known in (half, POINTS):
        for number, point in enumerate(points[half:known], half):
            for slot in point.seen:
                triangles.add(slot, number, 0, point)
        for number, point in enumerate(points[:half]):
            before = triangles.pairs(number)
            at_walls = {(slot, side): True for slot in point.seen for side in (1, -1)}
            found = triangles.find(number, point, views, neighbours, versions, at_walls)
            assert set(found) == searched(point, points[:known], views, neighbours)
            changed += known == POINTS and found != before
    assert changed > 0
