"""Faults of sensors change the readings of their robots and sensors, and no others."""

import math
from typing import Any

import numpy as np
import pytest
from support import scenario

from zwerm.run.assembly import assemble
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import Bearing, Observation, decode_observation
from zwerm.world.faults.sensing.sensor_noise import SensorNoise, SensorNoiseTable
from zwerm.world.world import World

SENSORS = [
    {"kind": kind} for kind in ("bearings", "neighbours", "touch", "line_of_sight", "pose", "compass", "landmarks")
]
# 0 looks at 1 and 2 behind it; 3 touches 0's back.
POSES = [[0.5, 0.5, 0.0], [1.0, 0.5, 1.0], [1.5, 0.5, 2.0], [0.42, 0.5, 0.0]]


def faulty(*faults: dict[str, Any]) -> Scenario:
    robots = {
        "count": 4,
        "controller": "radioed:Counts",
        "sensors": SENSORS,
        "body": {"kind": "holonomic", "radius_m": 0.04, "collide": False},
        "placement": {"kind": "poses", "poses": POSES},
    }
    return scenario(robots=robots, faults=list(faults), landmarks=[[1.0, 1.5], [0.2, 1.8]], time={"duration_s": 100.0})


def look(world: World) -> dict[int, Observation]:
    """Return the observations of all robots, and advance by a tick without answers."""
    world.begin()
    nodes, payloads = world.observe()
    world.advance()
    return dict(zip(nodes, map(decode_observation, payloads), strict=True))


def seen(observation: Observation) -> list[int]:
    return [bearing.node for bearing in observation.bearings or ()]


def test_a_robot_with_a_dead_beacon_is_not_seen_and_sees_and_touches_others() -> None:
    world = assemble(faulty({"kind": "dead_beacon", "robots": [1, 3], "at_s": 0.1, "for_s": 0.1}), 1)
    before, during, after = look(world), look(world), look(world)
    assert seen(before[0]) == seen(after[0]) == [1, 2, 3]
    assert seen(during[0]) == [2]
    assert [each.node for each in during[0].neighbours or ()] == [2]
    assert seen(during[1]) == [0, 2]
    assert before[0].touch == during[0].touch != ()
    assert [each[0].line_of_sight for each in (before, during, after)] == [True, True, True], "2 is behind 1"
    both = assemble(faulty({"kind": "dead_beacon", "robots": [1, 2], "at_s": 0.0}), 1)
    assert look(both)[0].line_of_sight is False
    assert look(both)[3].line_of_sight is True


def test_a_camera_blackout_darkens_cameras_and_leaves_other_sensors_unchanged() -> None:
    world = assemble(faulty({"kind": "camera_blackout", "robots": [0], "at_s": 0.1}), 1)
    before, during = look(world), look(world)
    assert (during[0].bearings, during[0].neighbours, during[0].landmarks) == ((), (), ())
    assert during[0].line_of_sight is False
    assert during[0].touch == before[0].touch
    assert during[0].pose == before[0].pose
    assert during[1].bearings == before[1].bearings


def test_a_stuck_switch_is_always_closed_or_always_open_and_the_others_work() -> None:
    world = assemble(
        faulty(
            {"kind": "stuck_touch", "robots": [0], "switch": 2, "closed": True, "at_s": 0.1, "for_s": 0.1},
            {"kind": "stuck_touch", "robots": [0], "switch": 4, "closed": False, "at_s": 0.2},
        ),
        1,
    )
    felt = [[round(math.degrees(contact.bearing_rad)) for contact in look(world)[0].touch or ()] for _ in range(3)]
    assert felt == [[180], [90, 180], []]


def test_noise_has_its_bias_and_deviation_and_does_not_change_ids() -> None:
    noise = {"kind": "sensor_noise", "sensor": "bearings", "sd": 0.1, "bias": 0.3, "robots": [0], "at_s": 0.1}
    world = assemble(faulty(noise), 1)
    clear = look(world)
    errors = []
    for _ in range(300):
        noisy = look(world)
        assert seen(noisy[0]) == [1, 2, 3]
        assert noisy[1].bearings == clear[1].bearings
        pairs = zip(noisy[0].bearings or (), clear[0].bearings or (), strict=True)
        errors += [math.remainder(a.bearing_rad - b.bearing_rad, math.tau) for a, b in pairs]
    assert abs(np.mean(errors) - 0.3) < 2.576 * 0.1 / math.sqrt(900)
    assert abs(np.std(errors) - 0.1) < 2.576 * 0.1 / math.sqrt(2 * 900)


def test_items_are_missing_and_added_at_their_rates() -> None:
    noise = {"kind": "sensor_noise", "missed_fraction": 0.25, "false_fraction": 0.5, "at_s": 0.0}
    sensors = ("bearings", "neighbours", "landmarks", "touch", "line_of_sight")
    world = assemble(faulty(*[noise | {"sensor": sensor} for sensor in sensors]), 1)
    looks = [look(world) for _ in range(200)]

    def rate(value: np.floating[Any], expected: float, count: int) -> None:
        assert abs(value - expected) < 2.576 * math.sqrt(expected * (1 - expected) / count), (value, expected)

    # Robot 0 sees all others: what it misses is missed, unless it is imagined again.
    missed = np.mean([[node not in seen(each[0]) for node in (1, 2, 3)] for each in looks])
    assert 0.25 - 0.15 < missed < 0.25
    rate(np.mean([each[0].line_of_sight is False for each in looks]), 0.25, 200)
    rate(np.mean([each[2].line_of_sight is True for each in looks]), 0.5, 200)
    rate(np.mean([bool(each[2].touch) for each in looks]), 0.5, 200)
    for each in looks:
        assert seen(each[0]) == sorted(set(seen(each[0]))), "ids ascend, each once"
        assert 0 not in seen(each[0])


def test_every_sensor_with_numbers_takes_the_same_noise() -> None:
    kinds = ("neighbours", "pose", "compass", "landmarks")
    world = assemble(faulty(*[{"kind": "sensor_noise", "sensor": kind, "bias": 0.5, "at_s": 0.1} for kind in kinds]), 1)
    before, after = look(world)[1], look(world)[1]
    assert before.pose is not None
    assert after.pose is not None
    assert after.pose.x_m == before.pose.x_m + 0.5
    assert after.compass_rad == (before.compass_rad or 0.0) + 0.5
    assert after.neighbours is not None
    assert before.neighbours is not None
    assert after.neighbours[0].y_m == before.neighbours[0].y_m + 0.5
    assert after.neighbours[0].node == before.neighbours[0].node
    assert (after.landmarks or ())[1].landmark == 1


def test_a_fault_of_another_sensor_changes_no_random_numbers() -> None:
    one = {"kind": "sensor_noise", "sensor": "bearings", "sd": 0.1, "at_s": 0.0}
    other = {"kind": "sensor_noise", "sensor": "pose", "sd": 0.2, "at_s": 0.0}

    def bearings(*faults: dict[str, Any]) -> tuple[Bearing, ...] | None:
        return look(assemble(faulty(*faults), 1))[0].bearings

    assert bearings(one) == bearings(other, one) != bearings()


def test_a_new_optional_key_of_a_fault_changes_no_random_number_and_a_key_that_is_written_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Grown(SensorNoiseTable):
        """The table of a later version, with one more optional key."""

        drift: float = 0.0

    noise = {"kind": "sensor_noise", "sensor": "bearings", "sd": 0.1, "at_s": 0.0}
    before = look(assemble(faulty(noise), 1))
    monkeypatch.setattr(SensorNoise, "Parameters", Grown)
    assert look(assemble(faulty(noise), 1)) == before
    assert look(assemble(faulty(noise | {"drift": 0.0}), 1)) != before
