"""Touch switches: the closed switches, and the rate of errors."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point
from shapely.ops import nearest_points

coordinate = st.floats(0.01, 2.99)
pose = st.tuples(coordinate, coordinate, st.floats(-7.0, 7.0))
RADIUS_M, REACH_M = 0.3, 0.05


def judged(scene, robot, switches):
    """Return the numbers of the closed switches, by shapely; cases within rounding are left out."""
    here = Point(scene.position[robot])
    pieces = [LineString(segment.reshape(2, 2)) for segment in scene.arena.segments]
    others = [Point(scene.position[other]) for other in scene.present_ids().tolist() if other != robot]
    closed = set()
    for thing, reach_m in [(piece, RADIUS_M + REACH_M) for piece in pieces] + [
        (other, 2.0 * RADIUS_M + REACH_M) for other in others
    ]:
        distance = here.distance(thing)
        assume(abs(distance - reach_m) > 1e-9 and distance > 1e-6)
        if distance < reach_m:
            place = nearest_points(here, thing)[1]
            turns = (math.atan2(place.y - here.y, place.x - here.x) - scene.heading[robot]) / (2.0 * math.pi)
            assume(abs(turns * switches % 1.0 - 0.5) > 1e-6)
            closed.add(int((turns * switches + 0.5) // 1) % switches)
    return sorted(closed)


@given(poses=st.lists(pose, min_size=1, max_size=6), absent=st.integers(0, 12), switches=st.sampled_from([1, 4, 7, 16]))
@settings(max_examples=60, deadline=None)
def test_the_switch_that_faces_the_contact_is_closed(make_scene, sensor_for, arena, poses, absent, switches):
    scene = make_scene(poses, arena, [index != absent for index in range(len(poses))], radius_m=RADIUS_M)
    robots = scene.present_ids()
    expected = [judged(scene, robot, switches) for robot in robots.tolist()]
    sensor = sensor_for(scene, "touch", switches=switches, reach_m=REACH_M)
    sector = 2.0 * math.pi / switches
    for reading, closed in zip(sensor.read(scene, robots), expected, strict=True):
        assert all(-math.pi < contact.bearing_rad <= math.pi for contact in reading)
        assert [contact.half_width_rad for contact in reading] == [sector / 2.0] * len(closed)
        assert [round(contact.bearing_rad / sector) % switches for contact in reading] == closed


@pytest.mark.parametrize(("gap_m", "touches"), [(0.0, True), (0.0019, True), (0.0021, False)])
def test_a_switch_closes_up_to_its_reach_from_the_bodys_surface_and_no_farther(make_scene, sensor_for, gap_m, touches):
    at_the_wall = make_scene([(0.037 + gap_m, 1.0, 0.0)])
    at_a_robot = make_scene([(1.0, 1.0, 0.0), (1.074 + gap_m, 1.0, math.pi)])
    for scene, bearing in ((at_the_wall, math.pi), (at_a_robot, 0.0)):
        for reading in sensor_for(scene, "touch", reach_m=0.002).read(scene, scene.present_ids()):
            assert [contact.bearing_rad for contact in reading] == ([pytest.approx(bearing)] if touches else [])


def test_a_sensor_that_was_read_before_feels_the_walls_that_a_new_one_feels(make_scene, sensor_for, arena):
    random = np.random.Generator(np.random.Philox(7))
    places, ways = random.uniform(0.1, 2.9, (12, 2)), random.uniform(-0.06, 0.06, (12, 2))
    settings = {"reach_m": 0.01, "switches": 12}
    used, touched = None, 0
    for tick in range(120):
        ahead = places + ways
        out = (ahead < 0.05) | (ahead > 2.95)
        ways[out] *= -1.0
        places = np.where(out, places, ahead)
        scene = make_scene(np.column_stack([places, np.zeros(12)]), arena, tick=tick, radius_m=0.05)
        used = used or sensor_for(scene, "touch", **settings)
        robots = np.arange(tick % 3, 12)
        found = used.read(scene, robots)
        assert found == sensor_for(scene, "touch", **settings).read(scene, robots)
        touched += sum(map(bool, found))
    assert touched > 20


def test_turning_a_robot_moves_the_contact_the_other_way(make_scene, sensor_for):
    for quarter in range(-3, 5):
        scene = make_scene([(1.0, 0.037, quarter * math.pi / 2)])
        ((contact,),) = sensor_for(scene, "touch", switches=4).read(scene, scene.present_ids())
        error = contact.bearing_rad - (-math.pi / 2 - quarter * math.pi / 2)
        assert math.remainder(error, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


def test_switches_err_with_the_given_probabilities_each_by_itself(make_scene, sensor_for):
    poses = [(0.1 + 0.2 * index, 0.037, 0.0) for index in range(12)]
    closed = []
    for tick in range(100):
        scene = make_scene(poses, tick=tick)
        sensor = sensor_for(scene, "touch", switches=8, false_negative=0.2, false_positive=0.1)
        for reading in sensor.read(scene, scene.present_ids()):
            numbers = [round(contact.bearing_rad / (math.pi / 4)) % 8 for contact in reading]
            closed.append([number in numbers for number in range(8)])
    rates = np.mean(closed, axis=0)
    assert rates[6] == pytest.approx(0.8, abs=4 * math.sqrt(0.16 / len(closed)))
    assert np.delete(rates, 6) == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / len(closed)))
    both = np.array(closed)
    assert (both[:, 0] & both[:, 1]).mean() == pytest.approx(0.01, abs=4 * math.sqrt(0.01 / len(closed)))


def test_another_robot_does_not_change_the_noise_of_others(make_scene, sensor_for):
    poses = [(0.1 + 0.2 * index, 0.037, 0.0) for index in range(12)]
    few, more = make_scene(poses), make_scene([*poses, (2.0, 2.0, 0.0)])
    one, other = (
        sensor_for(each, "touch", false_negative=0.5, false_positive=0.5).read(each, each.present_ids())
        for each in (few, more)
    )
    assert one == other[:12]
    assert len(set(one)) > 6
