"""Sensors of the robot's own motion: pose, compass, odometry; and the outline of the arena as the robot sees it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LinearRing, MultiPolygon, box

from zwerm.world.arena.arena import Arena

coordinate = st.floats(0.05, 2.95)
pose = st.tuples(coordinate, coordinate, st.floats(-20.0, 20.0))


def read(sensor, scene):
    """Return the readings of all present robots, as rows of numbers."""
    return np.array(
        [[getattr(each, name) for name in each.__struct_fields__] for each in sensor.read(scene, scene.present_ids())]
    )


@given(poses=st.lists(pose, min_size=1, max_size=6))
@settings(max_examples=40, deadline=None)
def test_pose_and_compass_read_the_true_values_within_one_turn(make_scene, sensor_for, poses):
    scene = make_scene(poses)
    told = sensor_for(scene, "pose").read(scene, scene.present_ids())
    compass = sensor_for(scene, "compass").read(scene, scene.present_ids())
    for (x, y, heading), each, angle in zip(poses, told, compass, strict=True):
        assert (each.x_m, each.y_m, each.heading_rad) == (x, y, angle)
        assert -math.pi < angle <= math.pi
        assert math.remainder(angle - heading, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_the_noise_of_pose_and_compass_has_the_given_spread_and_is_keyed(make_scene, sensor_for):
    poses = np.random.default_rng(1).uniform(0.1, 2.9, (400, 3))
    scene, more = make_scene(poses, tick=9), make_scene([*poses, (1.0, 1.0, 0.0)], tick=9)
    told, other = (read(sensor_for(each, "pose", sd_m=0.1, sd_rad=0.02), each) for each in (scene, more))
    assert np.array_equal(told, other[:400])
    error = told - poses
    assert error.std(axis=0) == pytest.approx([0.1, 0.1, 0.02], rel=0.15)
    assert np.abs(np.corrcoef(error.T) - np.eye(3)).max() < 4 / math.sqrt(400)
    told, other = (
        np.array(sensor_for(each, "compass", sd_rad=0.02, bias_rad=0.1).read(each, each.present_ids()))
        for each in (scene, more)
    )
    assert np.array_equal(told, other[:400])
    error = told - poses[:, 2]
    assert error.mean() == pytest.approx(0.1, abs=4 * 0.02 / math.sqrt(400))
    assert error.std() == pytest.approx(0.02, rel=0.15)


@given(poses=st.lists(pose, min_size=1, max_size=4))
@settings(max_examples=40, deadline=None)
def test_the_boundary_is_the_arenas_outline_in_the_body_frame(make_scene, sensor_for, walled, poses):
    scene = make_scene(poses, walled)
    for (x, y, heading), corners in zip(
        poses, sensor_for(scene, "boundary").read(scene, scene.present_ids()), strict=True
    ):
        assert all(type(corner) is tuple for corner in corners)
        assert LinearRing(corners).is_ccw
        turn = complex(math.cos(heading), math.sin(heading))
        back = [complex(x, y) + complex(*corner) * turn for corner in corners]
        outline = [complex(*corner) for corner in walled.free.exterior.coords[:-1]]
        assert len(back) == len(outline)
        assert all(min(abs(one - other) for other in outline) < 1e-9 for one in back)


def test_the_boundarys_noise_has_the_given_spread_in_every_corner_and_is_keyed(make_scene, sensor_for):
    poses = np.random.default_rng(1).uniform(0.1, 2.9, (100, 3))
    scene, more = make_scene(poses), make_scene([*poses, (1.0, 1.0, 0.0)])
    exact = np.array(sensor_for(scene, "boundary").read(scene, scene.present_ids()))
    told, other = (
        np.array(sensor_for(each, "boundary", sd_m=0.05).read(each, each.present_ids())) for each in (scene, more)
    )
    assert np.array_equal(told, other[:100])
    error = (told - exact).reshape(100, 8)
    assert error.std(axis=0) == pytest.approx(0.05, rel=0.35)
    assert np.abs(np.corrcoef(error.T) - np.eye(8)).max() < 0.4


def test_an_arena_in_two_pieces_has_no_one_boundary(make_scene, sensor_for):
    scene = make_scene([(0.5, 0.5, 0.0)], Arena(MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])))
    with pytest.raises(
        Exception, match=r"^here: robots.sensors.0.kind: the boundary sensor needs an arena of one piece$"
    ):
        sensor_for(scene, "boundary")


@given(walk=st.lists(pose, min_size=2, max_size=6))
@settings(max_examples=40, deadline=None)
def test_the_sum_of_displacements_is_the_position_of_the_robot(make_scene, sensor_for, walk):
    sensor = sensor_for(make_scene([walk[0]]), "odometry")
    place, facing = complex(*walk[0][:2]), complex(math.cos(walk[0][2]), math.sin(walk[0][2]))
    for step, at in enumerate(walk):
        scene = make_scene([at], tick=step)
        (moved,) = sensor.read(scene, scene.present_ids())
        assert -math.pi < moved.turn_rad <= math.pi
        place += complex(moved.forward_m, moved.left_m) * facing
        facing *= complex(math.cos(moved.turn_rad), math.sin(moved.turn_rad))
        assert place == pytest.approx(complex(*at[:2]), abs=1e-9)
        assert facing == pytest.approx(complex(math.cos(at[2]), math.sin(at[2])), abs=1e-9)


def test_odometry_is_relative_to_the_robots_own_previous_observation(make_scene, sensor_for):
    scenes = [
        make_scene([(0.5 + 0.1 * tick, 1.0, 0.0), (0.5, 0.5 + 0.1 * tick, math.pi / 2)], tick=tick) for tick in range(4)
    ]
    sensor = sensor_for(scenes[0], "odometry")
    assert read(sensor, scenes[0]) == pytest.approx(np.zeros((2, 3)))
    (only,) = sensor.read(scenes[2], np.array([1]))
    assert (only.forward_m, only.left_m, only.turn_rad) == pytest.approx((0.2, 0.0, 0.0))
    for _ in "asked", "and asked again":
        assert read(sensor, scenes[3]) == pytest.approx(np.array([[0.3, 0.0, 0.0], [0.1, 0.0, 0.0]]))


def test_a_robot_that_comes_back_into_the_arena_has_not_moved(make_scene, sensor_for):
    before = make_scene([(0.5, 0.5, 0.0), (1.0, 1.0, 0.0)])
    gone = make_scene([(0.5, 0.5, 0.0), (0.0, 0.0, 0.0)], present=[True, False], tick=1)
    back = make_scene([(0.5, 0.5, 0.0), (2.5, 2.5, 1.0)], tick=2)
    sensor = sensor_for(before, "odometry")
    for scene in (before, gone, back):
        assert not read(sensor, scene).any()


@pytest.mark.parametrize(
    ("parameters", "sd_m", "sd_rad"),
    [
        ({"distance_sd_fraction": 0.1}, 0.1 * 0.25, 0.0),
        ({"distance_sd_per_root_m": 0.1}, 0.1 * 0.5, 0.0),
        ({"turn_sd_fraction": 0.1}, 0.0, 0.1 * 0.16),
        ({"turn_sd_per_root_rad": 0.1}, 0.0, 0.1 * 0.4),
        ({"turn_sd_fraction": 0.3, "turn_sd_per_root_rad": 0.1}, 0.0, math.hypot(0.3 * 0.16, 0.1 * 0.4)),
    ],
)
def test_odometry_errs_in_distance_and_turn_by_the_set_noise(make_scene, sensor_for, parameters, sd_m, sd_rad):
    """A robot that moves 0.25 m and turns 0.16 rad; and one that stands still, without error."""
    count = 400
    start = np.column_stack([np.full(count, 1.0), np.full(count, 1.0), np.full(count, 0.5)])
    step = np.array([0.15, 0.2, -0.16])
    scene, after = make_scene(start), make_scene(start + step, tick=1)
    sensor, exact = sensor_for(scene, "odometry", **parameters), sensor_for(scene, "odometry")
    assert not read(sensor, scene).any()
    read(exact, scene)
    told, truth = read(sensor, after), read(exact, after)
    along = truth[0, :2] / 0.25
    error = told - truth
    assert (error[:, :2] @ along).std() == pytest.approx(sd_m, rel=0.12)
    assert (error[:, :2] @ [-along[1], along[0]]).std() == pytest.approx(0.0, abs=1e-12)
    assert error[:, 2].std() == pytest.approx(sd_rad, rel=0.12)
    assert not read(sensor, make_scene(start + step, tick=2)).any()


def test_another_robot_does_not_change_the_odometry_of_others(make_scene, sensor_for):
    start = np.random.default_rng(1).uniform(0.1, 2.9, (20, 3))
    told = []
    for poses in (start, np.vstack([start, [1.0, 1.0, 0.0]])):
        sensor = sensor_for(make_scene(poses), "odometry", distance_sd_fraction=0.2, turn_sd_per_root_rad=0.1)
        read(sensor, make_scene(poses))
        told.append(read(sensor, make_scene(poses + 0.1, tick=1))[:20])
    assert np.array_equal(*told)
