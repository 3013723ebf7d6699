"""Teams in the emulator, with real bodies: coverage by exact polygons, under loss, deaths and partitions."""

from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from random_arenas import ORIGIN_M, random_arena, start_group
from shapely.geometry import Polygon

from zwerm.agents.runtime.node import Node
from zwerm.deploy.node_specs import node_specs
from zwerm.errors import ScenarioError
from zwerm.link.memory import MemoryLink
from zwerm.run.assembly import assemble
from zwerm.run.runner import run
from zwerm.scenario.load import tables_of, validate
from zwerm.scenario.tables import Scenario
from zwerm.world.drivers.lockstep import LockStep
from zwerm.world.metrics.robot_teams import coverage
from zwerm.world.world import World

FOOTPRINT_M, RADIUS_M = 0.5, 0.25
HALL: dict[str, Any] = {
    "polygon": [[0.0, 0.0], [9.0, 0.0], [9.0, 6.0], [0.0, 6.0]],
    "obstacles": [[[4.1, 2.2], [6.0, 2.6], [5.4, 4.0]]],
}


class Outcome(NamedTuple):
    """The outcome of a run; `gap_m` is the smallest distance between two bodies."""

    outcome: str
    coverage: dict[str, float]
    gap_m: float
    time_s: float


def team(count: int, arena: dict[str, Any] | None = None, poses: Any = None, **tables: Any) -> Scenario:
    """Return a scenario of `count` robots that start in line, in a small hall unless said otherwise."""
    base, _ = tables_of("robot-teams", ())
    base["name"] = "small"
    base["arena"] = arena or HALL
    base["robots"]["count"] = count
    line = poses or [[0.6 + 0.95 * i, 5.0, 0.0] for i in range(count)]
    base["robots"]["placement"] = {"kind": "poses", "poses": line}
    base["robots"]["parameters"]["origin_m"] = 0.55 if arena is None else ORIGIN_M
    base["time"]["duration_s"] = 900.0
    for name, table in tables.items():
        base[name] = base.get(name, {}) | table if isinstance(table, dict) else table
    return validate(base, "small.toml", Path())


def cover(scenario: Scenario, seed: int = 1) -> Outcome:
    world = assemble(scenario, seed)
    nodes = {node: Node(*spec).answer for node, spec in node_specs(scenario, seed).items()}
    paths = [world.scene.position.copy()]
    gaps = [np.inf]

    def note(world: World) -> None:
        position = world.scene.position
        paths.append(position.copy())
        for i, j in combinations(range(len(position)), 2):
            gaps.append(float(np.hypot(*(position[i] - position[j]))) - 2.0 * RADIUS_M)

    link = MemoryLink(nodes)
    outcome = LockStep(world, link, [note], link).run()
    tracks = np.array(paths)
    measured = coverage(world.scene.arena.free, [tracks[:, i] for i in range(tracks.shape[1])], RADIUS_M, FOOTPRINT_M)
    return Outcome(outcome, measured, min(gaps), world.scene.time_s)


def check(found: Outcome) -> None:
    assert found.outcome == "completed"
    assert found.coverage["coverage_fraction"] >= 0.999
    assert found.gap_m > 0.0


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_hall_with_an_obstacle_is_covered(count: int) -> None:
    check(cover(team(count)))


@pytest.mark.parametrize("seed", [0, 8])
@pytest.mark.parametrize("count", [1, 2])
def test_random_arenas_are_covered(count: int, seed: int) -> None:
    arena, poses = random_arena(seed, count)
    check(cover(team(count, arena, poses)))


def test_a_wall_almost_parallel_to_a_slice_is_no_trap() -> None:
    """Here the ends that sweeps and traces measure on one wall are 0.8 m apart."""
    arena, poses = random_arena(13, 1)
    check(cover(team(1, arena, poses)))


def test_two_robots_are_faster_than_one_and_repeat_more() -> None:
    wide = {"polygon": [[0.0, 0.0], [14.0, 0.0], [14.0, 5.0], [0.0, 5.0]], "obstacles": []}
    poses = [[0.6, 4.0, 0.0], [1.55, 4.0, 0.0]]
    one, two = cover(team(1, wide, poses[:1])), cover(team(2, wide, poses))
    assert two.time_s < 0.9 * one.time_s
    assert two.coverage["repeat_coverage_fraction"] > one.coverage["repeat_coverage_fraction"]


def test_the_lower_bound_is_the_area_over_what_all_footprints_sweep_in_a_second() -> None:
    room = {"polygon": [[0.0, 0.0], [9.0, 0.0], [9.0, 6.0], [0.0, 6.0]], "obstacles": []}
    poses = [[0.6, 5.0, 0.0], [1.55, 5.0, 0.0]]
    metrics = run(team(2, room, poses, time={"duration_s": 0.5}), 1, "inline").metrics
    assert metrics["lower_bound_s"] == pytest.approx(9.0 * 6.0 / (2 * 1.0 * 1.0))


def test_a_run_that_is_stopped_early_has_not_covered_the_hall() -> None:
    found = cover(team(1, time={"duration_s": 30.0}))
    assert found.outcome == "time-limit"
    assert found.coverage["coverage_fraction"] < 0.9


@pytest.mark.parametrize(
    "radio",
    [
        {"loss": 0.3},
        {"models": [{"kind": "gilbert_elliott", "loss_fraction": 0.2, "burst_packets": 8.0}]},
        {"range_m": 4.0},
    ],
    ids=["loss", "bursts", "range"],
)
def test_lost_packets_cost_no_coverage(radio: dict[str, Any]) -> None:
    check(cover(team(3, radio=radio)))


@pytest.mark.parametrize(("node", "at_s"), [(0, 5.0), (0, 25.0), (1, 40.0)])
def test_the_rest_covers_what_a_dead_robot_left(node: int, at_s: float) -> None:
    check(cover(team(3, faults=[{"kind": "crash", "nodes": [node], "at_s": at_s}])))


def test_a_partition_costs_no_coverage() -> None:
    partition = {"kind": "partition", "groups": [[0], [1, 2]], "at_s": 10.0, "for_s": 60.0}
    check(cover(team(3, faults=[partition])))


def test_parts_that_lose_contact_are_each_complete_and_no_robot_is_a_wreck() -> None:
    partition = {"kind": "partition", "groups": [[0], [1, 2]], "at_s": 10.0, "for_s": 2000.0}
    check(cover(team(3, faults=[partition])))


@pytest.mark.parametrize("node", [0, 1])
def test_a_robot_that_stood_still_for_a_minute_is_taken_in_again(node: int) -> None:
    """Others may take it for a wreck meanwhile; the run ends only with its own certificate, after it returned."""
    found = cover(team(2, faults=[{"kind": "pause", "nodes": [node], "at_s": 10.0, "for_s": 60.0}]))
    check(found)
    assert found.time_s > 70.0


def test_a_robot_that_lost_its_memory_is_taken_in_again() -> None:
    result = run(team(2, faults=[{"kind": "restart", "nodes": [1], "at_s": 15.0}]), 1, "inline")
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.999
    assert result.restarted == [1]


def test_two_teams_that_meet_head_on_in_a_slice_dance_around_each_other_and_finish_it() -> None:
    """They start on one slice, too far apart to hear each other: each is a team, and both sweep the slice."""
    poses = [[2.47, 1.0, 0.0], [2.47, 5.0, 0.0]]
    found = cover(team(2, HALL, poses, radio={"range_m": 1.0}))
    check(found)
    assert found.gap_m < 0.1, "they never met"


@pytest.mark.parametrize("count", [1, 2])
def test_a_team_with_a_virtual_frontier_covers_the_hall(count: int) -> None:
    wide = {
        "polygon": [[0.0, 0.0], [12.0, 0.0], [12.0, 7.0], [0.0, 7.0]],
        "obstacles": [[[2.6, 2.4], [5.1, 3.2], [2.9, 4.6]]],
    }
    poses = [[0.6 + 0.95 * i, 6.0, 0.0] for i in range(count)]
    base = team(count, wide, poses)
    parameters = base.robots.parameters | {"virtual_frontier": True}
    scenario = base.model_copy(update={"robots": base.robots.model_copy(update={"parameters": parameters})})
    result = run(scenario, 1, "inline")
    assert result.outcome == "completed"
    assert result.metrics["coverage_fraction"] >= 0.999
    assert result.metrics["telemetry.virtual_frontier_cuts"] > 0.0


def test_the_trace_is_the_same_inline_and_in_processes_and_another_with_another_seed(nothing_left: None) -> None:
    scenario = team(2, time={"duration_s": 15.0}, radio={"loss": 0.3})
    inline = run(scenario, 1, "inline")
    assert run(scenario, 1, "processes").trace == inline.trace
    assert run(scenario, 2, "inline").trace != inline.trace


def test_slices_too_far_apart_are_refused() -> None:
    with pytest.raises((ScenarioError, Exception), match=r"spacing_m: expected at most 2 footprint_m"):
        cover(team(1, robots=team(1).robots.model_dump() | {"parameters": {"spacing_m": 1.1}}))


def test_a_robot_behind_a_wreck_in_the_only_way_sweeps_its_side() -> None:
    """Robot 1 dies in a passage. Robot 0 is behind it, and its last end is on the other side."""
    arena = random_arena(91, 1)[0]
    free = Polygon(arena["polygon"], arena["obstacles"])
    poses = start_group(np.random.default_rng([91, 4]), free, 4, ORIGIN_M)
    check(cover(team(4, arena, poses, faults=[{"kind": "crash", "nodes": [1], "at_s": 75.0}]), 91))
