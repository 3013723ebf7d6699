"""Sensors from a scenario's tables: built-in ones, those of users, and one line for each mistake."""

import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest
from support import scenario

from zwerm import Command, Controller, Observation, check_controller
from zwerm.catalogue import SENSORS
from zwerm.errors import ScenarioError
from zwerm.run.assembly import check_controllers
from zwerm.scenario.types import OpenTable
from zwerm.wire.messages import SENSOR_FIELDS, Wake, decode_observation, encode
from zwerm.world.fields.linear import Linear
from zwerm.world.sensors import Surroundings
from zwerm.world.sensors.registry import find, make_sensors


@pytest.fixture(autouse=True)
def _other_peoples_module(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    yield
    sys.modules.pop("other_peoples", None)


@pytest.fixture
def scene(make_scene):
    return make_scene([(0.5, 0.5, 0.0), (1.0, 0.5, 1.0), (2.0, 2.0, 2.0)], present=[True, False, True])


@pytest.fixture
def make(scene):
    def make_all(*tables, **surroundings):
        around = Surroundings(scene.arena, 3, **surroundings)
        return make_sensors([OpenTable.model_validate(each) for each in tables], around, "robots.sensors", "x.toml")

    return make_all


def mistakes(make, *tables, **surroundings):
    with pytest.raises(ScenarioError) as caught:
        make(*tables, **surroundings)
    return caught.value.mistakes


def test_the_sensors_of_the_catalogue_fill_every_field_of_an_observation():
    assert {find(kind).field for kind in SENSORS} >= set(SENSOR_FIELDS) - {"extra"}


@pytest.mark.parametrize("kind", sorted(SENSORS))
def test_a_built_in_sensor_fills_its_field_with_values_that_cross_the_wire_unchanged(kind, make, scene):
    landmarks, field = np.array([[1.0, 1.0]]), Linear(0.0, (1.0, 0.0))
    [sensor] = make({"kind": kind, **find(kind).example}, landmarks=landmarks, field=field)
    assert sensor.field in SENSOR_FIELDS
    readings = sensor.read(scene, scene.present_ids())
    assert len(readings) == 2
    for reading in readings:
        observation = Observation(tick=0, time_s=0.0, **{sensor.field: reading})
        decoded = decode_observation(encode(observation))
        assert decoded == observation
        # Equal, and of the same types: no numpy numbers, no lists.
        assert repr(getattr(decoded, sensor.field)) == repr(getattr(observation, sensor.field))


@pytest.mark.parametrize("kind", sorted(SENSORS))
def test_a_built_in_sensor_reads_no_robot_if_none_is_requested(kind, make, scene):
    nobody = np.empty(0, dtype=np.int64)
    landmarks, field = np.array([[1.0, 1.0]]), Linear(0.0, (0.0, 0.0))
    [sensor] = make({"kind": kind, **find(kind).example}, landmarks=landmarks, field=field)
    assert list(sensor.read(scene, nobody)) == []
    scene.present[:] = False
    assert list(sensor.read(scene, nobody)) == []


@pytest.mark.parametrize(
    ("table", "lines"),
    [
        ({"kind": "bearings", "range_m": -1}, ["robots.sensors.0.range_m: expected > 0, got -1"]),
        ({"kind": "bearings", "range_m": "2"}, ['robots.sensors.0.range_m: expected a number, got "2"']),
        (
            {"kind": "touch", "switches": 0, "reach": 0.1, "false_negative": 1.5},
            [
                "robots.sensors.0.switches: expected >= 1, got 0",
                "robots.sensors.0.false_negative: expected <= 1, got 1.5",
                "robots.sensors.0.reach: unknown key; did you mean reach_m?",
            ],
        ),
        (
            {"kind": "line_of_sight", "false_negative": 0.1, "combined": 0.2},
            ["robots.sensors.0.combined: expected it alone, or false_negative and false_positive without it, got 0.2"],
        ),
        ({"kind": "compass", "sd_rad": float("nan")}, ["robots.sensors.0.sd_rad: expected a finite number, got NaN"]),
        (
            {"kind": "landmarks"},
            ["robots.sensors.0.kind: the landmark sensor needs landmarks, and the scenario has none"],
        ),
        ({"kind": "field"}, ["robots.sensors.0.kind: the field sensor needs a field, and the scenario has none"]),
        (
            {"kind": "sonar"},
            [f"robots.sensors.0.kind: expected a built-in sensor ({', '.join(SENSORS)}) or module:Class, got 'sonar'"],
        ),
        (
            {"kind": "no_such_module:Sensor"},
            ["robots.sensors.0.kind: cannot import 'no_such_module': No module named 'no_such_module'"],
        ),
        (
            {"kind": "other_peoples:Barometer"},
            ["robots.sensors.0.kind: module 'other_peoples' has no class 'Barometer'; did you mean Hygrometer?"],
        ),
        (
            {"kind": "other_peoples:Blind"},
            ["robots.sensors.0.kind: other_peoples:Blind is no sensor: it has no method read(scene, robots)"],
        ),
        (
            {"kind": "other_peoples:Mailbox"},
            [
                "robots.sensors.0.kind: other_peoples:Mailbox is no sensor: its `field` must name what it fills, "
                "got 'inbox'"
            ],
        ),
        (
            {"kind": "other_peoples:Untyped"},
            [
                "robots.sensors.0.kind: other_peoples:Untyped is no sensor: its `Parameters` must be a subclass of "
                "zwerm.scenario.types.Table"
            ],
        ),
        (
            {"kind": "other_peoples:Lonely"},
            [
                "robots.sensors.0.kind: other_peoples:Lonely is no sensor: its constructor must take "
                "(parameters, surroundings)"
            ],
        ),
        (
            {"kind": "other_peoples:Thermometer", "unit_m": 0},
            ["robots.sensors.0.unit_m: expected > 0, got 0"],
        ),
    ],
)
def test_a_mistake_in_a_table_is_one_line(make, table, lines):
    assert mistakes(make, table) == [f"x.toml: {line}" for line in lines]


def test_mistakes_in_several_tables_are_reported_at_once(make):
    assert mistakes(make, {"kind": "pose", "sd_m": -1}, {"kind": "compass"}, {"kind": "sonor:"}) == [
        "x.toml: robots.sensors.0.sd_m: expected >= 0, got -1",
        f"x.toml: robots.sensors.2.kind: expected a built-in sensor ({', '.join(SENSORS)}) or module:Class, got 'sonor:'",
    ]


def test_two_sensors_cannot_fill_the_same_field(make):
    assert mistakes(make, {"kind": "pose"}, {"kind": "bearings"}, {"kind": "pose", "sd_m": 0.1}) == [
        "x.toml: robots.sensors.2.kind: fills pose, as robots.sensors.0 does, got 'pose'"
    ]
    hygrometer = {"kind": "other_peoples:Hygrometer"}
    assert mistakes(make, hygrometer, hygrometer) == [
        "x.toml: robots.sensors.1.kind: fills humidity, as robots.sensors.0 does, got 'other_peoples:Hygrometer'"
    ]


def test_sensors_of_users_are_collected_in_extra_by_their_names(make, scene):
    sensors = make(
        {"kind": "other_peoples:Thermometer", "unit_m": 0.5}, {"kind": "compass"}, {"kind": "other_peoples:Hygrometer"}
    )
    assert [sensor.field for sensor in sensors] == ["compass_rad", "extra"]
    readings = sensors[1].read(scene, scene.present_ids())
    assert readings == [
        {"temperature": (1.0,), "humidity": (0.5, 0.0)},
        {"temperature": (4.0,), "humidity": (0.5, 2.0)},
    ]
    observation = Observation(tick=0, time_s=0.0, extra=readings[1])
    assert msgspec.msgpack.decode(encode(observation), type=Observation) == observation


def test_a_users_sensor_may_replace_a_built_in_one(make, scene):
    (sensor,) = make({"kind": "other_peoples:OwnLineOfSight"})
    assert sensor.field == "line_of_sight"
    assert sensor.read(scene, scene.present_ids()) == [True, True]


@pytest.mark.parametrize("kind", sorted(SENSORS))
def test_the_stimuli_of_a_sensor_cross_the_wire_and_its_traits_agree_with_them(kind):
    found = find(kind)
    random = np.random.Generator(np.random.Philox(7))
    stimuli = [found.rest(), found.extremes(), *(found.stimulus(random, count) for count in (0, 1, 5))]
    for reading in stimuli:
        filled = {found.field: reading} if found.field in SENSOR_FIELDS else {"extra": {found.field: reading}}
        observation = Observation(tick=0, time_s=0.0, **filled)
        assert decode_observation(encode(observation)) == observation
    assert found.has_items == (isinstance(found.rest(), tuple) and len(found.rest()) == 0)
    if found.wake_event:
        assert hasattr(Wake(), found.wake_event)
        assert found.signature(found.stimulus(random, 3)) != found.signature(found.rest())


def test_a_sensor_that_does_not_inherit_has_the_traits_of_the_base_class():
    found = find("other_peoples:Thermometer")
    assert found.dark is None
    assert not found.has_items
    assert found.rest() == (0.0,)


class Dried(Controller):
    """Needs a sensor that is outside the catalogue, by the field that the sensor fills."""

    sensors = ("humidity",)

    def step(self, observation: Observation) -> Command:
        assert observation.extra is not None
        return Command(telemetry={"humidity": observation.extra["humidity"][0]})


def test_a_controller_names_a_sensor_of_a_users_own_by_its_field() -> None:
    robots = {"controller": f"{__name__}:Dried", "sensors": [{"kind": "other_peoples:Hygrometer"}]}
    check_controllers(scenario(robots=robots))
    check_controller(Dried, sensors=["other_peoples:Hygrometer"])
    with pytest.raises(ScenarioError, match="needs the sensor 'humidity'"):
        check_controllers(scenario(robots=robots | {"sensors": [{"kind": "compass"}]}))
