"""The answers of an arena equal those of shapely, which computes them by another method."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, MultiPoint, Point, Polygon, box

from zwerm.errors import ScenarioError
from zwerm.scenario.tables import ArenaTable
from zwerm.world.arena import arena as module
from zwerm.world.arena.arena import Arena

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]

lattice_point = st.tuples(st.integers(0, 6), st.integers(0, 6))
lattice_line = st.tuples(lattice_point, lattice_point).filter(lambda ends: ends[0] != ends[1])


def lengths(low_m: float, high_m: float) -> st.SearchStrategy[float]:
    return st.integers(round(low_m * 1e6), round(high_m * 1e6)).map(lambda micrometres: micrometres * 1e-6)


place = st.tuples(lengths(0, 3), lengths(0, 3))
obstacle = st.tuples(lengths(0.2, 2.5), lengths(0.2, 2.5), lengths(0.05, 0.6), lengths(0.05, 0.6)).map(
    lambda at: box(at[0], at[1], at[0] + at[2], at[1] + at[3])
)
thin_wall = st.lists(place, min_size=2, max_size=4, unique=True).map(LineString).filter(lambda wall: wall.length > 0.01)


@st.composite
def arenas(draw: Any) -> Arena:
    obstacles = draw(st.lists(obstacle, max_size=4))
    return Arena(
        box(0, 0, 3, 3).difference(shapely.union_all(obstacles)), draw(st.lists(thin_wall, min_size=1, max_size=3))
    )


def walls_of(arena: Arena) -> shapely.Geometry:
    return shapely.union_all([shapely.boundary(arena.free), *arena.walls])


@contextmanager
def answered(by: str) -> Iterator[None]:
    settings: Any = {
        "comparing all with all": {"_DENSE_LINES": 10**9, "_DENSE_POINTS": 10**9},
        "blocks": {"_DENSE_LINES": 64, "_DENSE_POINTS": -1},
        "the index": {"_DENSE_LINES": -1, "_DENSE_POINTS": -1, "_FEW_SEGMENTS": -1},
    }[by]
    with mock.patch.multiple(module, **settings):
        yield


WAYS = ("comparing all with all", "blocks", "the index")


@pytest.mark.parametrize("way", WAYS)
@settings(deadline=None, max_examples=50)
@given(walls=st.lists(lattice_line, min_size=1, max_size=6), lines=st.lists(lattice_line, min_size=1, max_size=6))
@example(walls=[((0, 0), (0, 1)), ((0, 0), (0, 1)), ((0, 0), (0, 1)), ((0, 0), (4, 4))], lines=[((5, 5), (3, 3))])
@example(walls=[((2, 1), (1, 2))] * 4, lines=[((4, 4), (0, 0)), ((0, 0), (4, 4))])
def test_a_line_is_blocked_if_its_inside_meets_a_wall_in_a_point_or_along_it(way: str, walls: Any, lines: Any) -> None:
    # On a lattice every touch, corner and overlap is exact, and comes up often.
    arena = Arena(box(-1, -1, 7, 7), [LineString(wall) for wall in walls])
    start, end = np.array(lines, dtype=float).transpose(1, 0, 2)
    expected = [
        any(
            shapely.relate_pattern(LineString(line), LineString(wall), pattern)
            for wall in walls
            for pattern in ("T********", "*T*******")
        )
        for line in lines
    ]
    with answered(way):
        assert arena.blocked(start, end).tolist() == expected


@pytest.mark.parametrize("way", WAYS)
@settings(deadline=None, max_examples=50)
@given(arena=arenas(), ends=st.lists(st.tuples(place, place), min_size=1, max_size=8))
def test_sight_is_blocked_where_shapely_finds_a_crossing(way: str, arena: Arena, ends: Any) -> None:
    start, end = np.array(ends).transpose(1, 0, 2)
    lines = shapely.linestrings(np.array(ends))
    corners = MultiPoint(arena.segments.reshape(-1, 2))
    assume((shapely.distance(lines, corners) > 1e-9).all())
    assume((shapely.distance(MultiPoint(np.concatenate([start, end])), walls_of(arena)) > 1e-9).all())
    with answered(way):
        assert arena.blocked(start, end).tolist() == shapely.intersects(lines, walls_of(arena)).tolist()


@pytest.mark.parametrize("way", WAYS)
@settings(deadline=None, max_examples=50)
@given(arena=arenas(), points=st.lists(place, min_size=1, max_size=8), margin_m=st.sampled_from([0.0, 0.1, 0.4]))
def test_nearest_wall_and_margin_are_shapelys(way: str, arena: Arena, points: Any, margin_m: float) -> None:
    at, dots = np.array(points), shapely.points(np.array(points))
    expected = shapely.distance(dots, walls_of(arena))
    with answered(way):
        nearest = arena.nearest_wall_points(at)
        assert np.hypot(*(nearest - at).T) == pytest.approx(expected, abs=1e-12)
        assert shapely.distance(shapely.points(nearest), walls_of(arena)).max() < 1e-12
        assume((np.abs(expected - margin_m) > 1e-9).all())
        inside = shapely.contains_properly(arena.free, dots) & (expected > margin_m)
        assert arena.contains(at, margin_m).tolist() == inside.tolist()


@settings(deadline=None, max_examples=50)
@given(arena=arenas(), points=st.lists(place, min_size=1, max_size=8), reach_m=st.sampled_from([0.05, 0.5]))
def test_the_walls_within_reach_are_those_that_shapely_finds(arena: Arena, points: Any, reach_m: float) -> None:
    distance = shapely.distance(shapely.points(points)[:, None], shapely.linestrings(arena.segments.reshape(-1, 2, 2)))
    assume((np.abs(distance - reach_m) > 1e-9).all())
    found = arena.walls_within(np.array(points), reach_m)
    point, segment = np.nonzero(distance < reach_m)
    assert (found.point.tolist(), found.segment.tolist()) == (point.tolist(), segment.tolist())
    assert found.distance_m == pytest.approx(distance[point, segment], abs=1e-12)
    to_nearest = shapely.distance(shapely.points(np.array(points)[point]), shapely.points(found.nearest))
    assert to_nearest == pytest.approx(found.distance_m, abs=1e-12)


def test_no_sight_slips_through_the_corner_at_which_two_walls_meet() -> None:
    random = np.random.default_rng(1)
    corner = random.uniform(-1, 1, 2)
    arena = Arena(box(-9, -9, 9, 9), [LineString([(-8.1, 0.3), corner]), LineString([corner, (8.7, -0.2)])])
    start = random.uniform([-1, 3], [1, 8], (20_000, 2))
    end = corner + (corner - start) * random.uniform(0.1, 0.9, (20_000, 1))
    assert arena.blocked(start, end).all()
    with answered("the index"):
        assert arena.blocked(start, end).all()


def test_in_a_large_arena_the_index_answers_bit_for_bit_as_comparing_all_with_all() -> None:
    random = np.random.default_rng(2)
    low = random.uniform(0, 40, (600, 2))
    obstacles = shapely.union_all(shapely.box(*low.T, *(low + random.uniform(0.02, 0.5, (600, 2))).T))
    arena = Arena(box(-1, -1, 41, 41).difference(obstacles), [LineString([(0, 0), (40, 39)])])
    assert len(arena.segments) > 2000
    start, end = random.uniform(0, 40, (2, 300, 2))
    answers = []
    for way in WAYS:
        with answered(way):
            answers.append((arena.blocked(start, end), arena.nearest_wall_points(start)))
    for all_with_all, *others in zip(*answers, strict=True):
        assert all(other.tolist() == all_with_all.tolist() for other in others)
    assert 0 < answers[0][0].sum() < 300


def test_a_query_without_points_has_no_result() -> None:
    arena = Arena(box(0, 0, 2, 2), [LineString([(1, 0), (1, 1)])])
    none = np.empty((0, 2))
    for way in WAYS:
        with answered(way):
            for answer in (
                arena.blocked(none, none),
                arena.nearest_wall_points(none)[:, 0],
                arena.contains(none, 0.1),
                arena.walls_within(none, 1.0).point,
            ):
                assert answer.shape == (0,)


def test_collinear_pieces_of_wall_are_one_segment_and_doubled_points_none() -> None:
    ring = [(0, 0), (1, 0), (2, 0), (2, 0), (3, 0), (3, 3), (1.5, 3), (0, 3), (0, 1)]
    arena = Arena(Polygon(ring), [LineString([(1, 1), (1.5, 1.5), (2, 2), (2, 1)])])
    assert sorted(map(tuple, arena.segments.tolist())) == [
        (0, 0, 3, 0),
        (0, 3, 0, 0),
        (1, 1, 2, 2),
        (2, 2, 2, 1),
        (3, 0, 3, 3),
        (3, 3, 0, 3),
    ]


def test_an_arena_has_an_area_and_bounds_and_cannot_be_written_to() -> None:
    arena = Arena(box(-1, 0, 3, 2).difference(box(0, 0.5, 1, 1.5)))
    assert arena.area_m2 == pytest.approx(7.0)
    assert arena.bounds == (-1.0, 0.0, 3.0, 2.0)
    with pytest.raises(ValueError, match="read-only"):
        arena.segments[0, 0] = 9.0


@pytest.mark.parametrize(
    ("free", "walls", "convex"),
    [
        (box(0, 0, 1, 1), [], True),
        (Point(0, 0).buffer(1.0), [], True),
        (box(0, 0, 1, 1), [LineString([(0.2, 0.2), (0.4, 0.4)])], False),
        (box(0, 0, 3, 3).difference(box(1, 1, 2, 2)), [], False),
        (Polygon([(0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)]), [], False),
        (shapely.MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)]), [], False),
    ],
    ids=["square", "disc", "thin wall", "hole", "dent", "two parts"],
)
def test_only_a_single_room_without_dents_holes_and_walls_is_convex(free: Any, walls: Any, convex: bool) -> None:
    assert Arena(free, walls).is_convex is convex


def test_nothing_is_hidden_in_a_convex_arena() -> None:
    ends = np.random.default_rng(3).uniform(0, 1, (2, 50, 2))
    assert not Arena(box(0, 0, 1, 1)).blocked(*ends).any()


def read(folder: Path = Path(), /, **table: Any) -> Arena:
    return Arena.from_table(ArenaTable(**table), folder)


GEOJSON = '{"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]]]}'
FEATURES = f"""{{"type": "FeatureCollection", "features": [
    {{"type": "Feature", "properties": {{}}, "geometry": {GEOJSON}}},
    {{"type": "Feature", "properties": {{}}, "geometry": {{"type": "MultiPolygon", "coordinates":
        [[[[2, 0], [3, 0], [3, 1], [2, 1], [2, 0]]], [[[8, 0], [9, 0], [9, 1], [8, 1], [8, 0]]]]}}}}]}}"""


@pytest.mark.parametrize(
    ("table", "area_m2", "bounds"),
    [
        ({"size_m": (2, 1)}, 2.0, (0, 0, 2, 1)),
        ({"polygon": [(-1, 0), (1, 0), (0, 2)]}, 2.0, (-1, 0, 1, 2)),
        ({"wkt": "POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0), (1 1, 1 2, 2 2, 2 1, 1 1))"}, 15.0, (0, 0, 4, 4)),
        ({"wkt": "MULTIPOLYGON Z (((0 0 1, 1 0 1, 1 1 1, 0 0 1)))"}, 0.5, (0, 0, 1, 1)),
        ({"geojson": GEOJSON}, 2.0, (0, 0, 2, 1)),
        ({"geojson": FEATURES}, 4.0, (0, 0, 9, 1)),
        ({"size_m": (2, 1), "obstacles": [[(0.5, -1), (1, -1), (1, 0.5), (0.5, 0.5)]]}, 1.75, (0, 0, 2, 1)),
        ({"size_m": (2, 1), "obstacles": [SQUARE], "walls": [[(1, 0), (2, 1)]], "scale": 3.0}, 9.0, (3, 0, 6, 3)),
    ],
    ids=["size_m", "polygon", "wkt", "wkt with heights", "geojson", "features", "obstacles", "scale"],
)
def test_an_arena_is_read_from_each_kind_of_shape(table: Any, area_m2: float, bounds: Any) -> None:
    arena = read(**table)
    assert arena.area_m2 == pytest.approx(area_m2)
    assert arena.bounds == pytest.approx(bounds)


def test_scale_applies_to_thin_walls_too() -> None:
    arena = read(size_m=(2, 1), walls=[[(0.5, 0.5), (1.0, 0.5)]], scale=2.0)
    assert arena.segments[-1].tolist() == [1.0, 1.0, 2.0, 1.0]


def test_a_passage_that_is_too_narrow_is_closed_and_what_lies_behind_it_is_left_out() -> None:
    """Two rooms of 1 m2 and 2 m2 with a gap of 0.2 m in the wall between them."""
    wall = [[(1.0, 0.0), (1.1, 0.0), (1.1, 0.4), (1.0, 0.4)], [(1.0, 0.6), (1.1, 0.6), (1.1, 1.0), (1.0, 1.0)]]
    rooms = {"size_m": (3.1, 1.0), "obstacles": wall}
    assert read(**rooms, passage_m=0.2).area_m2 == pytest.approx(3.02)
    narrow = read(**rooms, passage_m=0.21)
    assert narrow.area_m2 == pytest.approx(2.0, abs=0.03), "and a mouth of the gap"
    assert 0.9 < narrow.bounds[0] < 1.1, "and nothing of the other room"
    assert narrow.bounds[1:] == pytest.approx((0.0, 3.1, 1.0))
    assert not narrow.blocked(np.array([[1.2, 0.05]]), np.array([[3.0, 0.95]])).any()


def test_a_file_is_sought_beside_the_scenario_and_then_where_the_command_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside, here = tmp_path / "beside", tmp_path / "here"
    beside.mkdir()
    here.mkdir()
    monkeypatch.chdir(here)
    (here / "room.geojson").write_text(GEOJSON)
    assert read(beside, geojson="room.geojson").area_m2 == pytest.approx(2.0)
    (beside / "room.geojson").write_text(GEOJSON.replace("2", "5"))
    assert read(beside, geojson="room.geojson").area_m2 == pytest.approx(5.0)
    assert read(beside, geojson=str(here / "room.geojson")).area_m2 == pytest.approx(2.0)


KINDS = "size_m, polygon, wkt, geojson, map"
BOW = [(0, 0), (1, 1), (1, 0), (0, 1)]


@pytest.mark.parametrize(
    ("table", "lines"),
    [
        ({}, [f"arena: expected exactly one of {KINDS}, got none"]),
        (
            {"size_m": (1, 1), "polygon": SQUARE},
            [f"arena: expected exactly one of {KINDS}, got size_m and polygon"],
        ),
        (
            {"size_m": (1, 1), "polygon": SQUARE, "map": "x.png"},
            [f"arena: expected exactly one of {KINDS}, got size_m and polygon and map"],
        ),
        ({"polygon": BOW}, ["arena.polygon: expected a simple polygon, got self-intersection at (0.5, 0.5)"]),
        ({"wkt": "LINESTRING (0 0, 1 1)"}, ["arena.wkt: expected POLYGON or MULTIPOLYGON, got LINESTRING"]),
        ({"wkt": "POLYGON ((0 0, 1"}, ["arena.wkt: expected well-known text, got 'POLYGON ((0 0, 1'"]),
        ({"wkt": "POLYGON EMPTY"}, ["arena.wkt: expected an area > 0, got 0"]),
        (
            {"geojson": '{"type": "Point", "coordinates": [0, 0]}'},
            ["arena.geojson: expected Polygon, MultiPolygon, Feature or FeatureCollection, got 'Point'"],
        ),
        ({"geojson": '{"type": '}, ["arena.geojson: not JSON: Expecting value: line 1 column 10 (char 9)"]),
        (
            {"geojson": '{"type": "Polygon", "coordinates": [[0, 0]]}'},
            [
                "arena.geojson: expected rings of [x, y], closed, got {'type': 'Polygon', 'coordinates': [[0, 0]]}",
            ],
        ),
        ({"geojson": '{"type": "FeatureCollection", "features": []}'}, ["arena.geojson: expected an area > 0, got 0"]),
        ({"geojson": "nowhere.geojson"}, ["arena.geojson: no such file, got nowhere.geojson"]),
        ({"map": "nowhere.yaml"}, ["arena.map: no such file, got nowhere.yaml"]),
        (
            {"size_m": (1, 1), "obstacles": [[(-1, -1), (2, -1), (2, 2), (-1, 2)]]},
            ["arena.obstacles: expected some free space beside them, got none"],
        ),
        (
            {"size_m": (1, 1), "start": (0, 0), "obstacles": [SQUARE, BOW], "walls": [[(0, 0), (0, 0)]]},
            [
                "arena.start: goes with a map only, got (0.0, 0.0)",
                "arena.obstacles.1: expected a simple polygon, got self-intersection at (0.5, 0.5)",
                "arena.walls.0: expected a length > 0, got [(0.0, 0.0), (0.0, 0.0)]",
            ],
        ),
        ({"size_m": (1, 1), "passage_m": 2.0}, ["arena.passage_m: expected some place that is wider, got 2"]),
    ],
)
def test_every_mistake_in_the_table_is_one_line(table: Any, lines: list[str]) -> None:
    with pytest.raises(ScenarioError) as caught:
        read(**table)
    assert caught.value.mistakes == lines


def test_a_geojson_file_is_named_in_its_mistakes(tmp_path: Path) -> None:
    path = tmp_path / "lines.geojson"
    path.write_text('{"type": "LineString", "coordinates": [[0, 0], [1, 1]]}')
    with pytest.raises(ScenarioError) as caught:
        read(tmp_path, geojson="lines.geojson")
    rule = "expected Polygon, MultiPolygon, Feature or FeatureCollection"
    assert caught.value.mistakes == [f"arena.geojson: {path}: {rule}, got 'LineString'"]
