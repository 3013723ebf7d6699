"""Faults as plug-ins: the catalogue finds each kind, and a fault of a user runs by `module:Class`."""

import json
from typing import Any

import numpy as np
import pytest
from support import scenario

from zwerm.catalogue import FAULTS
from zwerm.errors import ScenarioError
from zwerm.run.assembly import assemble
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.tables import Scenario
from zwerm.wire.messages import decode_observation
from zwerm.world.faults import Fault, FaultTable
from zwerm.world.faults.registry import find

POSES = [[0.3, 0.3, 0.0], [1.7, 0.3, 0.0], [0.3, 1.7, 0.0], [1.7, 1.7, 0.0]]
FLOOD = {"kind": "own_faults:Flood", "area_m": [0.0, 0.0, 1.0, 1.0]}


def beacons(*faults: dict[str, Any], **tables: Any) -> Scenario:
    """Return four beacons in the corners of a square; robot 0 is in the area of `FLOOD`."""
    robots = {
        "count": 4,
        "controller": "beacon",
        "sensors": [{"kind": "bearings"}, {"kind": "touch"}],
        "body": {"kind": "holonomic", "radius_m": 0.05},
        "placement": {"kind": "poses", "poses": POSES},
    }
    return scenario(robots=robots, faults=list(faults), **{"radio": {"check": True}, **tables})


def dropped(result: RunResult, cause: str) -> dict[tuple[int, int], int]:
    """Return the packets that were dropped for a cause, by sender and receiver."""
    links = result.radio["channels"]["robots"]["links"]
    pairs = zip(links["sender"], links["receiver"], strict=True)
    return {pair: count for pair, count in zip(pairs, links["dropped"].get(cause, []), strict=False) if count}


@pytest.mark.parametrize("kind", FAULTS)
def test_the_catalogue_finds_a_documented_fault_class_in_a_file_of_its_own(kind: str) -> None:
    found = find(kind)
    assert issubclass(found, Fault)
    assert issubclass(found.Parameters, FaultTable)
    assert FAULTS[kind] == f"{found.__module__}:{found.__name__}"
    assert found.__module__.rpartition(".")[2] == kind
    assert found.__doc__
    assert [other for other in FAULTS if FAULTS[other] == FAULTS[kind]] == [kind]


def test_a_fault_of_a_user_acts_on_radio_sensors_and_programs_while_it_is_active() -> None:
    chosen = beacons(FLOOD | {"at_s": 0.5, "for_s": 0.5})
    result = run(chosen, 1, "inline")
    # Robots send at ticks 5, 7 and 9 of the ten ticks of the flood: they take two ticks for each answer.
    wet = dropped(result, "flood")
    assert set(wet) == {(1, 0), (2, 0), (3, 0)}
    assert len(set(wet.values())) == 1
    assert 0 < min(wet.values()) <= 3
    assert result.as_json()["nodes"]["slow"] == [0, 1, 2, 3]
    assert result.trace != run(beacons(), 1, "inline").trace
    assert result.trace == run(chosen, 1, "inline").trace


def test_a_fault_of_a_user_changes_readings_of_sensors_by_their_traits() -> None:
    world = assemble(beacons(FLOOD | {"at_s": 0.1}), 1)
    looks = []
    for _ in range(2):
        world.begin()
        nodes, payloads = world.observe()
        world.advance()
        looks.append(dict(zip(nodes, map(decode_observation, payloads), strict=True)))
    before, during = looks
    assert before[0].bearings != ()
    assert (during[0].bearings, during[1].bearings) == ((), before[1].bearings)
    assert during[0].touch == before[0].touch == (), "touch is no camera"


def test_a_fault_of_a_user_need_not_inherit_and_checks_its_own_parameters() -> None:
    static = {"kind": "own_faults:Static", "at_s": 0.0}
    lost = sum(dropped(run(beacons(static | {"fraction": 0.5}), 1, "inline"), "static").values())
    sent = 20 * 4 * 3
    assert abs(lost / sent - 0.5) < 2.576 * 0.5 / np.sqrt(sent)
    with pytest.raises(ScenarioError) as caught:
        assemble(beacons(static | {"fraction": 0.0}), 1)
    assert caught.value.mistakes == ["small.toml: faults.0.fraction: expected > 0, got 0"]


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("own_faults:Drought", "module 'own_faults' has no class 'Drought'"),
        ("own_faults:WithoutTable",
         "own_faults:WithoutTable is no fault: its `Parameters` must be a subclass of FaultTable"),
        ("own_models:WithoutContext", "own_models:WithoutContext is no fault: its constructor must take (parameters, context)"),
    ],
)  # fmt: skip
def test_a_class_that_is_no_fault_is_refused_in_one_line(kind: str, line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        assemble(beacons({"kind": kind, "at_s": 0.0}), 1)
    assert caught.value.mistakes == [f"small.toml: faults.0.kind: {line}"]


# --- random schedules -----------------------------------------------------------------------------------------------


def drawn(**rates: float) -> list[dict[str, Any]]:
    """Return the random schedule of seed 1."""
    world = assemble(beacons(random_faults=rates), 1)
    return [table.model_dump() for table in world.schedule.tables]


def test_a_random_schedule_has_faults_of_a_user_and_they_change_no_other() -> None:
    rates = {"own_faults:Flood_per_h": 20_000.0, "cut_per_h": 20_000.0, "mean_s": 0.5}
    found = drawn(**rates)
    assert {fault["kind"] for fault in found} == {"own_faults:Flood", "cut"}
    assert [fault for fault in found if fault["kind"] == "cut"] == drawn(cut_per_h=20_000.0, mean_s=0.5)
    assert json.dumps(found) == json.dumps(run(beacons(random_faults=rates), 1, "inline").faults)


@pytest.mark.parametrize(
    ("rates", "line"),
    [
        ({"heal_per_h": 1.0}, "random_faults.heal_per_h: there are no random faults of this kind, got 1"),
        ({"own_faults:Static_per_h": 2.0},
         "random_faults.own_faults:Static_per_h: there are no random faults of this kind, got 2"),
        ({"own_faults:Drought_per_h": 1.0},
         "random_faults.own_faults:Drought_per_h: module 'own_faults' has no class 'Drought', got 1"),
    ],
)  # fmt: skip
def test_a_rate_of_a_kind_that_has_no_random_faults_is_refused_in_one_line(rates: dict[str, float], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        drawn(**rates)
    assert caught.value.mistakes == [f"small.toml: {line}"]


@pytest.mark.parametrize(
    ("rates", "line"),
    [
        ({"explode_per_h": 1.0, "crash_rate": 1.0}, "random_faults: expected seed, mean_s, or KIND_per_h with a built-in "
         f"fault ({', '.join(FAULTS)}) or module:Class, got explode_per_h, crash_rate"),
        ({"crash_per_h": -1.0}, "random_faults.crash_per_h: expected >= 0, got -1.0"),
        ({"own_faults:Flood_per_h": "often"}, 'random_faults.own_faults:Flood_per_h: expected a number, got "often"'),
    ],
)  # fmt: skip
def test_a_mistake_in_a_rate_is_one_line(rates: dict[str, Any], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        beacons(random_faults=rates)
    assert caught.value.mistakes == [f"small.toml: {line}"]
