"""Bearings and neighbours: directions and places in the body frame, and their noise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zwerm.world.geometry.visibility import Visibility

coordinate = st.floats(0.05, 2.95)
pose = st.tuples(coordinate, coordinate, st.floats(-7.0, 7.0))
RANGE_M = 1.2


def turned(x, y, heading):
    """Return the complex number x + iy as seen by someone turned by heading."""
    return complex(x, y) * complex(math.cos(-heading), math.sin(-heading))


@given(poses=st.lists(pose, min_size=1, max_size=8), absent=st.integers(0, 20))
@settings(max_examples=60, deadline=None)
def test_robots_in_sight_have_their_true_bearings_and_positions(make_scene, sensor_for, walled, poses, absent):
    scene = make_scene(poses, walled, [index != absent for index in range(len(poses))])
    robots = scene.present_ids()
    bearings = sensor_for(scene, "bearings", range_m=RANGE_M).read(scene, robots)
    neighbours = sensor_for(scene, "neighbours", range_m=RANGE_M).read(scene, robots)
    pairs = Visibility().pairs(scene, RANGE_M).tolist()
    for robot, seen, near in zip(robots.tolist(), bearings, neighbours, strict=True):
        expected = sorted({i + j - robot for i, j in pairs if robot in (i, j)})
        assert [each.node for each in seen] == [each.node for each in near] == expected
        for other, bearing, neighbour in zip(expected, seen, near, strict=True):
            (x, y, heading), (ox, oy, _) = poses[robot], poses[other]
            place = turned(ox - x, oy - y, heading)
            assert complex(neighbour.x_m, neighbour.y_m) == pytest.approx(place, abs=1e-9)
            assert -math.pi < bearing.bearing_rad <= math.pi
            if abs(place) > 1e-6:
                direction = complex(math.cos(bearing.bearing_rad), math.sin(bearing.bearing_rad))
                assert direction == pytest.approx(place / abs(place), abs=1e-9)


def test_x_is_ahead_and_y_is_to_the_left(make_scene, sensor_for):
    scene = make_scene([(1.5, 1.5, math.pi / 2), (1.5, 2.0, 0.0), (1.0, 1.5, 0.0)])
    (ahead, left), *_ = sensor_for(scene, "bearings").read(scene, scene.present_ids())
    assert (ahead.bearing_rad, left.bearing_rad) == pytest.approx((0.0, math.pi / 2))
    (ahead, left), *_ = sensor_for(scene, "neighbours").read(scene, scene.present_ids())
    assert (ahead.x_m, ahead.y_m, left.x_m, left.y_m) == pytest.approx((0.5, 0.0, 0.0, 0.5))


@pytest.mark.parametrize("angle", [0.4, math.pi, -2.0, 5.0])
def test_turning_a_robot_turns_its_bearings_the_other_way(make_scene, sensor_for, angle):
    poses = np.random.default_rng(3).uniform(0.1, 2.9, (6, 3))
    scene, after = make_scene(poses), make_scene(np.add(poses, (0.0, 0.0, angle)))
    for before_seen, after_seen in zip(
        *(sensor_for(each, "bearings").read(each, each.present_ids()) for each in (scene, after)), strict=True
    ):
        for before_one, after_one in zip(before_seen, after_seen, strict=True):
            turn = after_one.bearing_rad - before_one.bearing_rad + angle
            assert math.remainder(turn, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_walls_hide_and_on_request_robots_do(make_scene, sensor_for, walled):
    behind_the_wall = make_scene([(2.2, 1.0, 0.0), (2.6, 1.0, 0.0)], walled)
    in_a_row = make_scene([(0.5, 0.5, 0.0), (0.7, 0.5, 0.0), (0.9, 0.51, 0.0)])
    for kind in ("bearings", "neighbours"):

        def seen(scene, kind=kind, **parameters):
            readings = sensor_for(scene, kind, **parameters).read(scene, scene.present_ids())
            return [[each.node for each in reading] for reading in readings]

        assert seen(behind_the_wall) == [[], []]
        assert seen(behind_the_wall, through_walls=True) == [[1], [0]]
        assert seen(in_a_row) == [[1, 2], [0, 2], [0, 1]]
        assert seen(in_a_row, robots_occlude=True) == [[1], [0, 2], [1]]


@pytest.fixture(scope="module")
def crowd():
    """Poses of twenty robots, none of which sees another near the cut of the angles."""
    random = np.random.default_rng(8)
    return np.column_stack([random.uniform(0.5, 2.5, (20, 2)), random.uniform(-3.0, 3.0, 20)])


def numbers(sensor, scene):
    """Return the readings as rows: observer, seen, then the numbers."""
    rows = []
    for observer, reading in zip(scene.present_ids().tolist(), sensor.read(scene, scene.present_ids()), strict=True):
        rows += [(observer, *(getattr(each, name) for name in each.__struct_fields__)) for each in reading]
    return np.array(rows)


def test_bearing_noise_is_gaussian_with_the_given_spread_and_bias(make_scene, sensor_for, crowd):
    found = []
    for tick in range(40):
        scene = make_scene(crowd, tick=tick)
        exact = numbers(sensor_for(scene, "bearings"), scene)
        noisy = numbers(sensor_for(scene, "bearings", sd_rad=0.1, bias_rad=0.05), scene)
        found.append(np.remainder(noisy[:, 2] - exact[:, 2] + np.pi, 2.0 * np.pi) - np.pi)
    errors = np.array(found)
    assert errors.mean() == pytest.approx(0.05, abs=4 * 0.1 / math.sqrt(errors.size))
    assert errors.std() == pytest.approx(0.1, rel=0.03)
    assert (np.abs(errors - 0.05) < 0.1).mean() == pytest.approx(0.6827, abs=0.02)
    # Independent from tick to tick, and what i sees of j from what j sees of i.
    assert abs(np.corrcoef(errors[1:].ravel(), errors[:-1].ravel())[0, 1]) < 0.03
    ids = exact[:, :2].astype(int).tolist()
    back = [ids.index([j, i]) for i, j in ids]
    assert abs(np.corrcoef(errors.ravel(), errors[:, back].ravel())[0, 1]) < 0.03


def test_neighbour_noise_is_gaussian_and_independent_in_both_axes(make_scene, sensor_for, crowd):
    found = []
    for tick in range(40):
        scene = make_scene(crowd, tick=tick)
        exact, noisy = (numbers(sensor_for(scene, "neighbours", sd_m=sd), scene) for sd in (0.0, 0.02))
        found.append(noisy[:, 2:] - exact[:, 2:])
    errors = np.concatenate(found)
    assert errors.mean(axis=0) == pytest.approx([0.0, 0.0], abs=4 * 0.02 / math.sqrt(len(errors)))
    assert errors.std(axis=0) == pytest.approx([0.02, 0.02], rel=0.03)
    assert abs(np.corrcoef(errors.T)[0, 1]) < 0.03


@pytest.mark.parametrize(("kind", "noise"), [("bearings", "sd_rad"), ("neighbours", "sd_m")])
def test_another_robot_does_not_change_the_noise_of_others(make_scene, sensor_for, crowd, kind, noise):
    few = make_scene(crowd, tick=3)
    more = make_scene([*crowd.tolist(), (0.2, 0.2, 0.0)], tick=3)
    before, after = (numbers(sensor_for(each, kind, **{noise: 0.1}), each) for each in (few, more))
    assert np.array_equal(before, after[(after[:, :2] < 20).all(axis=1)])


@pytest.mark.parametrize(("kind", "noise"), [("bearings", "sd_rad"), ("neighbours", "sd_m")])
def test_the_readings_of_a_robot_do_not_depend_on_the_other_robots_read(make_scene, sensor_for, crowd, kind, noise):
    scene = make_scene(crowd, tick=3)
    sensor = sensor_for(scene, kind, range_m=1.0, **{noise: 0.1})
    everyone = sensor.read(scene, scene.present_ids())
    assert sensor.read(scene, np.array([2, 5, 11])) == [everyone[index] for index in (2, 5, 11)]
