"""Whole runs in a small hall: every combination of services, loss, small packets, crashes, partitions."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from zwerm.agents.landmark_exploration.mapping.bearing_steps import BearingSnapshot
from zwerm.agents.landmark_exploration.mapping.landmark_map import LandmarkMap
from zwerm.agents.landmark_exploration.mapping.map_file import map_of_reports, write_map
from zwerm.agents.landmark_exploration.sharing import landmark_messages as messages
from zwerm.errors import ControllerError, ScenarioError
from zwerm.run.result import RunResult
from zwerm.run.runner import run
from zwerm.scenario.load import load, read, validate
from zwerm.scenario.tables import Scenario

# A hall of 4 x 3 ranges with one pillar; four robots.
HALL = {"size_m": [4.0, 3.0], "obstacles": [[[1.4, 1.0], [2.6, 1.0], [2.6, 2.0], [1.4, 2.0]]]}
GOSSIP = {"map": "gossip", "assignment": "claims"}
MIXED = [{"map": "coordinator", "assignment": "claims"}, {"map": "gossip", "assignment": "coordinator"}]


def hall(services: dict[str, str] | None = None, **tables: Any) -> Scenario:
    """Return the scenario landmark-free in the small hall, changed by whole tables."""
    base = read(load("landmark-free").folder / "landmark-free.toml")
    base |= {"name": "hall", "arena": HALL, "time": {"dt_s": 0.1, "duration_s": 400.0}}
    base["robots"] |= {"count": 4, "parameters": {"robots_expected": 4, "dead_ticks": 600}}
    base["services"] = services or {"map": "coordinator", "assignment": "coordinator"}
    for name, table in tables.items():
        base[name] = base.get(name, {}) | table if isinstance(table, dict) else table
    return validate(base, "hall.toml", load("landmark-free").folder)


def ran(scenario: Scenario, seed: int = 1) -> RunResult:
    result = run(scenario, seed, "inline")
    assert not result.tracebacks, next(iter(result.tracebacks.values()))
    return result


@pytest.mark.parametrize("assignment", ["coordinator", "claims"])
@pytest.mark.parametrize("map_", ["coordinator", "gossip"])
def test_every_combination_of_services_explores_everything_and_ends(map_: str, assignment: str) -> None:
    result = ran(hall({"map": map_, "assignment": assignment}))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.93
    assert result.metrics["landmark_complex_holes"] == result.metrics["obstacles"] == 1
    assert result.metrics["open_frontiers"] == 0
    assert result.metrics.get("concluded_early", 0.0) == 0.0


@pytest.mark.parametrize("services", [None, GOSSIP, *MIXED])
def test_with_half_of_all_messages_lost_all_is_explored(services: dict[str, str] | None) -> None:
    lossy: dict[str, Any] = {"radio": {"loss": 0.5}}
    if services is not GOSSIP:
        lossy["uplink"] = {"loss": 0.5}
    result = ran(hall(services, **lossy))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.93
    assert result.metrics.get("concluded_early", 0.0) == 0.0


def test_with_a_radio_range_below_that_of_sight_all_is_explored() -> None:
    result = ran(hall(GOSSIP, radio={"range_m": 0.7}))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.93
    assert result.metrics["concluded_early"] == 0.0


@pytest.mark.parametrize("services", [None, GOSSIP])
def test_packets_of_64_bytes_are_enough(services: dict[str, str] | None, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    write = messages.write

    def writing(message: Any) -> bytes:
        packet = write(message)
        sizes.append(len(packet))
        return packet

    monkeypatch.setattr(messages, "write", writing)
    tables: dict[str, Any] = {"robots": {"parameters": {"robots_expected": 4, "message_bytes_max": 64}}}
    if services is None:
        tables["coordinator"] = {"controller": "landmark-exploration", "parameters": {"message_bytes_max": 64}}
    result = ran(hall(services, **tables))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.93
    assert 40 < max(sizes) <= 64


def test_without_bearings_the_hall_is_mapped_and_its_pillar_found() -> None:
    base = read(load("landmark-presence").folder / "landmark-presence.toml")
    base |= {"name": "hall", "arena": HALL, "time": {"dt_s": 0.1, "duration_s": 400.0}}
    base["robots"] |= {"count": 4, "parameters": {"robots_expected": 4, "dead_ticks": 600, "presence_only": True}}
    result = ran(validate(base, "hall.toml", load("landmark-presence").folder))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.8
    assert result.metrics["landmark_complex_holes"] == result.metrics["obstacles"] == 1
    assert result.metrics["concluded_early"] == 0.0


CRASHES = {
    "for good": [{"kind": "crash", "nodes": [1], "at_s": 8.0}],
    "without memory": [{"kind": "crash", "nodes": [1, 2], "at_s": 8.0, "until_s": 18.0}],
}


@pytest.mark.parametrize("how", CRASHES)
@pytest.mark.parametrize("services", [None, GOSSIP])
def test_a_robot_that_crashes_while_it_holds_a_frontier_delays_no_robot(
    how: str, services: dict[str, str] | None
) -> None:
    faults = CRASHES[how]
    result = ran(hall(services, faults=faults, robots={"on_crash": "continue"}))
    assert result.outcome == "completed"
    assert result.crashed
    assert result.metrics["completion_fraction"] > 0.9
    assert result.metrics.get("concluded_early", 0.0) == 0.0


def test_a_coordinator_that_loses_its_memory_gets_the_map_again() -> None:
    faults = [{"kind": "crash", "nodes": ["coordinator"], "at_s": 15.0, "until_s": 18.0}]
    result = ran(hall(None, faults=faults))
    assert result.outcome == "completed"
    assert result.restarted
    assert result.metrics["completion_fraction"] > 0.93


def test_a_partition_that_heals_leaves_one_map() -> None:
    faults = [{"kind": "partition", "groups": [[0, 1], [2, 3]], "at_s": 2.0, "for_s": 30.0}]
    result = ran(hall(GOSSIP, faults=faults))
    assert result.outcome == "completed"
    assert result.metrics["concluded_early"] == 0.0
    assert result.metrics["completion_fraction"] > 0.93


def test_the_same_seed_gives_the_same_trace_and_another_seed_another() -> None:
    short = {"dt_s": 0.1, "duration_s": 15.0}
    first, again, other = (run(hall(GOSSIP, time=short), seed, "inline") for seed in (1, 1, 2))
    assert first.trace == again.trace
    assert first.trace != other.trace


def test_processes_give_the_same_trace_as_inline() -> None:
    short = {"dt_s": 0.1, "duration_s": 8.0}
    assert run(hall(time=short), 1, "processes").trace == run(hall(time=short), 1, "inline").trace


# A hall of 1.6 x 1.2 ranges in which robots find what there is in little time.
CLOSET = {"size_m": [1.6, 1.2]}
TRIANGLE = [[0.4, 0.3], [1.2, 0.3], [0.8, 0.9]]


@pytest.mark.parametrize("services", [None, GOSSIP])
@pytest.mark.parametrize(
    "landmarks",
    [[[0.8, 0.6]], [[0.2, 0.6], [0.6, 0.6], [1.0, 0.6], [1.4, 0.6]], [[0.8, 0.6], [0.8, 0.6], [0.8, 0.6]]],
    ids=["one", "collinear", "co-located"],
)
def test_landmarks_that_span_no_area_are_never_a_map_that_is_completed(
    landmarks: list[list[float]], services: dict[str, str] | None
) -> None:
    short = {"dt_s": 0.1, "duration_s": 60.0}
    result = ran(hall(services, arena=CLOSET, scatter=None, landmarks=landmarks, time=short, robots={"count": 2}))
    assert result.outcome == "time-limit"


@pytest.mark.parametrize("services", [None, GOSSIP])
@pytest.mark.parametrize("more", [[TRIANGLE[0]], [[1.5, 1.1]]], ids=["co-located", "in a wall"])
def test_landmarks_in_one_place_or_in_a_wall_do_not_hinder_the_others(
    more: list[list[float]], services: dict[str, str] | None
) -> None:
    walled = CLOSET | {"obstacles": [[[1.4, 1.0], [1.6, 1.0], [1.6, 1.2], [1.4, 1.2]]]}
    tables = {"count": 2, "parameters": {"robots_expected": 2, "dead_ticks": 600}}
    result = ran(hall(services, arena=walled, scatter=None, landmarks=[*TRIANGLE, *more], robots=tables))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.9


def test_a_landmark_sensor_without_landmarks_is_refused_in_one_line() -> None:
    with pytest.raises(ScenarioError, match="the landmark sensor needs landmarks"):
        run(hall(scatter=None), 1, "inline")


def test_robots_find_every_goal_by_a_map_that_others_made(tmp_path: Any) -> None:
    scattered = {"dispersion_m": 0.57735, "seed": 3}
    explored = ran(hall(scatter=scattered))
    (tmp_path / "map.json").write_text(write_map(map_of_reports(each.snapshot for each in explored.snapshots)))
    base = read(load("landmark-navigate").folder / "landmark-navigate.toml")
    base |= {"name": "hall", "arena": HALL, "scatter": scattered}
    base["robots"] |= {"count": 3, "parameters": {"map_file": "map.json", "random_goals": 4}}
    result = ran(validate(base, "navigate.toml", tmp_path), 2)
    assert result.outcome == "completed"
    assert result.metrics["navigation_goals"] == 12
    assert result.metrics["navigation_success_fraction"] == 1.0


def test_a_map_file_that_is_not_there_is_one_line() -> None:
    with pytest.raises(ScenarioError) as error:
        run("landmark-navigate", 1, "inline", ["robots.parameters.map_file=nowhere.json"])
    (line,) = error.value.mistakes
    assert "robots.parameters.map_file: cannot be read: No such file or directory, got 'nowhere.json'" in line


@pytest.mark.parametrize(
    ("goals", "line"),
    [
        ([[0, 9_999]], "robots.parameters.goals: expected landmarks of the map, got [0, 9999]: [9999] are not in it"),
        ([[]], "robots.parameters.goals[0]: expected array of length >= 1, got [[]]"),
    ],
)
def test_goals_that_the_map_does_not_have_are_refused_in_one_line(goals: list[list[int]], line: str) -> None:
    with pytest.raises((ControllerError, ScenarioError)) as error:
        run("landmark-navigate", 1, "inline", [f"robots.parameters.goals={goals}"])
    assert str(error.value).endswith(line)


@pytest.mark.parametrize(
    ("observations", "line"),
    [([], "expected a map with an observation"), ([BearingSnapshot((1, 2, 3), (88, 88, 88))], "expected bearings, or")],
    ids=["no observation", "no bearings"],
)
def test_a_map_by_which_no_robot_navigates_is_refused_in_one_line(
    observations: list[BearingSnapshot], line: str, tmp_path: Path
) -> None:
    map_ = LandmarkMap()
    for each in observations:
        map_.observe(each)
    (tmp_path / "map.json").write_text(write_map(map_))
    with pytest.raises(ControllerError, match=rf"^robots\.parameters\.map_file: {line}"):
        run("landmark-navigate", 1, "inline", [f"robots.parameters.map_file='{tmp_path / 'map.json'}'"])


@pytest.mark.parametrize("of", ["robots", "coordinator"])
def test_a_cap_below_the_longest_entry_is_refused_in_one_line(of: str) -> None:
    with pytest.raises(ScenarioError, match=rf"{of}\.parameters\.message_bytes_max: expected >= 64, got 63"):
        run("landmark-free", 1, "inline", [f"{of}.parameters.message_bytes_max=63"])


def test_an_unknown_strategy_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(ScenarioError) as error:
        run("landmark-free", 1, "inline", ["coordinator.parameters.strategy=auction"])
    (line,) = error.value.mistakes
    assert line.endswith("strategy: expected 'cost-utility' or 'nearest-frontier' or 'min-pos', got \"auction\"")


@pytest.mark.parametrize("strategy", ["nearest-frontier", "min-pos"])
def test_baselines_explore_everything_too(strategy: str) -> None:
    table = {"controller": "landmark-exploration", "parameters": {"strategy": strategy}}
    result = ran(hall(None, coordinator=table))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.93


def test_a_random_walk_maps_what_it_sees_and_is_slower() -> None:
    short = {"dt_s": 0.1, "duration_s": 40.0}
    parameters = {"robots_expected": 4, "strategy": "random-walk", "turn_sd_rad": 0.8}
    walk = ran(hall(GOSSIP, time=short, robots={"parameters": parameters}))
    explored = ran(hall(GOSSIP, time=short))
    assert walk.outcome == "time-limit"
    assert 0.5 < walk.metrics["completion_fraction"] < explored.metrics["completion_fraction"]


def test_a_building_of_a_bitmap_is_explored(tmp_path: Path) -> None:
    cells = np.full((56, 76), 255, np.uint8)
    cells[[*range(3), *range(53, 56)], :] = cells[:, [*range(3), *range(73, 76)]] = 0
    cells[18:38, 26:50] = 0
    Image.fromarray(cells).save(tmp_path / "building.png")
    base = read(load("landmark-map").folder / "landmark-map.toml")
    base |= {"name": "building", "arena": {"map": "building.png", "resolution_m": 0.05}}
    base["robots"] |= {"count": 4, "parameters": {"robots_expected": 4}}
    result = ran(validate(base, "building.toml", tmp_path))
    assert result.outcome == "completed"
    assert result.metrics["completion_fraction"] > 0.9
    assert result.metrics["landmark_complex_holes"] == result.metrics["obstacles"] == 1
