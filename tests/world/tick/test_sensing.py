"""Sensing: which robots are read again, and that readings are those of a sensor that is read at every tick."""

import dataclasses

import numpy as np
import pytest

from zwerm.world.sensors import Sensor
from zwerm.world.tick.sensing import Sensing

POSES = [(1.0, 1.0, 0.0), (1.06, 1.0, 0.5), (2.0, 2.0, 1.0)]
SETTINGS = {"bearings": {"range_m": 2.0}, "touch": {"reach_m": 0.02}}


class Counted(Sensor):
    """A sensor that counts the robots that are read."""

    def __init__(self, sensor):
        vars(self)["field"] = sensor.field
        self.steady, self.read_count = sensor.steady, 0
        self._sensor = sensor

    def read(self, scene, robots):
        """Read the sensor."""
        self.read_count += len(robots)
        return self._sensor.read(scene, robots)


def later(scene, **changes):
    """Return the scene one tick later, with the marks of robots that moved, as the world makes it."""
    arrays = {"position": scene.position.copy(), "heading": scene.heading.copy(), "present": scene.present} | changes
    moved = (arrays["position"] != scene.position).any(axis=1) | (arrays["heading"] != scene.heading)
    return dataclasses.replace(scene, tick=scene.tick + 1, moved=moved | (arrays["present"] != scene.present), **arrays)


@pytest.mark.parametrize("kind", SETTINGS)
def test_a_robot_is_read_once_while_no_body_moves_and_again_after_any_change(make_scene, sensor_for, kind):
    scene = make_scene(POSES)
    counted = Counted(sensor_for(scene, kind, **SETTINGS[kind]))
    sensing = Sensing([counted])

    def reads(scene, robots):
        before = counted.read_count
        readings = sensing.readings(scene, robots)[kind]
        assert readings == sensor_for(scene, kind, **SETTINGS[kind]).read(scene, robots)
        return counted.read_count - before

    changes = (
        {"heading": scene.heading + 0.1},
        {"present": np.array([True, False, True])},
        {"position": scene.position + np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.3]])},
    )
    for change in ({}, *changes):
        scene = later(scene, **change)
        robots = scene.present_ids()
        if change:
            assert reads(scene, robots) == len(robots)
            scene = later(scene)
        assert reads(scene, robots[:1]) == 1
        scene = later(scene)
        assert reads(scene, robots) == len(robots) - 1
        scene = later(scene)
        assert reads(scene, robots) == 0
    scene = later(later(scene))  # a tick without a reading
    assert reads(scene, robots) == len(robots)


def test_a_sensor_with_noise_is_read_at_every_tick(make_scene, sensor_for):
    scene = make_scene(POSES)
    for sensor in (sensor_for(scene, "bearings", sd_rad=0.1), sensor_for(scene, "touch", false_positive=0.1)):
        counted = Counted(sensor)
        sensing = Sensing([counted])
        for _ in range(3):
            scene = later(scene)
            sensing.readings(scene, np.arange(3))
        assert counted.read_count == 9
