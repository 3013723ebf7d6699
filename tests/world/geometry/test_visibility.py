"""Visibility between robots, against shapely; a cache changes the cost and not the result."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, MultiLineString, Point

from zwerm.world.arena.arena import Arena
from zwerm.world.geometry.visibility import Visibility
from zwerm.world.scene import Bools, Floats

coordinate = st.floats(0.05, 2.95)
poses = st.lists(st.tuples(coordinate, coordinate, st.just(0.0)), min_size=2, max_size=9)
sight = st.tuples(st.sampled_from([None, 0.4, 1.0, 2.0]), st.booleans(), st.booleans())

MARGIN_M = 1e-6


def judged(scene, range_m, through_walls, robots_occlude):
    """Return the visible pairs, by shapely; cases within rounding are left out."""
    walls = MultiLineString([segment.reshape(2, 2) for segment in scene.arena.segments])
    centre = {i: Point(scene.position[i]) for i in scene.present_ids().tolist()}
    visible = []
    for i, j in itertools.combinations(centre, 2):
        line = LineString([centre[i], centre[j]])
        gaps = [centre[k].distance(line) - scene.radius_m for k in centre if k not in (i, j)]
        if range_m is not None:
            assume(abs(line.length - range_m) > MARGIN_M)
        assume(all(abs(gap) > MARGIN_M for gap in gaps))
        # Neither a wall's end that only just reaches the line, nor a line whose end only just reaches a wall.
        ends = [Point(end) for segment in scene.arena.segments for end in segment.reshape(2, 2)]
        assume(all(line.distance(end) > MARGIN_M for end in ends))
        assume(all(walls.distance(centre[each]) > MARGIN_M for each in (i, j)))
        if (
            (range_m is None or line.length <= range_m)
            and (through_walls or not line.intersects(walls))
            and not (robots_occlude and any(gap <= 0.0 for gap in gaps))
        ):
            visible.append((i, j))
    return visible


@given(poses=poses, sight=sight, absent=st.integers(0, 20))
@settings(max_examples=60, deadline=None)
def test_the_visible_pairs_are_those_that_shapely_finds(make_scene, arena, poses, sight, absent):
    present = [index != absent for index in range(len(poses))]
    scene = make_scene(poses, arena, present, radius_m=0.1)
    expected = judged(scene, *sight)
    assert list(map(tuple, Visibility().pairs(scene, *sight).tolist())) == expected


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_kept_results_equal_new_results(make_scene, walled, data):
    start = data.draw(st.lists(st.tuples(coordinate, coordinate, st.just(0.0)), min_size=6, max_size=6))
    scene = make_scene(start, walled, radius_m=0.1)
    remembering = Visibility()
    for _ in range(6):
        for index in data.draw(st.lists(st.integers(0, 5), max_size=3)):
            scene.position[index] = data.draw(coordinate), data.draw(coordinate)
        for index in data.draw(st.lists(st.integers(0, 5), max_size=1)):
            scene.present[index] ^= True
        scene.tick += 1
        for each in data.draw(st.lists(sight, max_size=3)):
            robots = scene.present_ids()[:: data.draw(st.integers(1, 2))]
            assert np.array_equal(remembering.pairs(scene, *each), Visibility().pairs(scene, *each))
            for found, fresh in zip(
                remembering.sightings(scene, robots, *each), Visibility().sightings(scene, robots, *each), strict=True
            ):
                assert np.array_equal(found, fresh)


class Counting(Arena):
    """An arena that counts the lines that were tested."""

    lines = 0

    def blocked(self, start: Floats, end: Floats) -> Bools:
        self.lines += len(start)
        return super().blocked(start, end)


@pytest.fixture
def counted(walled, make_scene):
    """A scene of 12 robots in an arena that counts."""
    places = np.random.default_rng(5).uniform(0.1, 2.9, (12, 2))
    return make_scene(np.column_stack([places, np.zeros(12)]), Counting(walled.free, walled.walls))


def test_no_line_of_sight_is_tested_for_a_swarm_that_stands_still(counted):
    visibility = Visibility()
    visibility.pairs(counted, 1.5)
    assert counted.arena.lines > 0
    counted.arena.lines = 0
    for tick in range(1, 4):
        counted.tick, counted.heading = tick, counted.heading + 0.3
        visibility.pairs(counted, 1.5)
        visibility.pairs(counted, 1.0, robots_occlude=True)
        visibility.sightings(counted, counted.present_ids(), 0.5)
    assert counted.arena.lines == 0


def test_only_the_lines_of_a_robot_that_moved_are_tested_again(counted):
    visibility = Visibility()
    visibility.pairs(counted)
    counted.arena.lines = 0
    counted.position[4] += 0.01
    visibility.pairs(counted)
    assert counted.arena.lines == 11


def test_two_sensors_with_different_ranges_share_wall_tests(counted):
    visibility = Visibility()
    visibility.pairs(counted, 2.0)
    counted.arena.lines = 0
    visibility.pairs(counted, 1.0)
    assert counted.arena.lines == 0


def test_the_range_includes_its_edge(make_scene):
    scene = make_scene([(0.5, 1.0, 0.0), (1.5, 1.0, 0.0), (2.75, 1.0, 0.0)])
    assert Visibility().pairs(scene, 1.0).tolist() == [[0, 1]]
    assert Visibility().pairs(scene, 1.25).tolist() == [[0, 1], [1, 2]]


def test_many_robots_occlude_each_other_as_few_do(make_scene):
    """More robots than are tried at once: against every third robot of every pair, one by one."""
    places = np.random.default_rng(2).uniform(0.1, 2.9, (48, 2))
    scene = make_scene(np.column_stack([places, np.zeros(48)]))
    points = [Point(place) for place in places]
    for range_m in (None, 0.9):
        seen = set(map(tuple, Visibility().pairs(scene, range_m, robots_occlude=True).tolist()))
        for i, j in itertools.combinations(range(48), 2):
            line = LineString([points[i], points[j]])
            hidden = any(points[k].distance(line) <= scene.radius_m for k in range(48) if k not in (i, j))
            assert ((i, j) in seen) == (not hidden and (range_m is None or line.length <= range_m))


def test_sightings_are_both_directions_of_the_pairs_by_observer_and_seen(make_scene, walled):
    places = np.random.default_rng(3).uniform(0.1, 2.9, (30, 2))
    scene = make_scene(np.column_stack([places, np.zeros(30)]), walled)
    visibility = Visibility()
    pairs = visibility.pairs(scene, 1.0).tolist()
    robots = np.array([3, 7, 8, 29])
    observer, seen, ends = visibility.sightings(scene, robots, 1.0)
    expected = sorted([(i, j) for i, j in pairs if i in robots] + [(j, i) for i, j in pairs if j in robots])
    assert list(zip(observer.tolist(), seen.tolist(), strict=True)) == expected
    assert np.diff(ends, prepend=0).tolist() == [sum(i == robot for i, _ in expected) for robot in robots]


@given(seed=st.integers(0, 2**32), sight=sight, few=st.integers(1, 10))
@settings(max_examples=60, deadline=None)
def test_few_observers_see_what_they_see_among_all_pairs(make_scene, walled, seed, sight, few):
    random = np.random.Generator(np.random.Philox(seed))
    remembering = Visibility()
    poses = [(x, y, 0.0) for x, y in random.uniform(0.05, 2.95, (40, 2)).tolist()]
    for _ in range(3):
        scene = make_scene(poses, walled, (random.random(40) < 0.9).tolist(), radius_m=0.1)
        robots = np.sort(random.permutation(scene.present_ids())[:few])
        found = remembering.sightings(scene, robots, *sight)
        pairs = Visibility().pairs(scene, *sight).tolist()
        both = sorted([*map(tuple, pairs), *((j, i) for i, j in pairs)])
        expected = [each for each in both if each[0] in robots]
        assert list(zip(found.observer.tolist(), found.seen.tolist(), strict=True)) == expected
        assert found.ends.tolist() == [sum(1 for i, _ in expected if i <= robot) for robot in robots.tolist()]
        moved = int(random.integers(40))
        poses[moved] = (*random.uniform(0.05, 2.95, 2).tolist(), 0.0)


def test_few_observers_keep_candidates_and_see_what_new_ones_see(make_scene, walled):
    random = np.random.Generator(np.random.Philox(5))
    remembering = Visibility()
    places = random.uniform(0.1, 2.9, (40, 2))
    ways = random.uniform(-0.03, 0.03, (40, 2))
    present = make_scene(np.zeros((40, 3))).present
    changes = set()
    for tick in range(60):
        places = np.clip(places + ways * (random.random((40, 1)) < 0.3), 0.05, 2.95)
        scene = make_scene(np.column_stack([places, np.zeros(40)]), walled, tick=tick)
        scene.present = present
        for robots in (np.array([2, 5, 9]), np.array([1, 30])):
            for range_m in (0.2, 0.7):
                kept, new = (each.sightings(scene, robots, range_m) for each in (remembering, Visibility()))
                assert [each.tolist() for each in kept] == [each.tolist() for each in new]
                changes.add(tuple(kept.seen.tolist()))
    assert len(changes) > 20  # robots come into sight, and leave it
