"""Landmark bearings: which are seen, where, and with what noise."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, MultiLineString, Point

from zwerm.world.arena.arena import Arena

coordinate = st.floats(0.05, 2.95)
pose = st.tuples(coordinate, coordinate, st.floats(-7.0, 7.0))
point = st.tuples(coordinate, coordinate)


@given(
    poses=st.lists(pose, min_size=1, max_size=5),
    landmarks=st.lists(point, min_size=1, max_size=6),
    range_m=st.sampled_from([None, 1.0]),
    through_walls=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_landmarks_in_sight_have_their_true_bearings(
    make_scene, sensor_for, arena, poses, landmarks, range_m, through_walls
):
    scene = make_scene(poses, arena)
    walls = MultiLineString([segment.reshape(2, 2) for segment in arena.segments])
    ends = [Point(end) for segment in arena.segments for end in segment.reshape(2, 2)]
    parameters = {"through_walls": through_walls} | ({} if range_m is None else {"range_m": range_m})
    sensor = sensor_for(scene, "landmarks", {"landmarks": np.array(landmarks)}, **parameters)
    for (x, y, heading), reading in zip(poses, sensor.read(scene, scene.present_ids()), strict=True):
        expected = {}
        for landmark, (lx, ly) in enumerate(landmarks):
            line = LineString([(x, y), (lx, ly)])
            assume(all(line.distance(end) > 1e-6 for end in ends))
            assume(walls.distance(Point(x, y)) > 1e-6 and walls.distance(Point(lx, ly)) > 1e-6)
            assume(line.length > 1e-3 and (range_m is None or abs(line.length - range_m) > 1e-6))
            if (range_m is None or line.length < range_m) and (through_walls or not line.intersects(walls)):
                expected[landmark] = math.atan2(ly - y, lx - x) - heading
        assert [each.landmark for each in reading] == list(expected)
        for each in reading:
            assert -math.pi < each.bearing_rad <= math.pi
            error = each.bearing_rad - expected[each.landmark]
            assert math.remainder(error, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_landmark_that_hangs_on_a_wall_is_seen_from_the_side_it_faces(make_scene, sensor_for, walled):
    """On each wall, at a place that floating point cannot put exactly on it."""
    for x0, y0, x1, y1 in walled.segments:
        along, across = np.array([x1 - x0, y1 - y0]), np.array([y0 - y1, x1 - x0])
        place = np.array([x0, y0]) + 0.3 * along
        sides = [place + step * across / np.hypot(*across) for step in (0.05, -0.05)]
        scene = make_scene([(*side, 0.0) for side in sides], walled)
        behind = place - 0.01 * across / np.hypot(*across)
        sensor = sensor_for(scene, "landmarks", {"landmarks": np.array([place, behind])})
        one, other = sensor.read(scene, scene.present_ids())
        assert [each.landmark for each in one] == [0]
        assert [each.landmark for each in other] == [0, 1]


def test_kept_results_equal_new_results(make_scene, sensor_for, walled):
    random = np.random.default_rng(4)
    scene = make_scene(random.uniform(0.1, 2.9, (12, 3)), walled)
    landmarks = {"landmarks": random.uniform(0.1, 2.9, (15, 2))}
    remembering = sensor_for(scene, "landmarks", landmarks, range_m=1.5)
    for _ in range(30):
        for robot in random.integers(0, 12, 3):
            scene.position[robot] = random.uniform(0.1, 2.9, 2)
        robots = np.flatnonzero(random.uniform(size=12) < 0.7)
        fresh = sensor_for(scene, "landmarks", landmarks, range_m=1.5)
        assert remembering.read(scene, robots) == fresh.read(scene, robots)


def test_no_line_of_sight_is_tested_for_a_swarm_that_stands_still(make_scene, sensor_for, walled):
    class Counting(Arena):
        lines = 0

        def blocked(self, start, end):
            self.lines += len(start)
            return super().blocked(start, end)

    scene = make_scene(np.random.default_rng(6).uniform(0.1, 2.9, (8, 3)), Counting(walled.free, walled.walls))
    sensor = sensor_for(scene, "landmarks", {"landmarks": np.array([[1.0, 1.0], [2.0, 0.5]])})
    first = sensor.read(scene, scene.present_ids())
    assert scene.arena.lines == 16
    assert sensor.read(scene, scene.present_ids()) == first
    assert scene.arena.lines == 16


def test_the_noise_is_gaussian_with_the_given_spread_and_is_keyed(make_scene, sensor_for):
    random = np.random.default_rng(7)
    poses, landmarks = random.uniform(0.5, 2.5, (10, 3)), random.uniform(0.5, 2.5, (20, 2))
    errors = []
    for tick in range(20):
        scene, more = make_scene(poses, tick=tick), make_scene([*poses, (1.0, 1.0, 0.0)], tick=tick)
        exact = sensor_for(scene, "landmarks", {"landmarks": landmarks}).read(scene, scene.present_ids())
        noisy = sensor_for(scene, "landmarks", {"landmarks": landmarks}, sd_rad=0.05).read(scene, scene.present_ids())
        others = sensor_for(more, "landmarks", {"landmarks": landmarks}, sd_rad=0.05).read(more, more.present_ids())
        assert others[:10] == noisy
        errors += [
            math.remainder(b.bearing_rad - a.bearing_rad, 2.0 * math.pi)
            for one, other in zip(exact, noisy, strict=True)
            for a, b in zip(one, other, strict=True)
        ]
    assert np.mean(errors) == pytest.approx(0.0, abs=4 * 0.05 / math.sqrt(len(errors)))
    assert np.std(errors) == pytest.approx(0.05, rel=0.04)
