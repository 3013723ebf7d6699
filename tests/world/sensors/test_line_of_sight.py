"""The one-bit sensor: its geometry against shapely, its noise against its probabilities."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, MultiLineString, Point

RADIUS_M = 0.15
coordinate = st.floats(RADIUS_M, 3.0 - RADIUS_M)
heading = st.floats(-7.0, 7.0)


def judged(scene, robot, range_m):
    """Return the reading by shapely: the first object on the ray; cases within rounding are left out."""
    origin = Point(scene.position[robot])
    along = 10.0 * np.array([math.cos(scene.heading[robot]), math.sin(scene.heading[robot])])
    ray = LineString([origin, scene.position[robot] + along])
    walls = MultiLineString([segment.reshape(2, 2) for segment in scene.arena.segments])
    wall_m = origin.distance(ray.intersection(walls))
    nearest_m = math.inf
    for other in scene.present_ids().tolist():
        centre = Point(scene.position[other])
        gap = ray.distance(centre)
        if other == robot:
            continue
        assume(abs(gap - scene.radius_m) > 1e-6)
        if gap < scene.radius_m:
            nearest_m = min(nearest_m, origin.distance(ray.intersection(centre.buffer(scene.radius_m, quad_segs=500))))
    # The polygon that stands for the disc is off by 1e-6 m where the ray is not nearly tangent.
    assume(abs(nearest_m - wall_m) > 1e-2 and (range_m is None or abs(nearest_m - range_m) > 1e-2))
    return nearest_m < wall_m and (range_m is None or nearest_m < range_m)


@given(
    poses=st.lists(st.tuples(coordinate, coordinate, heading), min_size=1, max_size=8),
    absent=st.integers(0, 20),
    range_m=st.sampled_from([None, 0.8]),
)
@settings(max_examples=60, deadline=None)
def test_a_robot_sees_the_first_object_on_its_ray(make_scene, sensor_for, arena, poses, absent, range_m):
    scene = make_scene(poses, arena, [index != absent for index in range(len(poses))], radius_m=RADIUS_M)
    assume(arena.contains(scene.position, 1e-3).all())
    robots = scene.present_ids()
    parameters = {} if range_m is None else {"range_m": range_m}
    expected = [judged(scene, robot, range_m) for robot in robots.tolist()]
    sensor = sensor_for(scene, "line_of_sight", **parameters)
    assert sensor.read(scene, robots) == expected
    assert sensor.read(scene, robots[1::2]) == expected[1::2]


def test_a_robot_behind_a_wall_is_not_seen_and_one_before_it_is(make_scene, sensor_for, walled):
    poses = [(2.2, 1.0, 0.0), (2.6, 1.0, math.pi), (1.9, 1.0, 0.0)]
    scene = make_scene(poses, walled)
    assert sensor_for(scene, "line_of_sight").read(scene, scene.present_ids()) == [False, False, True]


def test_the_line_of_sight_sensor_sees_across_the_whole_arena_and_only_ahead(make_scene, sensor_for):
    scene = make_scene([(0.1, 1.5, 0.0), (2.9, 1.5, 0.0), (1.5, 0.2, math.pi / 2)])
    assert sensor_for(scene, "line_of_sight").read(scene, scene.present_ids()) == [True, False, False]


@pytest.mark.parametrize("count", [180, 300])
def test_a_large_swarm_has_the_readings_of_its_robots_one_by_one(make_scene, sensor_for, arena, count):
    """More pairs than are worked on at a time, and a number of rows that does not divide the robots."""
    random = np.random.default_rng(count)
    poses = np.column_stack([random.uniform(0.05, 2.95, (count, 2)), random.uniform(-4.0, 4.0, count)])
    scene = make_scene(poses, arena)
    sensor, robots = sensor_for(scene, "line_of_sight"), scene.present_ids()
    together = sensor.read(scene, robots)
    assert 0.1 < np.mean(together) < 0.9
    assert sensor.read(scene, robots[::2]) == together[::2]
    assert together == [sensor.read(scene, robots[index : index + 1])[0] for index in range(count)]


@pytest.fixture(scope="module")
def facing(make_scene):
    """Forty robots of which the even see the odd, and the odd see nothing."""
    return [
        make_scene(
            [(0.5 + 2.0 * (index % 2), 0.1 + 0.14 * (index // 2), 0.0) for index in range(40)], tick=tick, radius_m=0.05
        )
        for tick in range(200)
    ]


@pytest.mark.parametrize(
    ("parameters", "missed", "imagined"),
    [
        ({}, 0.0, 0.0),
        ({"false_negative": 0.6}, 0.3, 0.0),
        ({"false_positive": 0.6}, 0.0, 0.3),
        ({"false_negative": 0.2, "false_positive": 0.8}, 0.1, 0.4),
        ({"combined": 0.6}, 0.3, 0.3),
        ({"combined": 1}, 0.5, 0.5),
    ],
)
def test_a_reading_becomes_a_random_bit_with_the_given_probability(facing, sensor_for, parameters, missed, imagined):
    sensor = sensor_for(facing[0], "line_of_sight", **parameters)
    readings = np.array([sensor.read(scene, scene.present_ids()) for scene in facing])
    for column, expected in ((~readings[:, 0::2], missed), (readings[:, 1::2], imagined)):
        assert column.mean() == pytest.approx(expected, abs=4.0 * math.sqrt(expected * (1.0 - expected) / column.size))
        # Drawn anew for each tick and robot: neighbours in time and in number agree no more than by chance.
        for one, other in ((column[1:], column[:-1]), (column[:, 1:], column[:, :-1])):
            agree = expected**2 + (1.0 - expected) ** 2
            assert (one == other).mean() == pytest.approx(agree, abs=4.0 * math.sqrt(agree * (1.0 - agree) / one.size))


def test_another_robot_does_not_change_the_noise_of_others(make_scene, sensor_for):
    poses = [(0.5, 0.1 + 0.1 * index, 0.0) for index in range(20)]
    few, more = make_scene(poses), make_scene([*poses, (2.9, 2.9, 0.0)])
    readings = [sensor_for(each, "line_of_sight", combined=1.0).read(each, each.present_ids()) for each in (few, more)]
    assert readings[0] == readings[1][:20]
    assert 0 < sum(readings[0]) < 20
